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
    if (hal_.write_room() < kSize + protocol::kCrcBytes + protocol::kStuffingBytes)
      return false;
    header.type = static_cast<uint8_t>(Message::kType);
    uint8_t frame[kSize + protocol::kCrcBytes];
    encode(message, frame + protocol::BoardHeader::kSize);
    write(header, frame, kSize);
    return true;
  }

 private:
  void write(protocol::BoardHeader& header, uint8_t* frame, uint8_t size);

  Hal& hal_;
  uint8_t sequence_ = 0;
};

}  // namespace setae
