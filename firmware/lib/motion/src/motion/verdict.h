// Whether a command is carried out, and if not, what to tell the host.
#pragma once

#include <stdint.h>

#include "protocol/messages.h"

namespace setae {

constexpr uint8_t kNoIndex = 255;

struct Verdict {
  protocol::Refusal reason;
  bool later;  // neither done nor refused: no room yet, the host sends it again
  uint8_t index;
  int32_t value;
  int32_t limit;

  bool ok() const { return reason == protocol::Refusal::kNone && !later; }

  static Verdict accept() { return {protocol::Refusal::kNone, false, kNoIndex, 0, 0}; }
  static Verdict wait() { return {protocol::Refusal::kNone, true, kNoIndex, 0, 0}; }
  static Verdict refuse(protocol::Refusal reason, uint8_t index = kNoIndex, int32_t value = 0,
                        int32_t limit = 0) {
    return {reason, false, index, value, limit};
  }
};

}  // namespace setae
