// The supply's voltage, told by how large a part of it the chip's bandgap is.
#pragma once

#include <stdint.h>

namespace setae {

// The bandgap of one chip may be a tenth off (data sheet, table 29-16), and the voltage with it.
constexpr uint32_t kBandgapMv = 1100;
constexpr uint32_t kSupplyParts = 1024;

// Its own inverse. Dividing takes 40 us: watch parts, tell millivolts.
constexpr uint16_t supply_mv(uint16_t part) {
  return part == 0 ? 0 : static_cast<uint16_t>(kBandgapMv * kSupplyParts / part);
}

}  // namespace setae
