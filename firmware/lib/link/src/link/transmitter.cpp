#include "link/transmitter.h"

namespace setae {

namespace {

// The line gets each run of bytes as soon as it is stuffed.
class LineSink {
 public:
  explicit LineSink(HalRef hal) : hal_(hal), ring_(hal.to_send()), start_(ring_.head) {}
  void stage(uint8_t index, uint8_t byte) {
    ring_.stage(static_cast<uint8_t>(start_ + index), byte);
  }
  void publish(uint8_t count) {
    ring_.publish(static_cast<uint8_t>(start_ + count));
    hal_.start_sending();
  }

 private:
  HalRef hal_;
  TransmitRing& ring_;
  const uint8_t start_;
};

}  // namespace

bool Transmitter::send_bytes(protocol::BoardHeader header, protocol::MessageType type,
                             const uint8_t* payload, uint8_t size) {
  if (!ready())
    return false;
  header.type = static_cast<uint8_t>(type);
  header.sequence = sequence_++;
  const protocol::Wire<protocol::BoardHeader> wire(header);
  protocol::encode_frame(LineSink(hal_), wire.bytes(), protocol::BoardHeader::kSize, payload, size);
  return true;
}

}  // namespace setae
