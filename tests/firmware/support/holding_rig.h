// A board that holds a pose, and what most tests of it look at.
#pragma once

#include <doctest/doctest.h>

#include "rig.h"

namespace setae {

constexpr int32_t kRest = 1013 * kHpa;
constexpr int32_t kTouch = kRest + 30 * kHpa;
constexpr uint16_t kAway = 2200;

struct HoldingRig : Rig {
  HoldingRig() { hold(); }
};

// No frame after `from` puts out anything but what frame `from` did.
inline bool frozen_since(const Rig& rig, size_t from) {
  for (size_t i = from + 1; i < rig.outputs.size(); ++i) {
    for (uint8_t servo = 0; servo < 4; ++servo) {
      if (rig.outputs[i].pulses.ticks[servo] != rig.outputs[from].pulses.ticks[servo]) {
        return false;
      }
    }
  }
  return true;
}

// The command is refused with this reason, is answered, and moves nothing.
template <typename Message>
void check_refused(Rig& rig, const Message& message, protocol::Refusal reason) {
  const size_t before = rig.refusals.size();
  const size_t frame = rig.outputs.size() - 1;
  const uint8_t sequence = rig.next_sequence;
  CHECK(rig.command(message));
  REQUIRE(rig.refusals.size() == before + 1);
  const protocol::RefusalMessage& refusal = rig.refusals.back().message;
  CHECK(refusal.reason == static_cast<uint8_t>(reason));
  CHECK(refusal.command_type == static_cast<uint8_t>(Message::kType));
  CHECK(refusal.command_sequence == sequence);
  rig.run_frames(10);
  CHECK(frozen_since(rig, frame));
  rig.acknowledge_all();
}

}  // namespace setae
