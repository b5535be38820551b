// Target: the board's receiver, fed with whole, damaged and made-up frames, must find the very
// messages that the reference finds, and count the very damage.
//
// Input: a byte that says in which pieces the receiver gets the stream, then parts, each begun by a
// byte. Its lowest two bits say what follows, the others how long:
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
constexpr size_t kPieceMax = 64;

class Duel {
 public:
  // The receiver gets so many bytes at a time.
  explicit Duel(size_t piece) : piece_(piece) {}

  uint32_t pushed() const { return pushed_; }

  void push(uint8_t wire) {
    ++pushed_;
    // At the buffer's end: who reads on behind it is found out.
    uint8_t* const first = buffer_ + sizeof(buffer_) - piece_;
    first[size_++] = wire;
    if (size_ == piece_)
      flush();
  }

  void flush() {
    const uint8_t* next = buffer_ + sizeof(buffer_) - piece_;
    while (size_ != 0) {
      bool message;
      const uint8_t taken = receiver_.take(next, static_cast<uint8_t>(size_), message);
      expect(taken != 0 && taken <= size_, "takes something, and no more than there is");
      compare(next, taken, message);
      next += taken;
      size_ -= taken;
    }
  }

 private:
  // Only the last byte can have ended a frame.
  void compare(const uint8_t* wire, uint8_t taken, bool message) {
    ReferenceDecoder::Found found = ReferenceDecoder::Found::kNothing;
    for (uint8_t i = 0; i < taken; ++i) {
      expect(found == ReferenceDecoder::Found::kNothing, "looks at each frame that ends");
      found = reference_.push(wire[i]);
    }
    const bool right = found == ReferenceDecoder::Found::kFrame && is_message();
    damaged_ += found != ReferenceDecoder::Found::kNothing && !right;
    expect(right || !message, "accepts no frame but a right one");
    expect(message || !right, "accepts each right frame");
    expect(receiver_.damaged() == damaged_, "counts each damaged frame once");
    if (!message)
      return;
    const Inside& inside = reference_.inside();
    const protocol::HostHeader& header = receiver_.header();
    expect(header.type == inside.bytes[0] && header.session == inside.bytes[1] &&
               header.sequence == inside.bytes[2],
           "hands out the header that was sent");
    expect(memcmp(receiver_.payload(), inside.bytes + 3, inside.size - 3u) == 0,
           "hands out the payload that was sent");
  }

  bool is_message() const {
    const Inside& inside = reference_.inside();
    const auto type = static_cast<protocol::MessageType>(inside.bytes[0]);
    return inside.size >= 3 && protocol::host_payload_size(type) == inside.size - 3;
  }

  Receiver receiver_;
  ReferenceDecoder reference_;
  uint8_t damaged_ = 0;
  uint32_t pushed_ = 0;
  const size_t piece_;
  size_t size_ = 0;
  uint8_t buffer_[kPieceMax];
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
  Duel duel(1 + input.byte() % kPieceMax);
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
  duel.flush();
  return 0;
}
