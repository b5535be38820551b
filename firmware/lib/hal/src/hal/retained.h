// Memory that survives a reset, not a power cut, and is never initialised.
#pragma once

#include <stdint.h>
#include <string.h>

#include "protocol/crc32c.h"
#include "protocol/messages.h"

namespace setae {

struct Pulses {
  uint16_t ticks[protocol::kServos];  // 0.5 us each
};

// A part that counts only where its CRC is right: power-on leaves anything here, and a reset may
// come while it is written.
template <typename T>
struct Sealed {
  T value;
  uint32_t crc;

  uint32_t right_crc() const {
    return protocol::crc32c(reinterpret_cast<const uint8_t*>(&value), sizeof(value));
  }
  bool whole() const { return crc == right_crc(); }
  void seal() { crc = right_crc(); }
  void clear() {
    memset(&value, 0, sizeof(value));
    seal();
  }
};

// The last pulses put out.
struct Pose {
  bool known;
  Pulses pulses;
};

template <typename Record>
struct LatchMemory {
  Record record;
  bool pending;  // the host has not acknowledged it
};

struct Retained {
  Sealed<Pose> pose;
  Sealed<Pose> pose_copy;  // written after the other: one of them is always whole
  Sealed<LatchMemory<protocol::Trip>> trip;
  Sealed<LatchMemory<protocol::FaultMessage>> fault;
  Sealed<LatchMemory<protocol::RefusalMessage>> refusal;
};

}  // namespace setae
