#include "link/transmitter.h"

namespace setae {

void Transmitter::write(protocol::BoardHeader& header, uint8_t* frame, uint8_t size) {
  header.sequence = sequence_++;
  encode(header, frame);
  uint8_t wire[protocol::kFrameWireBytesMax];
  hal_.write(wire, protocol::encode_frame(frame, size, wire));
}

}  // namespace setae
