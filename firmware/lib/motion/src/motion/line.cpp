#include "motion/line.h"

#include "motion/distance.h"

namespace setae {

void Line::start(const Pulses& from, const uint16_t* to, uint16_t frames) {
  frames_ = frames;
  frames_left_ = frames;
  for (uint8_t i = 0; i < protocol::kServos; ++i) {
    const uint16_t ticks = distance(from.ticks[i], to[i]);
    axes_[i].to = to[i];
    axes_[i].whole = ticks / frames;
    axes_[i].remainder = ticks % frames;
    axes_[i].fraction = frames / 2;  // rounds to the nearest tick
  }
}

void Line::start_at_slew(const Pulses& from, const uint16_t* to, uint16_t slew_ticks) {
  const uint16_t ticks = longest_distance(from.ticks, to);
  const uint16_t frames = ticks / slew_ticks + (ticks % slew_ticks != 0);
  start(from, to, frames == 0 ? 1 : frames);
}

void Line::step(Pulses& pulses) {
  --frames_left_;
  for (uint8_t i = 0; i < protocol::kServos; ++i) {
    Axis& axis = axes_[i];
    uint16_t ticks = axis.whole;
    // fraction + remainder may not fit 16 bits; what is missing to a whole tick does.
    const uint16_t missing = frames_ - axis.remainder;
    if (axis.fraction >= missing) {
      axis.fraction -= missing;
      ++ticks;
    } else {
      axis.fraction += axis.remainder;
    }
    uint16_t& pulse = pulses.ticks[i];
    if (frames_left_ == 0) {
      pulse = axis.to;
    } else if (pulse < axis.to) {
      pulse += ticks;
    } else {
      pulse -= ticks;
    }
  }
}

}  // namespace setae
