#pragma once

#include <stdint.h>

namespace setae {

constexpr uint8_t kFirmwareMajor = 0;
constexpr uint8_t kFirmwareMinor = 1;
constexpr uint8_t kFirmwarePatch = 0;

}  // namespace setae
