// Messages to the host, each written wholly or not at all, so that a full line never waits and
// never tears a frame.
#pragma once

#include <stdint.h>

#include "hal/hal.h"
#include "protocol/frame.h"

namespace setae {

class Transmitter {
 public:
  explicit Transmitter(Hal& hal) : hal_(hal) {}

  // Fills in the header's type and sequence. False where the line has no room now.
  template <typename Message>
  bool send(protocol::BoardHeader header, const Message& message) {
    constexpr uint8_t kSize = protocol::BoardHeader::kSize + Message::kSize;
    uint8_t wire[kSize + protocol::kCrcBytes + protocol::kStuffingBytes];
    if (hal_.write_room() < sizeof(wire))
      return false;
    header.type = static_cast<uint8_t>(Message::kType);
    header.sequence = sequence_++;
    // The stuffing takes place where the frame is: one buffer, not two, on a small stack.
    uint8_t* const frame = wire + 1;
    encode(header, frame);
    encode(message, frame + protocol::BoardHeader::kSize);
    hal_.write(wire, protocol::encode_frame(frame, kSize, wire));
    return true;
  }

 private:
  Hal& hal_;
  uint8_t sequence_ = 0;
};

}  // namespace setae
