#include "protocol/frame.h"

namespace setae {
namespace protocol {

uint8_t encode_frame(const uint8_t* frame, uint8_t size, uint8_t* wire) {
  MemorySink sink(wire);
  FrameEncoder<MemorySink> encoder(sink);
  encoder.add(frame, size);
  return encoder.finish();
}

uint8_t FrameDecoder::take(const uint8_t* wire, uint8_t count, bool& good) {
  good = false;
  if (ended_) {
    cobs_.restart();
    crc_ = Crc32c();
    size_ = 0;
    too_long_ = false;
    ended_ = false;
  }
  CobsDecoder cobs = cobs_;  // copies that can stay in registers
  Crc32c crc = crc_;
  uint8_t* out = bytes_ + size_;
  uint8_t taken = 0;
  while (taken != count) {
    const uint8_t coded = *wire++;
    ++taken;
    if (coded == 0) {
      ended_ = true;
      break;
    }
    uint8_t byte;
    if (cobs.push(coded, byte) == CobsDecoder::Step::kNothing)
      continue;
    if (out == bytes_ + kFrameBytesMax) {
      too_long_ = true;
      continue;
    }
    *out++ = byte;
    crc.add(byte);
  }
  cobs_ = cobs;
  crc_ = crc;
  size_ = static_cast<uint8_t>(out - bytes_);
  if (ended_)
    good = finish();
  return taken;
}

bool FrameDecoder::finish() {
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
