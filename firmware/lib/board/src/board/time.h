#pragma once

#include <stdint.h>

#include "hal/hal.h"

namespace setae {

// From `earlier` to `later`, as far as a telemetry field can tell.
inline uint16_t age_us(const BoardTime& earlier, const BoardTime& later) {
  const uint32_t frames = later.frame - earlier.frame;  // wraps after 2.7 years
  if (frames > 3)
    return 0xFFFF;
  const int32_t age =
      static_cast<int32_t>(frames * protocol::kServoFrameUs) + later.phase_us - earlier.phase_us;
  if (age < 0)
    return 0;
  return age > 0xFFFF ? 0xFFFF : static_cast<uint16_t>(age);
}

}  // namespace setae
