// The codec against the vectors that the Python side is checked with too.
#define DOCTEST_CONFIG_IMPLEMENT_WITH_MAIN
#include <doctest/doctest.h>
#include <string.h>

#include <string>
#include <vector>

#include "link/receiver.h"
#include "protocol/frame.h"
#include "vectors.h"

using namespace setae;
using namespace setae::protocol;

namespace {

using Bytes = std::vector<uint8_t>;

template <typename T, size_t kCount>
constexpr size_t count_of(const T (&)[kCount]) {
  return kCount;
}

// Good frames that come out of a decoder.
std::vector<Bytes> decode_all(FrameDecoder& decoder, const Bytes& wire) {
  std::vector<Bytes> frames;
  for (uint8_t byte : wire) {
    if (decoder.push(byte)) {
      frames.emplace_back(decoder.data(), decoder.data() + decoder.size());
    }
  }
  return frames;
}

Bytes good_wire() {
  uint8_t frame[kFrameBytesMax] = {0x02, 9, 0, 42};
  uint8_t wire[kFrameWireBytesMax];
  const uint8_t size = encode_frame(frame, 4, wire);
  return Bytes(wire, wire + size);
}

const Bytes kGoodFrame = {0x02, 9, 0, 42};

}  // namespace

TEST_CASE("CRC-32C gives the catalogued check value") {
  CHECK(crc32c(reinterpret_cast<const uint8_t*>("123456789"), 9) == 0xE3069283);
}

TEST_CASE("CRC and COBS give the vectors' bytes, and COBS comes back") {
  for (const vectors::Coding& coding : vectors::kCodings) {
    CAPTURE(int(coding.size));
    CHECK(crc32c(coding.data, coding.size) == coding.crc32c);
    uint8_t wire[256];
    cobs_encode(coding.data, coding.size, wire);
    CHECK(Bytes(wire, wire + coding.size + 1) ==
          Bytes(coding.encoded, coding.encoded + coding.encoded_size));

    CobsDecoder decoder;
    Bytes data;
    for (uint8_t i = 0; i < coding.encoded_size; ++i) {
      uint8_t byte;
      if (decoder.push(coding.encoded[i], byte) == CobsDecoder::Step::kByte)
        data.push_back(byte);
    }
    CHECK(decoder.complete());
    CHECK(data == Bytes(coding.data, coding.data + coding.size));
  }
}

TEST_CASE("every message of the vectors encodes to its wire bytes, and decodes to its fields") {
  for (const vectors::Frame& vector : vectors::kFrames) {
    CAPTURE(std::string(vector.name));
    uint8_t frame[kFrameBytesMax];
    memcpy(frame, vector.header, vector.header_size);
    vector.reencode(vector.payload, frame + vector.header_size);
    uint8_t wire[kFrameWireBytesMax];
    const uint8_t size = encode_frame(frame, vector.header_size + vector.payload_size, wire);
    CHECK(Bytes(wire, wire + size) == Bytes(vector.wire, vector.wire + vector.wire_size));

    FrameDecoder decoder;
    const auto frames = decode_all(decoder, Bytes(vector.wire, vector.wire + vector.wire_size));
    REQUIRE(frames.size() == 1);
    CHECK(decoder.damaged() == 0);
    CHECK(vector.fields_match(frames[0].data(), frames[0].data() + vector.header_size));
  }
}

TEST_CASE("a damaged frame is counted once, and the next frame is read") {
  for (const vectors::Damaged& vector : vectors::kDamaged) {
    CAPTURE(std::string(vector.name));
    Bytes wire(vector.wire, vector.wire + vector.wire_size);
    const Bytes good = good_wire();
    wire.insert(wire.end(), good.begin(), good.end());
    if (vector.from_host) {
      Receiver receiver;
      int messages = 0;
      for (uint8_t byte : wire)
        messages += receiver.push(byte);
      CHECK(messages == 1);
      CHECK(receiver.header().session == 9);
      CHECK(receiver.damaged() == 1);
    } else {
      FrameDecoder decoder;
      CHECK(decode_all(decoder, wire).back() == kGoodFrame);
    }
  }
}

TEST_CASE("no single flipped bit gets a frame past the CRC") {
  const Bytes good = good_wire();
  size_t accepted = 0;
  for (size_t bit = 0; bit < 8 * (good.size() - 1); ++bit) {
    Bytes wire = good;
    wire[bit / 8] ^= static_cast<uint8_t>(1 << (bit % 8));
    FrameDecoder decoder;
    accepted += decode_all(decoder, wire).size();
  }
  CHECK(accepted == 0);
}

TEST_CASE("a frame that follows noise without a delimiter is lost, the one after it is not") {
  FrameDecoder decoder;
  Bytes wire = {0x55, 0xAA, 0x03};
  for (int i = 0; i < 2; ++i) {
    const Bytes good = good_wire();
    wire.insert(wire.end(), good.begin(), good.end());
  }
  CHECK(decode_all(decoder, wire) == std::vector<Bytes>{kGoodFrame});
  CHECK(decoder.damaged() == 1);
}

TEST_CASE("delimiters alone are no frames, and no damage") {
  FrameDecoder decoder;
  CHECK(decode_all(decoder, Bytes(10, 0)).empty());
  CHECK(decoder.damaged() == 0);
}

TEST_CASE("bytes without any delimiter neither overflow nor end") {
  FrameDecoder decoder;
  CHECK(decode_all(decoder, Bytes(100000, 0xFF)).empty());
  CHECK(decode_all(decoder, {0}).empty());
  CHECK(decoder.damaged() == 1);
  CHECK(decode_all(decoder, good_wire()).size() == 1);
}
