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
constexpr double kLargestShift = 1e6;
constexpr int kGuesses = 4;            // of which tendons are taut
constexpr double kNudge = 1e-3;        // root of N mm; moves the tip by 0.02 mm or so
constexpr double kSolidPenalty = 100;  // times the spring's axial stiffness

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
constexpr double Plant::kNone;

Plant::Plant(const PlantSettings& settings)
    : settings_(settings),
      rod_(rigidity_of(settings), settings.free_length_mm, settings.rod_elements,
           settings.rod_extra_modes),
      solid_penalty_(kSolidPenalty * settings.axial_rate_n_per_mm * settings.free_length_mm),
      solid_ratio_(settings.solid_length_mm / settings.free_length_mm) {}

void Plant::place(const PerTendon& lengths_mm, const Aside& aside) {
  lengths_mm_ = lengths_mm;
  double shortest = settings_.free_length_mm;
  for (int i = 0; i < settings_.tendons; ++i)
    shortest = std::min(shortest, lengths_mm[i]);
  anchor_ = rod_.compressed(shortest, aside);
  damping_ = 0;
  secant_known_ = false;
  may_slide_ = false;
  slide_ = {};
  friction_load_ = {};
  friction_column_ = {};
  friction_loss_ = {};
  rubs_ = {};
  was_taut_ = {};
  evaluate(anchor_, state());
}

void Plant::settle(const PerTendon& lengths_mm) {
  place(lengths_mm, {});
  solve();
  creeping_ = false;
}

void Plant::step(const PerTendon& lengths_mm, double duration_s) {
  lengths_mm_ = lengths_mm;
  anchor_ = state().modes;
  damping_ = settings_.damping_time_s / duration_s;
  may_slide_ = settings_.friction > 0;
  slide_from_ = slide_;
  was_taut_ = taut();
  reload(state());
  for (int i = 0; i < settings_.tendons; ++i)
    path_from_mm_[i] = state().paths[i].length_mm();
  solve();
  double moved = 0;
  for (int m = 0; m < rod_.modes(); ++m) {
    moved = std::max(moved, std::fabs(state().modes[m] - anchor_[m]));
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
  bool stable = falls_nowhere(solver);
  if (!stable) {  // or the secant is not up to date
    rebuild_secant();
    stable = falls_nowhere(solver);
  }
  if (!stable) {
    for (double shift = 0.25; !solver.factor(hessian(taut()), rod_.modes(), shift); shift *= 2) {
      if (!(shift < kLargestShift)) {  // there is no telling which way it falls
        damping_ = damping;
        return false;
      }
    }
    Modes way;
    way.fill(1);  // inverse iteration: towards the lowest curvature
    for (int k = 0; k < 8; ++k) {
      way = solver.solve(way);
      const double size = length(way);
      for (double& part : way)
        part /= size;
    }
    Modes modes = state().modes;
    for (int m = 0; m < rod_.modes(); ++m)
      modes[m] += kNudge * way[m];
    evaluate(modes, state());
  }
  damping_ = damping;
  return !stable;
}

bool Plant::falls_nowhere(Cholesky& solver) const {
  return solver.factor(hessian(taut()), rod_.modes(), 0);
}

bool Plant::stable() {
  const double damping = damping_;
  damping_ = 0;
  rebuild_secant();
  Cholesky solver;
  const bool found = falls_nowhere(solver);
  damping_ = damping;
  return found;
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
  settle_friction(state());
  for (iterations_ = 0; iterations_ < kIterations; ++iterations_) {
    residual_ = length(state().gradient);
    if (residual_ < kTolerance)
      return;
    if (since_rebuild >= kPatience) {
      rebuild_secant();
      fresh = true;
      since_rebuild = 0;
    }
    Modes step;
    const bool descends = newton_step(step);
    const double slope = inner(state().gradient, step);
    double fraction = std::min(1.0, kLongestStep / length(step));
    bool accepted = false;
    for (int halving = 0; descends && halving < 25; ++halving) {
      Modes modes = state().modes;
      for (int m = 0; m < rod_.modes(); ++m)
        modes[m] += fraction * step[m];
      evaluate_beside(modes);
      if (trial().energy <= state().energy + 1e-4 * fraction * slope + 1e-11) {
        accepted = true;
        break;
      }
      fraction *= 0.5;
    }
    if (accepted) {
      update_secant(state(), trial());
      present_ = 1 - present_;
      was_taut_ = {};
      settle_friction(state());
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
  residual_ = length(state().gradient);
}

// At modes near the present state's.
void Plant::evaluate_beside(const Modes& modes) {
  for (int i = 0; i < settings_.tendons; ++i)
    trial().paths[i].start_from(state().paths[i]);
  evaluate(modes, trial());
}

Tendons Plant::taut() const {
  Tendons taut{};
  for (int i = 0; i < settings_.tendons; ++i)
    taut[i] = state().tension_n[i] > 0;
  return taut;
}

// The lower half, as if these tendons were the taut ones.
Matrix Plant::hessian(const Tendons& taut) const {
  Matrix hessian = secant_;
  for (int m = 0; m < rod_.modes(); ++m)
    hessian[m][m] += 1 + damping_;
  for (int i = 0; i < settings_.tendons; ++i) {
    if (!taut[i])
      continue;
    const Modes& gradient = state().path_gradient[i];
    for (int m = 0; m < rod_.modes(); ++m) {
      const double weight = settings_.tendon_stiffness_n_per_mm * gradient[m];
      for (int k = 0; k <= m; ++k)
        hessian[m][k] += weight * gradient[k];
    }
  }
  add_solid_hessian(hessian);
  return hessian;
}

// Step from the modified Newton system; false if it can't be made to descend. Which
// tendons are taut at its end is part of what is sought: starting from those that are now
// it would go far where all have just been let out, and back by halves.
bool Plant::newton_step(Modes& step) const {
  Tendons guess = taut();
  for (int i = 0; i < settings_.tendons; ++i)
    guess[i] = guess[i] || (was_taut_[i] && state().path_known[i]);
  for (int attempt = 0; attempt < kGuesses && newton_step(guess, step); ++attempt) {
    Tendons found{};
    for (int i = 0; i < settings_.tendons; ++i) {
      found[i] = state().path_known[i] &&
                 state().stretch_mm[i] + inner(state().path_gradient[i], step) > 0;
    }
    if (found == guess)
      return true;
    guess = found;
  }
  return newton_step(taut(), step);
}

bool Plant::newton_step(const Tendons& taut, Modes& step) const {
  const Matrix matrix = hessian(taut);
  Cholesky solver;
  double shift = 0;
  for (int attempt = 0; !solver.factor(matrix, rod_.modes(), shift); ++attempt) {
    if (attempt == 12)
      return false;
    shift = shift == 0 ? 0.25 : 2 * shift;
  }
  Modes downhill{};
  for (int m = 0; m < rod_.modes(); ++m)
    downhill[m] = -state().gradient[m];
  for (int i = 0; i < settings_.tendons; ++i) {
    if (!taut[i] || state().tension_n[i] > 0)
      continue;
    const double pull_n = settings_.tendon_stiffness_n_per_mm * state().stretch_mm[i];
    for (int m = 0; m < rod_.modes(); ++m)
      downhill[m] -= pull_n * (state().path_gradient[i][m] + friction_loss_[i][m]);
  }
  step = solver.solve(downhill);
  const Modes plain = step;
  // Friction's part is not symmetric: one rank for each tendon, by Sherman and Morrison.
  std::array<Modes, kTendonsMost> solved;
  for (int i = 0; i < settings_.tendons; ++i) {
    solved[i] = {};
    if (!taut[i] || !rubs_[i])
      continue;
    solved[i] = solver.solve(friction_column_[i]);
    for (int j = 0; j < i; ++j)
      deflate(solved[j], state().path_gradient[j], solved[i]);
    const double scale = 1 + inner(state().path_gradient[i], solved[i]);
    if (scale < 0.1) {  // no longer a small change of what is symmetric
      solved[i] = {};
      continue;
    }
    for (int m = 0; m < rod_.modes(); ++m)
      solved[i][m] /= scale;
    deflate(solved[i], state().path_gradient[i], step);
  }
  if (inner(step, state().gradient) >= 0)
    step = plain;
  return inner(step, state().gradient) < 0;
}

// The gradient of tendons and weight with the tensions held at other values.
Modes Plant::frozen_gradient(const State& state, const PerTendon& tension_n) const {
  Modes out = state.geometric;
  for (int i = 0; i < settings_.tendons; ++i) {
    const double extra = tension_n[i] - state.tension_n[i];
    if (extra == 0)
      continue;
    Modes gradient{};
    if (state.path_known[i]) {
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
  const PerTendon tension_n = state().tension_n;
  for (int k = 0; k < rod_.modes(); ++k) {
    Modes modes = state().modes;
    modes[k] += kSecantStep;
    evaluate_beside(modes);
    const Modes moved = frozen_gradient(trial(), tension_n);
    for (int m = 0; m < rod_.modes(); ++m) {
      secant_[m][k] = (moved[m] - state().geometric[m]) / kSecantStep;
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
    const double weight = rest[m] / along;
    for (int k = 0; k < rod_.modes(); ++k)
      secant_[m][k] += weight * rest[k];
  }
}

}  // namespace sim
}  // namespace setae
