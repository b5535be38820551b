#pragma once

#include <stdint.h>

#include "protocol/messages.h"

namespace setae {

inline uint16_t distance(uint16_t from, uint16_t to) {
  return static_cast<uint16_t>(from < to ? to - from : from - to);
}

// Of the servo that has farthest to go.
inline uint16_t longest_distance(const uint16_t* from, const uint16_t* to) {
  uint16_t longest = 0;
  for (uint8_t i = 0; i < protocol::kServos; ++i) {
    const uint16_t here = distance(from[i], to[i]);
    if (here > longest)
      longest = here;
  }
  return longest;
}

}  // namespace setae
