// A straight line in pulse space, one step a servo frame, all servos arriving together.
//
// Integers only: after k of n frames a servo that has d ticks to go has gone round(d k / n), as
// in Bresenham's line. The rounding never adds up, and the last frame is the end itself.
#pragma once

#include <stdint.h>

#include "hal/hal.h"

namespace setae {

class Line {
 public:
  // frames > 0.
  void start(const Pulses& from, const uint16_t* to, uint16_t frames);
  // A line that takes as many frames as its fastest servo needs at `slew_ticks` a frame.
  void start_at_slew(const Pulses& from, const uint16_t* to, uint16_t slew_ticks);
  void cancel() { frames_left_ = 0; }

  bool running() const { return frames_left_ != 0; }

  // From the pulses of one frame to those of the next. Only while running.
  void step(Pulses& pulses);

 private:
  struct Axis {
    uint16_t to;
    uint16_t whole;      // ticks every frame
    uint16_t remainder;  // and this many n-ths of a tick
    uint16_t fraction;   // n-ths of a tick that are owed
  };

  Axis axes_[protocol::kServos] = {};
  uint16_t frames_ = 0;
  uint16_t frames_left_ = 0;
};

}  // namespace setae
