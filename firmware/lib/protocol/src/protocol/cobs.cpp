#include "protocol/cobs.h"

namespace setae {
namespace protocol {

void cobs_encode(const uint8_t* data, uint8_t size, uint8_t* wire) {
  uint8_t code_at = 0;
  for (uint8_t i = 0; i < size; ++i) {
    const uint8_t at = i + 1;
    if (data[i] != 0) {
      wire[at] = data[i];
    } else {
      wire[code_at] = at - code_at;
      code_at = at;
    }
  }
  wire[code_at] = static_cast<uint8_t>(size + 1 - code_at);
}

CobsDecoder::Step CobsDecoder::push(uint8_t wire, uint8_t& out) {
  if (left_ != 0) {
    --left_;
    out = wire;
    return Step::kByte;
  }
  left_ = wire - 1;
  const bool first = empty_;
  empty_ = false;
  if (first)
    return Step::kNothing;
  out = 0;  // each code byte but the first stands where a zero was
  return Step::kByte;
}

void CobsDecoder::restart() {
  left_ = 0;
  empty_ = true;
}

}  // namespace protocol
}  // namespace setae
