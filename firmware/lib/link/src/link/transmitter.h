// Messages to the host, each written wholly or not at all, so that a full line never waits and
// never tears a frame.
#pragma once

#include <stdint.h>

#include "hal/hal.h"
#include "protocol/frame.h"

namespace setae {

class Transmitter {
 public:
  // What waits already when a frame is written: enough to keep the line busy meanwhile, and little,
  // since nothing that is written can be overtaken.
  static constexpr uint8_t kAheadBytes = 24;
  static_assert(kAheadBytes + protocol::kFrameWireBytesMax <= kTransmitRingBytes, "");

  explicit constexpr Transmitter(HalRef hal) : hal_(hal) {}

  // Whether send() would send now.
  bool ready() { return hal_.to_send().size() <= kAheadBytes; }

  // Fills in the header's type and sequence. False where too much waits before it.
  template <typename Message>
  bool send(protocol::BoardHeader&& header, const Message& message) {
    return send_as(Message::kType, static_cast<protocol::BoardHeader&&>(header), message);
  }
  // Under another message's type, whose payload is the same.
  template <typename Message>
  bool send_as(protocol::MessageType type, protocol::BoardHeader&& header, const Message& message) {
    protocol::Wire<Message> wire(message);
    return send_bytes(header, type, wire.bytes(), Message::kSize);
  }

 private:
  bool send_bytes(protocol::BoardHeader& header, protocol::MessageType type, const uint8_t* payload,
                  uint8_t size);

  HalRef hal_;
  uint8_t sequence_ = 0;
};

}  // namespace setae
