// A hobby servo and the pulley on it: from pulses to the tendon's free length.
#pragma once

#include <stdint.h>

#include "random.h"

namespace setae {
namespace sim {

struct ServoSettings {
  double dead_band_us;
  double speed_us_s;  // of pulse width
  double time_constant_s;
  double pulse_free_us;
  double mm_per_us;       // signed: positive winds with longer pulses
  double free_length_mm;  // what is left of the tendon at pulse_free_us
  double winding_error;   // relative
  double backlash_mm;
  double winding_slip;  // most that slips, of the wound length
};

class Servo {
 public:
  Servo(const ServoSettings& settings, const Random& slip);

  // The servo measures a pulse at its end. One at a time: it must be over before
  // the next is announced.
  void pulse(int64_t end_us, double width_us);
  // No more pulses: the drive goes dead, the gears hold.
  void detach();

  void advance_to(int64_t now_us);

  double length_mm() const { return length_mm_; }
  double position_us() const { return position_us_; }

 private:
  void drive(double duration_s);
  void wind();

  ServoSettings settings_;
  int64_t now_us_ = 0;
  int64_t waiting_end_us_ = -1;
  double waiting_us_ = 0;
  bool driven_ = false;
  double target_us_;
  double position_us_;
  double wound_mm_ = 0;
  // Turns that are wound slide on the pulley: each winding by another part, and
  // unwinding gives it back in proportion.
  Random slip_;
  double slip_part_ = 0;
  double slipped_mm_ = 0;
  bool winding_ = false;
  double length_mm_;
};

}  // namespace sim
}  // namespace setae
