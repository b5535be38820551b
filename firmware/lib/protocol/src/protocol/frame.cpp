#include "protocol/frame.h"

namespace setae {
namespace protocol {

uint8_t encode_frame(uint8_t* frame, uint8_t size, uint8_t* wire) {
  detail::put32(crc32c(frame, size), frame + size);
  size += kCrcBytes;
  cobs_encode(frame, size, wire);
  wire[size + 1] = 0;
  return size + kStuffingBytes;
}

bool FrameDecoder::push(uint8_t wire) {
  if (ended_) {
    cobs_.restart();
    crc_ = Crc32c();
    size_ = 0;
    too_long_ = false;
    ended_ = false;
  }
  if (wire == 0)
    return finish();
  uint8_t byte;
  if (cobs_.push(wire, byte) == CobsDecoder::Step::kNothing)
    return false;
  if (size_ == kFrameBytesMax) {
    too_long_ = true;
    return false;
  }
  bytes_[size_++] = byte;
  crc_.add(byte);
  return false;
}

bool FrameDecoder::finish() {
  ended_ = true;
  // Two delimiters in a row: a sender may lead with one to end what noise began.
  if (cobs_.empty())
    return false;
  const bool good = cobs_.complete() && !too_long_ && size_ > kCrcBytes && crc_.matched();
  if (!good)
    ++damaged_;
  return good;
}

}  // namespace protocol
}  // namespace setae
