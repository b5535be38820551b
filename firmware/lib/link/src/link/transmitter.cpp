#include "link/transmitter.h"

namespace setae {

namespace {

// The line gets each run of bytes as soon as it is stuffed.
class LineSink {
 public:
  explicit LineSink(HalRef hal) : hal_(hal), ring_(hal.to_send()) {}
  void stage(uint8_t index, uint8_t byte) { ring_.stage(index, byte); }
  void publish(uint8_t end) {
    ring_.publish(end);
    hal_.start_sending();
  }

 private:
  HalRef hal_;
  TransmitRing& ring_;
};

}  // namespace

bool Transmitter::send_bytes(protocol::BoardHeader& header, protocol::MessageType type,
                             const uint8_t* payload, uint8_t size) {
  if (!ready())
    return false;
  header.type = static_cast<uint8_t>(type);
  header.sequence = sequence_++;
  const protocol::Wire<protocol::BoardHeader> wire(header);
  protocol::encode_frame(LineSink(hal_), hal_.to_send().head, wire.bytes(),
                         protocol::BoardHeader::kSize, payload, size);
  return true;
}

}  // namespace setae
