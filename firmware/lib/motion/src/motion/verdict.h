// Whether a command is carried out, and if not, what to tell the host.
#pragma once

#include <stdint.h>

#include "protocol/messages.h"

namespace setae {

constexpr uint8_t kNoIndex = 255;

// Filled in where a check fails: those that pass, which are most, have nothing to hand back.
struct Verdict {
  protocol::Refusal reason = protocol::Refusal::kNone;
  bool later = false;  // neither done nor refused: no room yet, the host sends it again
  uint8_t index = kNoIndex;
  int32_t value = 0;
  int32_t limit = 0;

  bool ok() const { return reason == protocol::Refusal::kNone && !later; }

  // All are false: what the check returns.
  bool wait() {
    later = true;
    return false;
  }
  bool refuse(protocol::Refusal why) {
    reason = why;
    return false;
  }
  bool refuse(protocol::Refusal why, uint8_t at, int32_t is, int32_t bound) {
    index = at;
    value = is;
    limit = bound;
    return refuse(why);
  }
};

}  // namespace setae
