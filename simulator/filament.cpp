#include "filament.h"

#include <algorithm>
#include <cmath>

#include "dense.h"

namespace setae {
namespace sim {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kAdvanceMm = 0.4;  // thinner than any wall that it may pass
constexpr int kAdvancesMost = 16;
constexpr int kIterations = 12;
constexpr int kHalvings = 4;
constexpr int kShifts = 30;
constexpr double kLargestTurn = 0.3;
constexpr double kSmallestTurn = 1e-5;
constexpr double kStraight = 1e-4;
constexpr double kProbeMm = 1e-3;  // for a surface's direction
// How much stiffer than the gel solids are, across and along their surface.
constexpr double kSolid = 100;
constexpr double kStick = 0.5;

}  // namespace

// Energy's slope and curvature.
struct Filament::System {
  Modes gradient{};
  Matrix hessian{};  // lower half
};

Filament::Filament(const FilamentSettings& settings)
    : settings_(settings), link_mm_(settings.length_mm / kLinks) {
  const double bending_n_mm2 =
      settings.modulus_n_per_mm2 * kPi / 64 * std::pow(settings.diameter_mm, 4);
  joint_n_mm_ = bending_n_mm2 / link_mm_;
  // Half a link bends between its middle and the gel.
  root_joint_n_mm_ = 1 / (1 / settings.gel_rotation_n_mm_per_rad + 0.5 / joint_n_mm_);
  gel_n_mm_ = settings.gel_stiffness_n_per_mm * link_mm_ * link_mm_;
  contact_n_per_mm_ = kSolid * settings.gel_stiffness_n_per_mm;
  for (int i = 0; i < kLinks; ++i) {
    const double slope = settings.bow_mm / link_mm_ *
                         (std::sin(kPi * (i + 1) / kLinks) - std::sin(kPi * i / kLinks));
    rest_[2 * i] = slope * std::cos(settings.bow_rad);
    rest_[2 * i + 1] = slope * std::sin(settings.bow_rad);
  }
}

void Filament::place(const Vec3& root_mm, const Mat3& axes) {
  root_mm_ = root_mm;
  axes_ = axes;
  tip_mm_ = root_mm + settings_.length_mm * axes.ez;
  state_.unknowns = rest_;
  anchors_ = {};
  bent_ = false;
}

void Filament::step(double duration_s, const Vec3& root_mm, const Mat3& axes,
                    const Environment& environment) {
  if (!bent_ && clear(root_mm, axes, environment)) {
    place(root_mm, axes);
    return;
  }
  const Vec3 from_mm = root_mm_;
  const Mat3 from = axes_;
  const double travel_mm = std::max(
      norm(root_mm - from_mm), norm(root_mm - from_mm + settings_.length_mm * (axes.ez - from.ez)));
  const int advances =
      std::min(std::max(1, static_cast<int>(std::ceil(travel_mm / kAdvanceMm))), kAdvancesMost);
  for (int i = 1; i <= advances; ++i) {
    const double u = static_cast<double>(i) / advances;
    root_mm_ = from_mm + u * (root_mm - from_mm);
    axes_ = {from.ex + u * (axes.ex - from.ex), from.ey + u * (axes.ey - from.ey),
             from.ez + u * (axes.ez - from.ez)};
    solve(duration_s / advances, environment);
  }
  bool touches = false;
  for (const Anchor& anchor : anchors_)
    touches |= anchor.holds;
  double off = 0;
  for (int m = 0; m < kUnknowns; ++m)
    off = std::max(off, std::fabs(state_.unknowns[m] - rest_[m]));
  bent_ = touches || off > kStraight;
  if (bent_) {
    tip_mm_ = point(state_, kLinks - 1, link_mm_);
  } else {
    place(root_mm, axes);
  }
}

double Filament::push_n() const {
  return settings_.gel_stiffness_n_per_mm * link_mm_ * state_.unknowns[2 * kLinks];
}

double Filament::moment_n_mm() const {
  return root_joint_n_mm_ *
         std::hypot(state_.unknowns[0] - rest_[0], state_.unknowns[1] - rest_[1]);
}

// Whether nothing is near while it is straight.
bool Filament::clear(const Vec3& root_mm, const Mat3& axes, const Environment& environment) const {
  const double margin_mm = 0.5 * settings_.diameter_mm + settings_.bow_mm + 0.1;
  for (int k = 0; k < kPoints; ++k) {
    const double along_mm = settings_.length_mm * (k + 1) / kPoints;
    if (environment.depth_mm(root_mm + along_mm * axes.ez) > -margin_mm)
      return false;
  }
  return true;
}

// Of a point on its link. The last stays a radius before the round end.
double Filament::along_mm(int point) const {
  const double along = link_mm_ * (point % kPointsEach + 1) / kPointsEach;
  return point == kPoints - 1 ? along - 0.5 * settings_.diameter_mm : along;
}

Vec3 Filament::point(const State& state, int link, double along_mm) const {
  Vec3 at = root_mm_ - (link_mm_ * state.unknowns[2 * kLinks]) * axes_.ez;
  for (int j = 0; j < link; ++j)
    at = at + link_mm_ * state.links[j].along;
  return at + along_mm * state.links[link].along;
}

void Filament::measure(const Unknowns& unknowns, const Environment& environment,
                       State& state) const {
  state.unknowns = unknowns;
  for (int j = 0; j < kLinks; ++j) {
    const double u = unknowns[2 * j], v = unknowns[2 * j + 1];
    const double turn2 = u * u + v * v, turn = std::sqrt(turn2), cosine = std::cos(turn);
    const double sinc = turn < 1e-4 ? 1 - turn2 / 6 : std::sin(turn) / turn;
    const double rate = turn < 1e-3 ? -1.0 / 3 : (cosine - sinc) / turn2;
    const Vec3 across = u * axes_.ex + v * axes_.ey;
    Link& link = state.links[j];
    link.along = sinc * across + cosine * axes_.ez;
    link.by[0] = sinc * axes_.ex + (rate * u) * across - (sinc * u) * axes_.ez;
    link.by[1] = sinc * axes_.ey + (rate * v) * across - (sinc * v) * axes_.ez;
  }
  const double radius_mm = 0.5 * settings_.diameter_mm;
  for (int k = 0; k < kPoints; ++k) {
    Point& p = state.points[k];
    p.at = point(state, k / kPointsEach, along_mm(k));
    const double depth_mm = environment.depth_mm(p.at);
    p.overlap_mm = depth_mm + radius_mm;
    if (p.overlap_mm <= 0)
      continue;
    const Vec3 slope = {environment.depth_mm(p.at + Vec3{kProbeMm, 0, 0}) - depth_mm,
                        environment.depth_mm(p.at + Vec3{0, kProbeMm, 0}) - depth_mm,
                        environment.depth_mm(p.at + Vec3{0, 0, kProbeMm}) - depth_mm};
    const double steepness = norm(slope);
    p.inwards = steepness > 0 ? (1 / steepness) * slope : axes_.ez;
    const Vec3 away = anchors_[k].holds ? p.at - anchors_[k].at : Vec3{0, 0, 0};
    p.slid_mm = away - dot(away, p.inwards) * p.inwards;
  }
}

double Filament::spring_energy(const Unknowns& from, const Unknowns& to) const {
  double sum =
      gel_n_mm_ * (to[2 * kLinks] - from[2 * kLinks]) * (to[2 * kLinks] - from[2 * kLinks]);
  for (int m = 0; m < 2 * kLinks; ++m) {
    double turn = to[m] - from[m];
    if (m >= 2)
      turn -= to[m - 2] - from[m - 2];
    sum += (m < 2 ? root_joint_n_mm_ : joint_n_mm_) * turn * turn;
  }
  return 0.5 * sum;
}

void Filament::add_springs(const Unknowns& from, const Unknowns& to, double scale,
                           System& system) const {
  const int gel = 2 * kLinks;
  system.gradient[gel] += scale * gel_n_mm_ * (to[gel] - from[gel]);
  system.hessian[gel][gel] += scale * gel_n_mm_;
  for (int m = 0; m < gel; ++m) {
    const double stiffness = scale * (m < 2 ? root_joint_n_mm_ : joint_n_mm_);
    double turn = to[m] - from[m];
    if (m >= 2) {
      turn -= to[m - 2] - from[m - 2];
      system.gradient[m - 2] -= stiffness * turn;
      system.hessian[m - 2][m - 2] += stiffness;
      system.hessian[m][m - 2] -= stiffness;
    }
    system.gradient[m] += stiffness * turn;
    system.hessian[m][m] += stiffness;
  }
}

double Filament::energy(const State& state) const {
  double sum =
      spring_energy(rest_, state.unknowns) + damping_ * spring_energy(start_, state.unknowns);
  const double stick = kStick * contact_n_per_mm_;
  for (int k = 0; k < kPoints; ++k) {
    const Point& p = state.points[k];
    if (p.overlap_mm <= 0)
      continue;
    sum += 0.5 * contact_n_per_mm_ * p.overlap_mm * p.overlap_mm;
    const double slid_mm = norm(p.slid_mm), most_mm = anchors_[k].grip_n / stick;
    sum += slid_mm <= most_mm ? 0.5 * stick * slid_mm * slid_mm
                              : anchors_[k].grip_n * (slid_mm - 0.5 * most_mm);
  }
  return sum;
}

void Filament::assemble(const State& state, System& system) const {
  add_springs(rest_, state.unknowns, 1, system);
  add_springs(start_, state.unknowns, damping_, system);
  for (int k = 0; k < kPoints; ++k) {
    if (state.points[k].overlap_mm > 0)
      add_contact(state, k, system);
  }
}

void Filament::add_contact(const State& state, int index, System& system) const {
  const Point& p = state.points[index];
  const double stick = kStick * contact_n_per_mm_, grip_n = anchors_[index].grip_n;
  const double slid_mm = norm(p.slid_mm);
  const bool sticks = stick * slid_mm <= grip_n;
  const double hold = sticks ? stick : grip_n / slid_mm;
  const Vec3 force = contact_n_per_mm_ * p.overlap_mm * p.inwards + hold * p.slid_mm;
  const Vec3 way = sticks ? Vec3{0, 0, 0} : (1 / slid_mm) * p.slid_mm;

  // How the point moves with each unknown that moves it, and the force with the point.
  std::array<Vec3, kUnknowns> moves{}, stiff{};
  const int link = index / kPointsEach;
  for (int j = 0; j <= link; ++j) {
    const double reach_mm = j < link ? link_mm_ : along_mm(index);
    for (int axis = 0; axis < 2; ++axis)
      moves[2 * j + axis] = reach_mm * state.links[j].by[axis];
    // What buckles: a pushed link turns away.
    const double push = reach_mm * dot(force, state.links[j].along);
    system.hessian[2 * j][2 * j] -= push;
    system.hessian[2 * j + 1][2 * j + 1] -= push;
  }
  moves[2 * kLinks] = -link_mm_ * axes_.ez;
  for (int m = 0; m < kUnknowns; ++m) {
    const Vec3& move = moves[m];
    stiff[m] = hold * move + ((contact_n_per_mm_ - hold) * dot(move, p.inwards)) * p.inwards -
               (hold * dot(move, way)) * way;
    system.gradient[m] += dot(force, move);
    for (int n = 0; n <= m; ++n)
      system.hessian[m][n] += dot(stiff[m], moves[n]);
  }
}

// Newton's method; friction's limit follows from iteration to iteration.
void Filament::solve(double duration_s, const Environment& environment) {
  damping_ = settings_.settling_s / duration_s;
  start_ = state_.unknowns;
  measure(start_, environment, state_);
  grip();
  State trial;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    System system;
    assemble(state_, system);
    Cholesky solver;
    double shift = 0;
    for (int attempt = 0; !solver.factor(system.hessian, kUnknowns, shift); ++attempt) {
      if (attempt == kShifts)
        return;  // the next step tries again from here
      shift = shift == 0 ? 0.25 * joint_n_mm_ : 2 * shift;
    }
    const Modes way = solver.solve(system.gradient);
    double largest = 0;
    for (int m = 0; m < kUnknowns; ++m)
      largest = std::max(largest, std::fabs(way[m]));
    double fraction = largest > kLargestTurn ? kLargestTurn / largest : 1;
    const double energy_now = energy(state_);
    for (int halving = 0; halving <= kHalvings; ++halving) {
      Unknowns unknowns = state_.unknowns;
      for (int m = 0; m < kUnknowns; ++m)
        unknowns[m] -= fraction * way[m];
      measure(unknowns, environment, trial);
      if (energy(trial) <= energy_now)
        break;
      fraction *= 0.5;
    }
    state_ = trial;
    grip();
    if (fraction * largest < kSmallestTurn)
      break;
  }
  slide();
}

// What friction can hold now; a point that has just come to touch is held where it is.
void Filament::grip() {
  for (int k = 0; k < kPoints; ++k) {
    const Point& p = state_.points[k];
    Anchor& anchor = anchors_[k];
    if (p.overlap_mm > 0 && !anchor.holds) {
      anchor.at = p.at;
      state_.points[k].slid_mm = {0, 0, 0};
    }
    anchor.holds = p.overlap_mm > 0;
    anchor.grip_n = settings_.friction * contact_n_per_mm_ * std::max(p.overlap_mm, 0.0);
  }
}

// Anchors come after what slides.
void Filament::slide() {
  const double stick = kStick * contact_n_per_mm_;
  for (int k = 0; k < kPoints; ++k) {
    Anchor& anchor = anchors_[k];
    if (!anchor.holds)
      continue;
    const Point& p = state_.points[k];
    const double slid_mm = norm(p.slid_mm), most_mm = anchor.grip_n / stick;
    const double kept = slid_mm > most_mm ? most_mm / slid_mm : 1;
    anchor.at = p.at - kept * p.slid_mm;
  }
}

}  // namespace sim
}  // namespace setae
