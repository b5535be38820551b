#include "plant.h"

#include <algorithm>

namespace setae {
namespace sim {
namespace {

constexpr int kIterations = 40;
constexpr int kPatience = 10;         // iterations before the secant is built afresh
constexpr double kLongestStep = 4;    // root of N mm; half the spring's whole compression
constexpr double kSecantStep = 1e-4;  // root of N mm
constexpr double kCreep = 1e-4;       // root of N mm a step
constexpr double kSlack_mm = 0.5;     // tendons looser than this need no exact path
constexpr double kLargestShift = 1e6;
constexpr double kNudge = 1e-3;        // root of N mm; moves the tip by 0.02 mm or so
constexpr double kSolidPenalty = 100;  // times the spring's axial stiffness
constexpr double kRounding_per_mm = 0.003;

Rigidity rigidity_of(const PlantSettings& s) {
  // Helical spring, homogenised; constant per reference length.
  const double axial = s.axial_rate_n_per_mm * s.free_length_mm;
  const double d2 = s.mean_diameter_mm * s.mean_diameter_mm;
  const double nu = s.poisson_ratio;
  const double bending = axial * d2 * (1 + nu) / (2 * (2 + nu));
  return {s.bending_scale_x * bending,
          s.bending_scale_y * bending,
          axial * d2 * (1 + nu) / 4,
          s.shear_scale * 2 * (1 + nu) * axial,
          axial,
          s.bending_axis_rad,
          s.stiffness_gradient};
}

// One rank taken from what a system's solution was without it.
void deflate(const Modes& column, const Modes& row, Modes& solution) {
  const double along = inner(row, solution);
  for (int m = 0; m < kMaxModes; ++m)
    solution[m] -= along * column[m];
}

}  // namespace

constexpr double Plant::kTolerance;

Plant::Plant(const PlantSettings& settings)
    : settings_(settings),
      rod_(rigidity_of(settings), settings.free_length_mm, settings.rod_elements,
           settings.rod_extra_modes),
      solid_penalty_(kSolidPenalty * settings.axial_rate_n_per_mm * settings.free_length_mm),
      solid_ratio_(settings.solid_length_mm / settings.free_length_mm) {}

void Plant::settle(const std::array<double, kTendons>& lengths_mm) {
  lengths_mm_ = lengths_mm;
  double shortest = settings_.free_length_mm;
  for (double length : lengths_mm)
    shortest = std::min(shortest, length);
  anchor_ = rod_.compressed(shortest);
  damping_ = 0;
  secant_known_ = false;
  may_slide_ = false;
  slide_ = {};
  friction_load_ = {};
  friction_column_ = {};
  evaluate(anchor_, state_);
  solve();
  creeping_ = false;
}

void Plant::step(const std::array<double, kTendons>& lengths_mm, double duration_s) {
  lengths_mm_ = lengths_mm;
  anchor_ = state_.modes;
  damping_ = settings_.damping_time_s / duration_s;
  may_slide_ = settings_.friction > 0;
  slide_from_ = slide_;
  for (int i = 0; i < kTendons; ++i)
    path_from_mm_[i] = state_.paths[i].length_mm();
  evaluate(anchor_, state_);
  solve();
  double moved = 0;
  for (int m = 0; m < rod_.modes(); ++m) {
    moved = std::max(moved, std::fabs(state_.modes[m] - anchor_[m]));
  }
  creeping_ = moved > kCreep || leave_saddle();
}

// Rest at a point from which the energy falls is no rest: whoever is exactly in the
// middle between two ways would stay there for ever. Pushes it off, always to the same
// side; the next steps take it on. False where the rest is one.
bool Plant::leave_saddle() {
  const double damping = damping_;
  damping_ = 0;
  Cholesky solver;
  bool stable = solver.factor(hessian(state_), rod_.modes(), 0);
  if (!stable) {  // or the secant is not up to date
    rebuild_secant();
    stable = solver.factor(hessian(state_), rod_.modes(), 0);
  }
  if (!stable) {
    for (double shift = 0.25; !solver.factor(hessian(state_), rod_.modes(), shift); shift *= 2) {
      if (!(shift < kLargestShift))
        break;
    }
    Modes way;
    way.fill(1);  // inverse iteration: towards the lowest curvature
    for (int k = 0; k < 8; ++k) {
      way = solver.solve(way);
      const double size = length(way);
      for (double& part : way)
        part /= size;
    }
    Modes modes = state_.modes;
    for (int m = 0; m < rod_.modes(); ++m)
      modes[m] += kNudge * way[m];
    evaluate(modes, state_);
  }
  damping_ = damping;
  return !stable;
}

// Energy and gradient at `modes`. state.paths should hold nearby paths already.
void Plant::evaluate(const Modes& modes, State& state) {
  ++evaluations_;
  state.modes = modes;
  rod_.shape(modes, state.shape);
  state.energy = 0.5 * inner(modes, modes) + inner(friction_load_, modes);
  state.gradient = modes;
  for (int m = 0; m < rod_.modes(); ++m) {
    const double away = modes[m] - anchor_[m];
    state.energy += 0.5 * damping_ * away * away;
    state.gradient[m] += damping_ * away + friction_load_[m];
  }
  state.geometric = Modes{};
  for (int i = 0; i < kTendons; ++i) {
    state.paths[i].solve(state.shape, settings_.base_hole_mm[i], settings_.top_hole_mm[i],
                         settings_.bore_radius_mm, lengths_mm_[i] - kSlack_mm);
    const double stretch = state.paths[i].length_mm() - lengths_mm_[i];
    state.tension_n[i] = stretch > 0 ? settings_.tendon_stiffness_n_per_mm * stretch : 0;
    if (stretch <= 0)
      continue;
    state.energy += 0.5 * state.tension_n[i] * stretch;
    state.path_gradient[i] = Modes{};
    rod_.pull_back(state.shape, state.paths[i].wrenches(), state.path_gradient[i]);
    for (int m = 0; m < rod_.modes(); ++m) {
      state.geometric[m] += state.tension_n[i] * state.path_gradient[i][m];
    }
  }
  add_weight(state);
  for (int m = 0; m < rod_.modes(); ++m)
    state.gradient[m] += state.geometric[m];
  add_solid(state);
}

// Dead loads: spring, tip, and what hangs on it.
void Plant::add_weight(State& state) const {
  const int top = rod_.elements();
  Wrenches wrenches;
  for (int j = 0; j <= top; ++j) {
    const bool end = j == 0 || j == top;
    double mass_g = settings_.spring_mass_g / top * (end ? 0.5 : 1.0);
    if (j == top)
      mass_g += settings_.tip_mass_g;
    const Vec3 weight_n = (1e-3 * mass_g) * settings_.gravity_m_s2;
    state.energy -= dot(weight_n, state.shape.position[j]);
    wrenches[j] = {{0, 0, 0}, into(state.shape.rotation[j], -weight_n)};
  }
  const Mat3& axes = state.shape.rotation[top];
  const Vec3 at = state.shape.position[top] + settings_.load_offset_mm * axes.ez;
  const Vec3 load_n = into(axes, -settings_.load_n);
  state.energy -= dot(settings_.load_n, at);
  wrenches[top].force = wrenches[top].force + load_n;
  wrenches[top].moment = wrenches[top].moment + cross({0, 0, settings_.load_offset_mm}, load_n);
  rod_.pull_back(state.shape, wrenches, state.geometric);
}

// Coils that touch at the bend's inner side: a stiff one-sided spring. The edge
// at zero curvature is rounded, otherwise a straight crushed spring sits on a kink.
bool Plant::solid_contact(const Strain& strain, SolidContact& contact) const {
  const double radius = 0.5 * settings_.outer_diameter_mm;
  const double x = strain.curvature.x, y = strain.curvature.y;
  contact.bend_per_mm = std::sqrt(x * x + y * y + kRounding_per_mm * kRounding_per_mm);
  contact.gap = strain.stretch.z - radius * (contact.bend_per_mm - kRounding_per_mm) - solid_ratio_;
  contact.x = x / contact.bend_per_mm;
  contact.y = y / contact.bend_per_mm;
  contact.slope = {{-radius * contact.x, -radius * contact.y, 0}, {0, 0, 1}};
  return contact.gap < 0;
}

void Plant::add_solid(State& state) const {
  const double stiffness = solid_penalty_ * rod_.element_mm();
  SolidContact contact;
  for (int e = 0; e < rod_.elements(); ++e) {
    if (!solid_contact(state.shape.strain[e], contact))
      continue;
    state.energy += 0.5 * stiffness * contact.gap * contact.gap;
    const double force = stiffness * contact.gap;
    rod_.pull_back_strain(e, {force * contact.slope.curvature, force * contact.slope.stretch},
                          state.gradient);
  }
}

void Plant::add_solid_hessian(const State& state, Matrix& hessian) const {
  const double stiffness = solid_penalty_ * rod_.element_mm();
  SolidContact contact;
  for (int e = 0; e < rod_.elements(); ++e) {
    if (!solid_contact(state.shape.strain[e], contact))
      continue;
    Modes slope{}, by_x{}, by_y{};
    rod_.pull_back_strain(e, contact.slope, slope);
    rod_.pull_back_strain(e, {{1, 0, 0}, {0, 0, 0}}, by_x);
    rod_.pull_back_strain(e, {{0, 1, 0}, {0, 0, 0}}, by_y);
    const double round =
        -stiffness * contact.gap * 0.5 * settings_.outer_diameter_mm / contact.bend_per_mm;
    for (int m = 0; m < rod_.modes(); ++m) {
      const double along_m = contact.x * by_x[m] + contact.y * by_y[m];
      for (int k = 0; k < rod_.modes(); ++k) {
        const double along_k = contact.x * by_x[k] + contact.y * by_y[k];
        hessian[m][k] += stiffness * slope[m] * slope[k] +
                         round * (by_x[m] * by_x[k] + by_y[m] * by_y[k] - along_m * along_k);
      }
    }
  }
}

// Newton with a line search. The stiff parts of the Hessian are exact; the
// geometric part is a secant, kept from step to step.
void Plant::solve() {
  int since_rebuild = 0;
  bool fresh = false;
  if (!secant_known_) {
    rebuild_secant();
    fresh = true;
  }
  settle_friction(state_);
  for (iterations_ = 0; iterations_ < kIterations; ++iterations_) {
    residual_ = length(state_.gradient);
    if (residual_ < kTolerance)
      return;
    if (since_rebuild >= kPatience) {
      rebuild_secant();
      fresh = true;
      since_rebuild = 0;
    }
    Modes step;
    const bool descends = newton_step(step);
    const double slope = inner(state_.gradient, step);
    double fraction = std::min(1.0, kLongestStep / length(step));
    bool accepted = false;
    for (int halving = 0; descends && halving < 25; ++halving) {
      Modes modes = state_.modes;
      for (int m = 0; m < rod_.modes(); ++m)
        modes[m] += fraction * step[m];
      trial_.paths = state_.paths;
      evaluate(modes, trial_);
      if (trial_.energy <= state_.energy + 1e-4 * fraction * slope + 1e-11) {
        accepted = true;
        break;
      }
      fraction *= 0.5;
    }
    if (accepted) {
      update_secant(state_, trial_);
      std::swap(state_, trial_);
      settle_friction(state_);
      ++since_rebuild;
      fresh = false;
    } else {
      if (fresh)
        break;
      rebuild_secant();
      fresh = true;
      since_rebuild = 0;
    }
  }
  residual_ = length(state_.gradient);
}

// Friction follows the state: what each tendon has slid since the step's start, what
// that takes from its tension along the bore, and how both change with the state.
void Plant::settle_friction(State& state) {
  if (!may_slide_)
    return;
  Modes load{};
  for (int i = 0; i < kTendons; ++i) {
    const double slid_mm = path_from_mm_[i] - state.paths[i].length_mm();
    const double pushed = slide_from_[i] + slid_mm / settings_.presliding_mm;
    slide_[i] = std::min(std::max(pushed, -1.0), 1.0);
    friction_column_[i] = {};
    const double tension_n = state.tension_n[i];
    if (tension_n <= 0 || !state.paths[i].touches_bore())
      continue;
    Wrenches wrenches, by_decay;
    state.paths[i].wrenches(state.shape, settings_.friction * slide_[i], wrenches, by_decay);
    Modes pull{}, by_slide{};
    rod_.pull_back(state.shape, wrenches, pull);
    const bool sticks = slide_[i] == pushed;
    if (sticks)
      rod_.pull_back(state.shape, by_decay, by_slide);
    const double by_path = tension_n * settings_.friction / settings_.presliding_mm;
    for (int m = 0; m < rod_.modes(); ++m) {
      const double lost = pull[m] - state.path_gradient[i][m];
      load[m] += tension_n * lost;
      friction_column_[i][m] = settings_.tendon_stiffness_n_per_mm * lost - by_path * by_slide[m];
    }
  }
  state.energy += inner(load, state.modes) - inner(friction_load_, state.modes);
  for (int m = 0; m < rod_.modes(); ++m)
    state.gradient[m] += load[m] - friction_load_[m];
  friction_load_ = load;
}

Matrix Plant::hessian(const State& state) const {
  Matrix hessian = secant_;
  for (int m = 0; m < rod_.modes(); ++m)
    hessian[m][m] += 1 + damping_;
  for (int i = 0; i < kTendons; ++i) {
    if (state.tension_n[i] <= 0)
      continue;
    for (int m = 0; m < rod_.modes(); ++m) {
      const double weight = settings_.tendon_stiffness_n_per_mm * state.path_gradient[i][m];
      for (int k = 0; k <= m; ++k)
        hessian[m][k] += weight * state.path_gradient[i][k];
    }
  }
  add_solid_hessian(state, hessian);
  return hessian;
}

// Step from the modified Newton system; false if it can't be made to descend.
bool Plant::newton_step(Modes& step) const {
  const Matrix matrix = hessian(state_);
  Cholesky solver;
  double shift = 0;
  for (int attempt = 0; !solver.factor(matrix, rod_.modes(), shift); ++attempt) {
    if (attempt == 12)
      return false;
    shift = shift == 0 ? 0.25 : 2 * shift;
  }
  Modes downhill{};
  for (int m = 0; m < rod_.modes(); ++m)
    downhill[m] = -state_.gradient[m];
  step = solver.solve(downhill);
  const Modes plain = step;
  // Friction's part is not symmetric: one rank for each tendon, by Sherman and Morrison.
  std::array<Modes, kTendons> solved;
  for (int i = 0; i < kTendons; ++i) {
    if (state_.tension_n[i] <= 0 || inner(friction_column_[i], friction_column_[i]) == 0) {
      solved[i] = {};
      continue;
    }
    solved[i] = solver.solve(friction_column_[i]);
    for (int j = 0; j < i; ++j)
      deflate(solved[j], state_.path_gradient[j], solved[i]);
    const double scale = 1 + inner(state_.path_gradient[i], solved[i]);
    if (scale < 0.1) {  // no longer a small change of what is symmetric
      solved[i] = {};
      continue;
    }
    for (int m = 0; m < rod_.modes(); ++m)
      solved[i][m] /= scale;
    deflate(solved[i], state_.path_gradient[i], step);
  }
  if (inner(step, state_.gradient) >= 0)
    step = plain;
  return inner(step, state_.gradient) < 0;
}

// The gradient of tendons and weight with the tensions held at other values.
Modes Plant::frozen_gradient(const State& state,
                             const std::array<double, kTendons>& tension_n) const {
  Modes out = state.geometric;
  for (int i = 0; i < kTendons; ++i) {
    const double extra = tension_n[i] - state.tension_n[i];
    if (extra == 0)
      continue;
    Modes gradient{};
    if (state.tension_n[i] > 0) {
      gradient = state.path_gradient[i];
    } else {
      rod_.pull_back(state.shape, state.paths[i].wrenches(), gradient);
    }
    for (int m = 0; m < rod_.modes(); ++m)
      out[m] += extra * gradient[m];
  }
  return out;
}

void Plant::rebuild_secant() {
  const std::array<double, kTendons> tension_n = state_.tension_n;
  for (int k = 0; k < rod_.modes(); ++k) {
    Modes modes = state_.modes;
    modes[k] += kSecantStep;
    trial_.paths = state_.paths;
    evaluate(modes, trial_);
    const Modes moved = frozen_gradient(trial_, tension_n);
    for (int m = 0; m < rod_.modes(); ++m) {
      secant_[m][k] = (moved[m] - state_.geometric[m]) / kSecantStep;
    }
  }
  for (int m = 0; m < rod_.modes(); ++m) {
    for (int k = 0; k < m; ++k) {
      secant_[m][k] = secant_[k][m] = 0.5 * (secant_[m][k] + secant_[k][m]);
    }
  }
  secant_known_ = true;
}

// Symmetric rank one: needs no positive curvature, which this part does not have.
void Plant::update_secant(const State& from, const State& to) {
  const Modes before = frozen_gradient(from, to.tension_n);
  Modes step{}, rest{};
  for (int m = 0; m < rod_.modes(); ++m)
    step[m] = to.modes[m] - from.modes[m];
  for (int m = 0; m < rod_.modes(); ++m) {
    rest[m] = to.geometric[m] - before[m] - inner(secant_[m], step);
  }
  const double along = inner(rest, step);
  if (std::fabs(along) < 1e-3 * length(rest) * length(step))
    return;
  for (int m = 0; m < rod_.modes(); ++m) {
    for (int k = 0; k < rod_.modes(); ++k)
      secant_[m][k] += rest[m] * rest[k] / along;
  }
}

}  // namespace sim
}  // namespace setae
