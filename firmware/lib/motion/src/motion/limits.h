// Where the pulses may go and how fast.
//
// The allowed poses are an intersection of half-spaces, hence convex: a straight line whose two
// ends are allowed is allowed throughout (give or take the rounding to one tick). So ends and
// speed are checked once, when a segment arrives, and nothing that was accepted has to be
// refused in mid-motion.
#pragma once

#include <stdint.h>

#include "hal/hal.h"
#include "motion/verdict.h"
#include "protocol/messages.h"

namespace setae {

class Limits {
 public:
  // None yet: all bounds are zero, and no pose is allowed.
  const protocol::SetLimits& in_force() const { return limits_; }
  bool set(const protocol::SetLimits& limits, Verdict& verdict);

  // Each servo's range, sums and differences of opposite tendons.
  bool check_pose(const uint16_t* ticks, Verdict& verdict) const;
  // A straight line of that many frames. `index` is told to the host where it is too fast.
  bool check_line(const uint16_t* from, const uint16_t* to, uint16_t frames, uint8_t index,
                  Verdict& verdict) const;
  // A speed for a move that the board plans itself.
  bool check_slew(uint16_t slew_ticks, Verdict& verdict) const;

  // The last guard before the servos: never outside a servo's range, never faster than the slew
  // limit, whatever was planned.
  void confine(const Pulses& previous, Pulses& pulses) const;

  uint32_t coarse_threshold_raw() const { return limits_.coarse_threshold_raw; }
  // 0: never.
  uint32_t hold_timeout_frames() const;

 private:
  protocol::SetLimits limits_ = {};
};

}  // namespace setae
