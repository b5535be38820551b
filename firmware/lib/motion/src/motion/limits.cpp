#include "motion/limits.h"

#include "motion/distance.h"

namespace setae {

using protocol::Refusal;

namespace {

bool check_range(int32_t value, int32_t low, int32_t high, Refusal reason, uint8_t index,
                 Verdict& verdict) {
  if (value < low)
    return verdict.refuse(reason, index, value, low);
  if (value > high)
    return verdict.refuse(reason, index, value, high);
  return true;
}

}  // namespace

bool Limits::set(const protocol::SetLimits& limits, Verdict& verdict) {
  for (uint8_t i = 0; i < protocol::kServos; ++i) {
    if (!check_range(limits.pulse_max_ticks[i], protocol::kPulseTicksAbsoluteMin,
                     protocol::kPulseTicksAbsoluteMax, Refusal::kOutOfLimits, i, verdict) ||
        !check_range(limits.pulse_min_ticks[i], protocol::kPulseTicksAbsoluteMin,
                     limits.pulse_max_ticks[i], Refusal::kOutOfLimits, i, verdict)) {
      return false;
    }
  }
  for (uint8_t i = 0; i < protocol::kPairs; ++i) {
    if (limits.pair_sum_min_ticks[i] > limits.pair_sum_max_ticks[i]) {
      return verdict.refuse(Refusal::kPairLimit, i, limits.pair_sum_min_ticks[i],
                            limits.pair_sum_max_ticks[i]);
    }
    if (limits.pair_difference_min_ticks[i] > limits.pair_difference_max_ticks[i]) {
      return verdict.refuse(Refusal::kPairLimit, i, limits.pair_difference_min_ticks[i],
                            limits.pair_difference_max_ticks[i]);
    }
  }
  if (limits.slew_ticks == 0)
    return verdict.refuse(Refusal::kBadField, kNoIndex, 0, 1);
  limits_ = limits;
  return true;
}

bool Limits::check_pose(const uint16_t* ticks, Verdict& verdict) const {
  for (uint8_t i = 0; i < protocol::kServos; ++i) {
    if (!check_range(ticks[i], limits_.pulse_min_ticks[i], limits_.pulse_max_ticks[i],
                     Refusal::kOutOfLimits, i, verdict)) {
      return false;
    }
  }
  for (uint8_t i = 0; i < protocol::kPairs; ++i) {
    const int32_t a = ticks[i];
    const int32_t b = ticks[i + protocol::kPairs];
    if (!check_range(a + b, limits_.pair_sum_min_ticks[i], limits_.pair_sum_max_ticks[i],
                     Refusal::kPairLimit, i, verdict) ||
        !check_range(a - b, limits_.pair_difference_min_ticks[i],
                     limits_.pair_difference_max_ticks[i], Refusal::kPairLimit, i, verdict)) {
      return false;
    }
  }
  return true;
}

bool Limits::check_line(const uint16_t* from, const uint16_t* to, uint16_t frames, uint8_t index,
                        Verdict& verdict) const {
  const uint16_t distance = longest_distance(from, to);
  const uint32_t reach = static_cast<uint32_t>(limits_.slew_ticks) * frames;
  return distance <= reach ||
         verdict.refuse(Refusal::kTooFast, index, distance, static_cast<int32_t>(reach));
}

bool Limits::check_slew(uint16_t slew_ticks, Verdict& verdict) const {
  if (slew_ticks == 0)
    return verdict.refuse(Refusal::kBadField, kNoIndex, 0, 1);
  return slew_ticks <= limits_.slew_ticks ||
         verdict.refuse(Refusal::kTooFast, kNoIndex, slew_ticks, limits_.slew_ticks);
}

void Limits::confine(const Pulses& previous, Pulses& pulses) const {
  for (uint8_t i = 0; i < protocol::kServos; ++i) {
    int32_t ticks = pulses.ticks[i];
    if (ticks < limits_.pulse_min_ticks[i])
      ticks = limits_.pulse_min_ticks[i];
    if (ticks > limits_.pulse_max_ticks[i])
      ticks = limits_.pulse_max_ticks[i];
    const int32_t low = static_cast<int32_t>(previous.ticks[i]) - limits_.slew_ticks;
    const int32_t high = static_cast<int32_t>(previous.ticks[i]) + limits_.slew_ticks;
    if (ticks < low)
      ticks = low;
    if (ticks > high)
      ticks = high;
    pulses.ticks[i] = static_cast<uint16_t>(ticks);
  }
}

uint32_t Limits::hold_timeout_frames() const {
  constexpr uint16_t kFramesPerSecond = 1000000UL / protocol::kServoFrameUs;
  return static_cast<uint32_t>(limits_.hold_timeout_s) * kFramesPerSecond;
}

}  // namespace setae
