#include "tendon_path.h"

#include <algorithm>

namespace setae {
namespace sim {
namespace {

// Per mm, relative to the tension: a tendon that turns by 0.1 rad at a station
// sinks 1 um into the bore.
constexpr double kBoreStiffness = 100;
constexpr double kStepTolerance_mm = 1e-5;  // Newton: what remains is its square
constexpr double kLongestStep_mm = 3;
constexpr int kIterations = 40;

struct Block {  // 2 x 2
  double a, b, c, d;
};

// std::hypot guards against overflow, which takes a third of all the time here.
double radius_of(double u, double v) {
  return std::sqrt(u * u + v * v);
}

}  // namespace

void TendonPath::start_from(const TendonPath& other) {
  crossing_ = other.crossing_;
  touches_ = other.touches_;
}

void TendonPath::solve(const Shape& shape, const Vec3& base, const Vec3& top, double bore_radius_mm,
                       double slack_mm) {
  const int last_station = shape.elements;
  top_ = top;
  point_[0] = base;
  point_[last_station] = shape.position[last_station] + shape.rotation[last_station] * top;
  const bool was_bent = touches_;
  converged_ = true;
  touches_ = false;
  for (auto& wrench : wrenches_)
    wrench = {{0, 0, 0}, {0, 0, 0}};
  const auto kept = crossing_;
  if (!straight(shape, bore_radius_mm)) {
    if (was_bent)
      crossing_ = kept;
    bend(shape, bore_radius_mm, slack_mm);
  }
  // The top hole feels the last piece's direction in both cases.
  const int before = touches_ ? last_station - 1 : 0;
  const Vec3 last = point_[last_station] - point_[before];
  const Vec3 pull = into(shape.rotation[last_station], (1 / norm(last)) * last);
  wrenches_[last_station] = {cross(top, pull), pull};
}

// The chord, and whether it keeps inside the bore. Leaves the chord's crossings,
// moved into the bore, as a start for bend().
bool TendonPath::straight(const Shape& shape, double bore_radius_mm) {
  const Vec3 chord = point_[shape.elements] - point_[0];
  length_mm_ = norm(chord);
  bool inside = true;
  for (int j = 1; j < shape.elements; ++j) {
    const Mat3& axes = shape.rotation[j];
    const double slope = dot(axes.ez, chord);
    const Vec3 offset = shape.position[j] - point_[0];
    const double fraction = std::fabs(slope) > 1e-9 ? dot(axes.ez, offset) / slope
                                                    : static_cast<double>(j) / shape.elements;
    const Vec3 at = fraction * chord - offset;
    double u = dot(axes.ex, at), v = dot(axes.ey, at);
    const double radius = std::sqrt(u * u + v * v);
    if (radius > bore_radius_mm) {
      inside = false;
      u *= bore_radius_mm / radius;
      v *= bore_radius_mm / radius;
    }
    crossing_[j] = {u, v};
  }
  return inside;
}

// Newton on the crossings: a convex problem with a block-tridiagonal Hessian.
void TendonPath::bend(const Shape& shape, double bore_radius_mm, double slack_mm) {
  touches_ = true;
  converged_ = false;
  const int inner = shape.elements - 1;
  std::array<Vec3, kMaxElements>& direction = direction_;
  std::array<double, kMaxElements> piece;
  std::array<Crossing, kMaxStations> base, gradient, right, step;
  std::array<Block, kMaxStations> diagonal, upper;
  double base_length = 0, slope = 0, fraction = 1;
  bool have_step = false;

  for (int iteration = 0; iteration < kIterations; ++iteration) {
    for (int j = 1; j <= inner; ++j) {
      point_[j] = shape.position[j] + crossing_[j].u * shape.rotation[j].ex +
                  crossing_[j].v * shape.rotation[j].ey;
    }
    length_mm_ = 0;
    for (int j = 0; j <= inner; ++j) {
      direction[j] = point_[j + 1] - point_[j];
      piece[j] = norm(direction[j]);
      direction[j] = (1 / piece[j]) * direction[j];
      length_mm_ += piece[j];
    }
    for (int j = 1; j <= inner; ++j) {
      const double over = radius_of(crossing_[j].u, crossing_[j].v) - bore_radius_mm;
      if (over > 0)
        length_mm_ += 0.5 * kBoreStiffness * over * over;
    }
    if (length_mm_ < slack_mm) {  // no string could be tauter than the shortest
      converged_ = true;
      break;
    }
    if (have_step) {
      if (length_mm_ > base_length - 1e-4 * fraction * slope + 1e-11 && fraction > 1e-6) {
        fraction *= 0.5;
        for (int j = 1; j <= inner; ++j) {
          crossing_[j] = {base[j].u - fraction * step[j].u, base[j].v - fraction * step[j].v};
        }
        continue;
      }
      if (converged_)
        break;
    }

    for (int j = 1; j <= inner; ++j) {
      const Vec3& ex = shape.rotation[j].ex;
      const Vec3& ey = shape.rotation[j].ey;
      const Vec3& in = direction[j - 1];
      const Vec3& out = direction[j];
      const double in_u = dot(in, ex), in_v = dot(in, ey);
      const double out_u = dot(out, ex), out_v = dot(out, ey);
      gradient[j] = {in_u - out_u, in_v - out_v};
      const double wi = 1 / piece[j - 1], wo = 1 / piece[j];
      const double cross_term = -in_u * in_v * wi - out_u * out_v * wo;
      diagonal[j] = {(1 - in_u * in_u) * wi + (1 - out_u * out_u) * wo + 1e-9, cross_term,
                     cross_term, (1 - in_v * in_v) * wi + (1 - out_v * out_v) * wo + 1e-9};
      if (j < inner) {
        const Vec3& nx = shape.rotation[j + 1].ex;
        const Vec3& ny = shape.rotation[j + 1].ey;
        const double next_u = dot(out, nx), next_v = dot(out, ny);
        upper[j] = {-(dot(ex, nx) - out_u * next_u) * wo, -(dot(ex, ny) - out_u * next_v) * wo,
                    -(dot(ey, nx) - out_v * next_u) * wo, -(dot(ey, ny) - out_v * next_v) * wo};
      }
      const double radius = radius_of(crossing_[j].u, crossing_[j].v);
      const double over = radius - bore_radius_mm;
      if (over > 0) {
        const double nu = crossing_[j].u / radius, nv = crossing_[j].v / radius;
        const double ring = over / radius;
        gradient[j].u += kBoreStiffness * over * nu;
        gradient[j].v += kBoreStiffness * over * nv;
        diagonal[j].a += kBoreStiffness * (nu * nu + ring * nv * nv);
        diagonal[j].d += kBoreStiffness * (nv * nv + ring * nu * nu);
        diagonal[j].b += kBoreStiffness * (nu * nv - ring * nu * nv);
        diagonal[j].c += kBoreStiffness * (nu * nv - ring * nu * nv);
      }
    }

    // Block Thomas.
    right[1] = gradient[1];
    for (int j = 2; j <= inner; ++j) {
      const Block& d = diagonal[j - 1];
      const Block& o = upper[j - 1];
      const double scale = 1 / (d.a * d.d - d.b * d.c);
      const Block x = {(d.d * o.a - d.b * o.c) * scale, (d.d * o.b - d.b * o.d) * scale,
                       (d.a * o.c - d.c * o.a) * scale, (d.a * o.d - d.c * o.b) * scale};
      const double yu = (d.d * right[j - 1].u - d.b * right[j - 1].v) * scale;
      const double yv = (d.a * right[j - 1].v - d.c * right[j - 1].u) * scale;
      diagonal[j].a -= o.a * x.a + o.c * x.c;
      diagonal[j].b -= o.a * x.b + o.c * x.d;
      diagonal[j].c -= o.b * x.a + o.d * x.c;
      diagonal[j].d -= o.b * x.b + o.d * x.d;
      right[j] = {gradient[j].u - (o.a * yu + o.c * yv), gradient[j].v - (o.b * yu + o.d * yv)};
    }
    double longest = 0;
    slope = 0;
    for (int j = inner; j >= 1; --j) {
      double ru = right[j].u, rv = right[j].v;
      if (j < inner) {
        const Block& o = upper[j];
        ru -= o.a * step[j + 1].u + o.b * step[j + 1].v;
        rv -= o.c * step[j + 1].u + o.d * step[j + 1].v;
      }
      const Block& d = diagonal[j];
      const double scale = 1 / (d.a * d.d - d.b * d.c);
      step[j] = {(d.d * ru - d.b * rv) * scale, (d.a * rv - d.c * ru) * scale};
      longest = std::max(longest, std::max(std::fabs(step[j].u), std::fabs(step[j].v)));
    }
    for (int j = 1; j <= inner; ++j)
      slope += gradient[j].u * step[j].u + gradient[j].v * step[j].v;
    fraction = longest > kLongestStep_mm ? kLongestStep_mm / longest : 1;
    base = crossing_;
    base_length = length_mm_;
    have_step = true;
    converged_ = longest < kStepTolerance_mm;
    for (int j = 1; j <= inner; ++j) {
      crossing_[j] = {base[j].u - fraction * step[j].u, base[j].v - fraction * step[j].v};
    }
  }

  for (int j = 1; j <= inner; ++j) {
    const Vec3 arm = {crossing_[j].u, crossing_[j].v, 0};
    const Vec3 force = into(shape.rotation[j], direction[j - 1] - direction[j]);
    wrenches_[j] = {cross(arm, force), force};
  }
}

void TendonPath::wrenches(const Shape& shape, double decay, Wrenches& out,
                          Wrenches& by_decay) const {
  const int last = shape.elements;
  out[0] = by_decay[0] = {{0, 0, 0}, {0, 0, 0}};
  double angle = 0, weight = 1;
  for (int j = 1; j <= last; ++j) {
    const double angle_in = angle, weight_in = weight;
    Vec3 leaving = {0, 0, 0};
    Vec3 arm = top_;
    if (j < last) {
      leaving = direction_[j];
      arm = {crossing_[j].u, crossing_[j].v, 0};
      angle += norm(direction_[j] - direction_[j - 1]);
      weight = std::exp(-decay * angle);
    }
    const Vec3& coming = direction_[j - 1];
    const Vec3 force = into(shape.rotation[j], weight_in * coming - weight * leaving);
    const Vec3 change =
        into(shape.rotation[j], (weight * angle) * leaving - (weight_in * angle_in) * coming);
    out[j] = {cross(arm, force), force};
    by_decay[j] = {cross(arm, change), change};
  }
}

}  // namespace sim
}  // namespace setae
