// Wire bytes in, messages from the host out: frames with a right CRC, a known type, and the one
// length that the type has. The rest is counted as damaged.
#pragma once

#include <stdint.h>

#include "protocol/frame.h"

namespace setae {

class Receiver {
 public:
  // True where this byte ended a message. It stays readable until the next push().
  bool push(uint8_t wire) {
    bool message;
    take(&wire, 1, message);
    return message;
  }
  // Takes bytes until one ends a frame, or all of them; returns how many. `message` tells whether
  // there is one now.
  uint8_t take(const uint8_t* wire, uint8_t count, bool& message);

  const protocol::HostHeader& header() const { return header_; }
  protocol::MessageType type() const { return static_cast<protocol::MessageType>(header_.type); }
  const uint8_t* payload() const { return decoder_.data() + protocol::HostHeader::kSize; }

  // A frame has begun.
  bool inside() const { return decoder_.inside(); }
  uint8_t damaged() const { return decoder_.damaged(); }
  // The message came from another session.
  void count_stray() { decoder_.count_damaged(); }

 private:
  bool read_header();

  protocol::FrameDecoder decoder_;
  protocol::HostHeader header_ = {};
};

}  // namespace setae
