#include "link/receiver.h"

namespace setae {

bool Receiver::push(uint8_t wire) {
  if (!decoder_.push(wire))
    return false;
  if (decoder_.size() >= protocol::HostHeader::kSize) {
    decode(decoder_.data(), header_);
    if (decoder_.size() - protocol::HostHeader::kSize == protocol::host_payload_size(type())) {
      return true;
    }
  }
  decoder_.count_damaged();
  return false;
}

}  // namespace setae
