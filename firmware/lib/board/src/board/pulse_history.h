// The pulses of the last servo frames: what was put out around a touch.
#pragma once

#include <stdint.h>
#include <string.h>

#include "hal/hal.h"

namespace setae {

class PulseHistory {
 public:
  void fill(const Pulses& pulses) {
    for (uint8_t i = 0; i < protocol::kTripHistoryFrames; ++i)
      frames_[i] = pulses;
  }
  void add(const Pulses& pulses) {
    memmove(&frames_[0], &frames_[1], sizeof(frames_) - sizeof(frames_[0]));
    frames_[protocol::kTripHistoryFrames - 1] = pulses;
  }
  // Oldest first.
  const Pulses& operator[](uint8_t index) const { return frames_[index]; }

 private:
  Pulses frames_[protocol::kTripHistoryFrames] = {};
};

}  // namespace setae
