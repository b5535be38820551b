// Switches the servos' pulses on one by one, so that their start-up currents don't add up.
#pragma once

#include <stdint.h>

#include "protocol/messages.h"

namespace setae {

constexpr uint8_t kAllServos = (1 << protocol::kServos) - 1;

class Attacher {
 public:
  void start() { wait_frames_ = 0; }

  // At a frame's start. Adds to `attached`; true once all servos are, and the last one has had
  // its time.
  bool step(uint8_t& attached) {
    if (wait_frames_ != 0) {
      --wait_frames_;
      return false;
    }
    if (attached == kAllServos)
      return true;
    attached = static_cast<uint8_t>((attached << 1) | 1);
    wait_frames_ = protocol::kAttachIntervalFrames - 1;
    return false;
  }

 private:
  uint8_t wait_frames_ = 0;
};

}  // namespace setae
