#include "servo.h"

#include <algorithm>
#include <cmath>

namespace setae {
namespace sim {

Servo::Servo(const ServoSettings& settings, const Random& slip)
    : settings_(settings),
      target_us_(settings.pulse_free_us),
      position_us_(settings.pulse_free_us),
      slip_(slip),
      length_mm_(settings.free_length_mm) {}

void Servo::pulse(int64_t end_us, double width_us) {
  waiting_end_us_ = end_us;
  waiting_us_ = width_us;
}

void Servo::detach() {
  driven_ = false;
  waiting_end_us_ = -1;
}

void Servo::advance_to(int64_t now_us) {
  if (waiting_end_us_ >= 0 && waiting_end_us_ <= now_us) {
    drive(1e-6 * static_cast<double>(waiting_end_us_ - now_us_));
    now_us_ = waiting_end_us_;
    waiting_end_us_ = -1;
    target_us_ = waiting_us_;
    driven_ = true;
  }
  drive(1e-6 * static_cast<double>(now_us - now_us_));
  now_us_ = now_us;
  wind();
}

// Full speed far away, first order near by, and no drive in the dead band.
void Servo::drive(double duration_s) {
  if (!driven_ || duration_s <= 0)
    return;
  const double sign = target_us_ > position_us_ ? 1 : -1;
  double away = std::fabs(target_us_ - position_us_);
  if (away <= settings_.dead_band_us)
    return;
  const double near =
      std::max(settings_.speed_us_s * settings_.time_constant_s, settings_.dead_band_us);
  if (away > near) {
    const double fast_s = std::min(duration_s, (away - near) / settings_.speed_us_s);
    away -= settings_.speed_us_s * fast_s;
    duration_s -= fast_s;
  }
  if (duration_s > 0) {
    away =
        std::max(settings_.dead_band_us, away * std::exp(-duration_s / settings_.time_constant_s));
  }
  position_us_ = target_us_ - sign * away;
}

void Servo::wind() {
  const double turned_mm = (position_us_ - settings_.pulse_free_us) * settings_.mm_per_us *
                           (1 + settings_.winding_error);
  const double play = 0.5 * settings_.backlash_mm;
  const double before_mm = wound_mm_;
  wound_mm_ = std::min(std::max(wound_mm_, turned_mm - play), turned_mm + play);
  if (wound_mm_ > before_mm && !winding_) {
    winding_ = true;
    slip_part_ = settings_.winding_slip * slip_.uniform();
  }
  if (wound_mm_ < before_mm)
    winding_ = false;
  if (wound_mm_ <= 0) {
    slipped_mm_ = 0;
  } else if (winding_) {
    slipped_mm_ += slip_part_ * (wound_mm_ - std::max(before_mm, 0.0));
  } else {
    slipped_mm_ *= wound_mm_ / before_mm;
  }
  length_mm_ = settings_.free_length_mm - wound_mm_ + slipped_mm_;
}

}  // namespace sim
}  // namespace setae
