// The plant's energy and its slope: spring, tendons, weight, touching coils, friction.
#include <algorithm>
#include <cmath>

#include "plant.h"

namespace setae {
namespace sim {
namespace {

constexpr double kSlack_mm = 0.5;  // tendons looser than this need no exact path
constexpr double kRounding_per_mm = 0.003;

}  // namespace

// Energy and gradient at `modes`. state.paths should hold nearby paths already.
void Plant::evaluate(const Modes& modes, State& state) {
  ++evaluations_;
  state.modes = modes;
  rod_.shape(modes, state.shape);
  for (int i = 0; i < settings_.tendons; ++i)
    find_path(i, state);
  add_weight(state);
  load(state);
}

// The shortest path, and the slope of its length; where it is slack by far, only a bound.
void Plant::find_path(int i, State& state) const {
  const double slack_mm = lengths_mm_[i] - kSlack_mm;
  TendonPath& path = state.paths[i];
  path.solve(state.shape, settings_.base_hole_mm[i], settings_.top_hole_mm[i],
             settings_.bore_radius_mm, slack_mm);
  state.path_known[i] = path.length_mm() >= slack_mm;
  if (!state.path_known[i])
    return;
  state.path_gradient[i] = Modes{};
  rod_.pull_back(state.shape, path.wrenches(), state.path_gradient[i]);
}

// The same shape under other lengths: a path that was slack by far may be missing, and one
// that did not settle goes on.
void Plant::reload(State& state) {
  for (int i = 0; i < settings_.tendons; ++i) {
    const bool slack = state.paths[i].length_mm() < lengths_mm_[i] - kSlack_mm;
    if (!state.paths[i].converged() || (!state.path_known[i] && !slack))
      find_path(i, state);
  }
  load(state);
}

// Energy and gradient of a known shape and its paths.
void Plant::load(State& state) const {
  state.energy = 0.5 * inner(state.modes, state.modes) + inner(friction_load_, state.modes) +
                 state.weight_energy;
  state.gradient = state.modes;
  for (int m = 0; m < rod_.modes(); ++m) {
    const double away = state.modes[m] - anchor_[m];
    state.energy += 0.5 * damping_ * away * away;
    state.gradient[m] += damping_ * away + friction_load_[m];
  }
  state.geometric = state.weight_gradient;
  for (int i = 0; i < settings_.tendons; ++i) {
    const double stretch_mm = state.paths[i].length_mm() - lengths_mm_[i];
    state.stretch_mm[i] = stretch_mm;
    state.tension_n[i] = stretch_mm > 0 ? settings_.tendon_stiffness_n_per_mm * stretch_mm : 0;
    if (stretch_mm <= 0)
      continue;
    state.energy += 0.5 * state.tension_n[i] * stretch_mm;
    for (int m = 0; m < rod_.modes(); ++m)
      state.geometric[m] += state.tension_n[i] * state.path_gradient[i][m];
  }
  for (int m = 0; m < rod_.modes(); ++m)
    state.gradient[m] += state.geometric[m];
  add_solid(state);
}

// Dead loads: spring, tip, and what hangs on it.
void Plant::add_weight(State& state) const {
  const int top = rod_.elements();
  Wrenches wrenches;
  state.weight_energy = 0;
  state.weight_gradient = Modes{};
  for (int j = 0; j <= top; ++j) {
    const bool end = j == 0 || j == top;
    double mass_g = settings_.spring_mass_g / top * (end ? 0.5 : 1.0);
    if (j == top)
      mass_g += settings_.tip_mass_g;
    const Vec3 weight_n = (1e-3 * mass_g) * settings_.gravity_m_s2;
    state.weight_energy -= dot(weight_n, state.shape.position[j]);
    wrenches[j] = {{0, 0, 0}, into(state.shape.rotation[j], -weight_n)};
  }
  const Mat3& axes = state.shape.rotation[top];
  const Vec3 at = state.shape.position[top] + settings_.load_offset_mm * axes.ez;
  const Vec3 load_n = into(axes, -settings_.load_n);
  state.weight_energy -= dot(settings_.load_n, at);
  wrenches[top].force = wrenches[top].force + load_n;
  wrenches[top].moment = wrenches[top].moment + cross({0, 0, settings_.load_offset_mm}, load_n);
  rod_.pull_back(state.shape, wrenches, state.weight_gradient);
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

void Plant::add_solid_hessian(Matrix& hessian) const {
  const double stiffness = solid_penalty_ * rod_.element_mm();
  SolidContact contact;
  for (int e = 0; e < rod_.elements(); ++e) {
    if (!solid_contact(state().shape.strain[e], contact))
      continue;
    Modes slope{}, by_x{}, by_y{};
    rod_.pull_back_strain(e, contact.slope, slope);
    rod_.pull_back_strain(e, {{1, 0, 0}, {0, 0, 0}}, by_x);
    rod_.pull_back_strain(e, {{0, 1, 0}, {0, 0, 0}}, by_y);
    const double round =
        -stiffness * contact.gap * 0.5 * settings_.outer_diameter_mm / contact.bend_per_mm;
    for (int m = 0; m < rod_.modes(); ++m) {
      const double along_m = contact.x * by_x[m] + contact.y * by_y[m];
      for (int k = 0; k <= m; ++k) {
        const double along_k = contact.x * by_x[k] + contact.y * by_y[k];
        hessian[m][k] += stiffness * slope[m] * slope[k] +
                         round * (by_x[m] * by_x[k] + by_y[m] * by_y[k] - along_m * along_k);
      }
    }
  }
}

// Friction follows the state: what each tendon has slid since the step's start, what
// that takes from its tension along the bore, and how both change with the state.
void Plant::settle_friction(State& state) {
  if (!may_slide_)
    return;
  Modes load{};
  for (int i = 0; i < settings_.tendons; ++i) {
    const double slid_mm = path_from_mm_[i] - state.paths[i].length_mm();
    const double pushed = slide_from_[i] + slid_mm / settings_.presliding_mm;
    slide_[i] = std::min(std::max(pushed, -1.0), 1.0);
    const double tension_n = state.tension_n[i];
    const bool pulls = tension_n > 0 || (was_taut_[i] && state.path_known[i]);
    rubs_[i] = pulls && state.paths[i].touches_bore();
    if (!rubs_[i]) {
      friction_loss_[i] = friction_column_[i] = {};
      continue;
    }
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
      friction_loss_[i][m] = lost;
      friction_column_[i][m] = settings_.tendon_stiffness_n_per_mm * lost - by_path * by_slide[m];
    }
  }
  state.energy += inner(load, state.modes) - inner(friction_load_, state.modes);
  for (int m = 0; m < rod_.modes(); ++m)
    state.gradient[m] += load[m] - friction_load_[m];
  friction_load_ = load;
}

}  // namespace sim
}  // namespace setae
