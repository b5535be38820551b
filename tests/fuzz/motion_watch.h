// What the servos get, held against what the robot survives and what a host has allowed.
#pragma once

#include "machine.h"
#include "step.h"

namespace setae {
namespace fuzz {

class MotionWatch {
 public:
  void on_restart() { *this = MotionWatch(); }
  // `polling`: the frame began in the midst of a poll, which may have ordered what it shows.
  void on_output(const Output& output, const protocol::SetLimits& limits, bool polling);
  void on_step(const Step& step, const Pulses& output);

 private:
  void allow(const Step& step);
  void freeze();
  void check_enabled() const;
  bool is_ordered() const;
  void check_order(bool toward_retract) const;
  bool toward_retract(const Output& output) const;

  Output last_ = {};
  bool frozen_ = false;       // until a resume
  bool motion_mode_ = false;  // since the last output
  bool attach_mode_ = false;
  bool reflex_mode_ = false;
  bool owes_enable_ = false;   // a servo got pulses in a poll that must turn out to have enabled it
  bool owes_order_ = false;    // moved in a poll that must turn out to have ordered it
  bool owes_retract_ = false;  // ... and not by the reflex, away from where the guard said
  bool enabled_ = false;       // enable was sent since nothing was attached
  bool segments_ = false;      // of the running epoch came
  bool unwinding_ = false;     // relax came, or the hold timed out
  bool guard_retracts_ = false;
  Mode mode_ = Mode::kRelaxed;
  uint32_t heard_frame_ = 0;
  uint16_t retract_ticks_[protocol::kServos] = {};
  uint16_t end_ticks_[protocol::kServos] = {};  // of the last accepted segment
  bool stop_known_ = false;
  uint8_t stop_number_ = 0;
  uint8_t stop_session_ = 0;
};

}  // namespace fuzz
}  // namespace setae
