// Target: the board's receiver, fed with whole, damaged and made-up frames, must find the very
// messages that the reference finds, and count the very damage.
//
// Input: parts, each begun by a byte. Its lowest two bits say what follows, the others how long:
//   0  raw bytes
//   1  a sealed frame: these bytes, CRC and stuffing added
//   2  the same, one bit of it flipped
//   3  the same, one byte of it lost
#include <string.h>

#include "input.h"
#include "link/receiver.h"
#include "reference.h"
#include "violation.h"

namespace setae {
namespace fuzz {
namespace {

// Bytes on the line in one run: a few frames.
constexpr uint32_t kEnough = 256;

class Duel {
 public:
  uint32_t pushed() const { return pushed_; }

  void push(uint8_t wire) {
    ++pushed_;
    const bool accepted = receiver_.push(wire);
    bool expected = false;
    switch (reference_.push(wire)) {
      case ReferenceDecoder::Found::kNothing:
        break;
      case ReferenceDecoder::Found::kDamage:
        ++damaged_;
        break;
      case ReferenceDecoder::Found::kFrame:
        expected = is_message();
        damaged_ += !expected;
        break;
    }
    expect(accepted == expected,
           accepted ? "accepts no frame but a right one" : "accepts each right frame");
    expect(receiver_.damaged() == damaged_, "counts each damaged frame once");
    if (!accepted)
      return;
    const Inside& inside = reference_.inside();
    const protocol::HostHeader& header = receiver_.header();
    expect(header.type == inside.bytes[0] && header.session == inside.bytes[1] &&
               header.sequence == inside.bytes[2],
           "hands out the header that was sent");
    expect(memcmp(receiver_.payload(), inside.bytes + 3, inside.size - 3u) == 0,
           "hands out the payload that was sent");
  }

 private:
  bool is_message() const {
    const Inside& inside = reference_.inside();
    const auto type = static_cast<protocol::MessageType>(inside.bytes[0]);
    return inside.size >= 3 && protocol::host_payload_size(type) == inside.size - 3;
  }

  Receiver receiver_;
  ReferenceDecoder reference_;
  uint8_t damaged_ = 0;
  uint32_t pushed_ = 0;
};

// With a header's type, its one length: otherwise a fuzzer rarely finds the two together.
size_t sealed(Input& input, size_t size, uint8_t* wire) {
  if (size == 0)
    size = 1;
  uint8_t inside[58];
  inside[0] = input.byte();
  const uint8_t right = protocol::host_payload_size(static_cast<protocol::MessageType>(inside[0]));
  if (right != 0xFF && size < 32)
    size = right + 3u;
  for (size_t i = 1; i < size; ++i)
    inside[i] = input.byte();
  return reference_seal(inside, size < 58 ? size : 58, wire);
}

}  // namespace
}  // namespace fuzz
}  // namespace setae

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace setae::fuzz;
  Input input(data, size);
  Duel duel;
  while (input.more() && duel.pushed() < kEnough) {
    const uint8_t part = input.byte();
    const size_t length = part >> 2;
    if ((part & 3) == 0) {
      for (size_t i = 0; i < length; ++i)
        duel.push(input.byte());
      continue;
    }
    uint8_t wire[kWireMax];
    const size_t wire_size = sealed(input, length < 58 ? length : 58, wire);
    const uint8_t where = (part & 3) == 1 ? 0 : input.byte();
    for (size_t i = 0; i < wire_size; ++i) {
      if ((part & 3) == 3 && i == where % wire_size)
        continue;
      const bool flip = (part & 3) == 2 && i == (where >> 3) % wire_size;
      duel.push(static_cast<uint8_t>(wire[i] ^ (flip ? 1 << (where & 7) : 0)));
    }
  }
  return 0;
}
