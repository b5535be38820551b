#include "link/receiver.h"

namespace setae {

uint8_t Receiver::take(const uint8_t* wire, uint8_t count, bool& message) {
  const uint8_t taken = decoder_.take(wire, count, message);
  if (message && !read_header()) {
    decoder_.count_damaged();
    message = false;
  }
  return taken;
}

bool Receiver::read_header() {
  if (decoder_.size() < protocol::HostHeader::kSize)
    return false;
  decode(decoder_.data(), header_);
  return decoder_.size() - protocol::HostHeader::kSize == protocol::host_payload_size(type());
}

}  // namespace setae
