// Damages frames by the million and counts those that a decoder takes for right ones.
//
//   damage count PATTERN FRAMES SEED        one line: damaged, harmless, undetected
//   damage dump PATTERN FRAMES SEED POOL    the streams and the verdicts, for another decoder
//
// POOL holds frames, one a line: `host` or `board`, and the bytes in hex as they are sent. Without
// it frames are made up; with it every fourth one arrives as it was sent.
//
// A damaged frame is one whose bytes between two delimiters are not those that were sent. It is
// undetected where the decoder hands out a frame that was not sent; harmless where it hands out
// one that was. Every second frame is one from the board, the others are a host's.
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <vector>

#include "protocol/frame.h"

namespace {

using setae::protocol::encode_frame;
using setae::protocol::FrameDecoder;
using setae::protocol::MessageType;

constexpr int kFrameMax = setae::protocol::kFrameWireBytesMax;
constexpr int kInsideMax = setae::protocol::kFrameBytesMax;
constexpr int kStreamMax = 2 * kFrameMax + 8;

// xoshiro256** (Blackman and Vigna 2018), seeded by splitmix64.
class Random {
 public:
  explicit Random(uint64_t seed) {
    for (uint64_t& word : state_) {
      seed += 0x9E3779B97F4A7C15;
      uint64_t mixed = (seed ^ (seed >> 30)) * 0xBF58476D1CE4E5B9;
      mixed = (mixed ^ (mixed >> 27)) * 0x94D049BB133111EB;
      word = mixed ^ (mixed >> 31);
    }
  }
  uint64_t next() {
    const uint64_t result = turn(state_[1] * 5, 7) * 9;
    const uint64_t shifted = state_[1] << 17;
    state_[2] ^= state_[0];
    state_[3] ^= state_[1];
    state_[1] ^= state_[2];
    state_[0] ^= state_[3];
    state_[2] ^= shifted;
    state_[3] = turn(state_[3], 45);
    return result;
  }
  int below(int bound) {
    return static_cast<int>(((next() >> 32) * static_cast<uint64_t>(bound)) >> 32);
  }
  uint8_t byte() { return static_cast<uint8_t>(next() >> 56); }

 private:
  static uint64_t turn(uint64_t word, int bits) { return word << bits | word >> (64 - bits); }

  uint64_t state_[4];
};

struct Sent {
  uint8_t inside[kInsideMax + 8];  // filled by eight bytes at a time
  int inside_size;
  uint8_t wire[kFrameMax];  // delimiter included
  int size;
};

struct Stream {
  uint8_t bytes[kStreamMax];
  int size = 0;
  void add(const uint8_t* data, int count) {
    memcpy(bytes + size, data, static_cast<size_t>(count));
    size += count;
  }
  void remove(int at) {
    memmove(bytes + at, bytes + at + 1, static_cast<size_t>(size - at - 1));
    --size;
  }
  void insert(int at, uint8_t byte) {
    memmove(bytes + at + 1, bytes + at, static_cast<size_t>(size - at));
    bytes[at] = byte;
    ++size;
  }
};

uint8_t payload_size(MessageType type, bool from_board) {
  return from_board ? board_payload_size(type) : host_payload_size(type);
}
int header_size(bool from_board) {
  return from_board ? setae::protocol::BoardHeader::kSize : setae::protocol::HostHeader::kSize;
}

// Any type, any bytes; in every third frame half of them zeros, in which COBS is put to work.
void make(Random& random, bool from_board, Sent& sent) {
  MessageType type;
  do {
    type = static_cast<MessageType>(from_board ? 0x80 + random.below(32) : random.below(32));
  } while (payload_size(type, from_board) == 0xFF);
  const bool sparse = random.below(3) == 0;
  for (int i = 0; i < kInsideMax; i += 8) {
    const uint64_t bytes = random.next();
    memcpy(sent.inside + i, &bytes, sizeof(bytes));
  }
  if (sparse) {
    const uint64_t zeros = random.next();
    for (int i = 0; i < kInsideMax; ++i)
      sent.inside[i] &= static_cast<uint8_t>(0 - (zeros >> i & 1));
  }
  sent.inside[0] = static_cast<uint8_t>(type);
  sent.inside_size = header_size(from_board) + payload_size(type, from_board);
  sent.size = encode_frame(sent.inside, static_cast<uint8_t>(sent.inside_size), sent.wire);
}

using Pool = std::vector<Sent>;

// Frames of either side.
bool read_pool(const char* path, Pool (&pools)[2]) {
  FILE* const file = fopen(path, "r");
  if (file == nullptr)
    return false;
  char side[8];
  char hex[4 * kFrameMax];
  while (fscanf(file, "%7s %255s", side, hex) == 2) {
    Sent sent = {};
    sent.inside_size = static_cast<int>(strlen(hex) / 2);
    for (int i = 0; i < sent.inside_size; ++i) {
      unsigned byte = 0;
      sscanf(hex + 2 * i, "%2x", &byte);
      sent.inside[i] = static_cast<uint8_t>(byte);
    }
    sent.size = encode_frame(sent.inside, static_cast<uint8_t>(sent.inside_size), sent.wire);
    pools[side[0] == 'b'].push_back(sent);
  }
  fclose(file);
  return !pools[0].empty() && !pools[1].empty();
}

// ---------------------------------------------------------------------------- patterns

void flip(Random& random, Stream& stream, int bits) {
  int done[3];
  for (int i = 0; i < bits; ++i) {
    bool again = true;
    while (again) {
      done[i] = random.below(8 * stream.size);
      again = false;
      for (int j = 0; j < i; ++j)
        again = again || done[j] == done[i];
    }
    stream.bytes[done[i] / 8] ^= static_cast<uint8_t>(1 << done[i] % 8);
  }
}

// First and last bit of 2 to 48 are wrong, those between by chance.
void burst(Random& random, Stream& stream) {
  const int length = 2 + random.below(47);
  const int first = random.below(8 * stream.size - length + 1);
  const uint64_t chance = random.next();
  for (int i = 0; i < length; ++i) {
    if (i == 0 || i == length - 1 || (chance >> i & 1) != 0)
      stream.bytes[(first + i) / 8] ^= static_cast<uint8_t>(1 << (first + i) % 8);
  }
}

// The beginning of one frame, the end of another.
void splice(Random& random, const Sent& one, const Sent& other, Stream& stream) {
  stream.size = 0;
  stream.add(one.wire, random.below(one.size));
  const int from = random.below(other.size);
  stream.add(other.wire + from, other.size - from);
}

// A byte becomes a delimiter, or the delimiter another byte: then two frames become one.
void hit_delimiter(Random& random, const Sent& other, Stream& stream) {
  if (random.below(2) == 0) {
    stream.bytes[random.below(stream.size - 1)] = 0;
    return;
  }
  stream.bytes[stream.size - 1] = static_cast<uint8_t>(1 + random.below(255));
  stream.add(other.wire, other.size);
}

constexpr const char* kPatterns[] = {
    "bits_1",       "bits_2",        "bits_3",        "burst",  "byte_lost",
    "byte_doubled", "byte_inserted", "byte_replaced", "splice", "delimiter_hit",
};
constexpr int kPatternCount = sizeof(kPatterns) / sizeof(kPatterns[0]);

void damage(Random& random, int pattern, const Sent& one, const Sent& other, Stream& stream) {
  stream.size = 0;
  stream.add(one.wire, one.size);
  const int at = random.below(stream.size);
  switch (pattern) {
    case 0:
    case 1:
    case 2:
      return flip(random, stream, pattern + 1);
    case 3:
      return burst(random, stream);
    case 4:
      if (at == stream.size - 1)  // then two frames become one
        stream.add(other.wire, other.size);
      return stream.remove(at);
    case 5:
      return stream.insert(at, stream.bytes[at]);
    case 6:
      return stream.insert(at, random.byte());
    case 7:
      stream.bytes[at] ^= static_cast<uint8_t>(1 + random.below(255));
      return;
    case 8:
      return splice(random, one, other, stream);
    default:
      return hit_delimiter(random, other, stream);
  }
}

// ----------------------------------------------------------------------------- verdict

// The sent bytes, alone between delimiters?
bool intact(const Stream& stream, const Sent& sent) {
  int from = 0;
  while (from < stream.size && stream.bytes[from] == 0)
    ++from;
  int to = stream.size;
  while (to > from && stream.bytes[to - 1] == 0)
    --to;
  return to - from == sent.size - 1 &&
         memcmp(stream.bytes + from, sent.wire, static_cast<size_t>(to - from)) == 0;
}

struct Counts {
  uint64_t damaged = 0;
  uint64_t harmless = 0;
  uint64_t undetected = 0;
};

class Trial {
 public:
  // With pools, their frames; and what the decoder makes of each stream goes to stdout.
  Trial(int pattern, uint64_t seed, const Pool (*pools)[2])
      : pattern_(pattern), random_(seed * 1000 + static_cast<uint64_t>(pattern)), pools_(pools) {}

  void run(uint64_t frames) {
    while (counts.damaged < frames) {
      const bool from_board = (counts.damaged & 1) != 0;
      choose(from_board, one_);
      choose(from_board, other_);
      if (pools_ != nullptr && random_.below(4) == 0) {
        stream_.size = 0;
        stream_.add(one_.wire, one_.size);
        judge(from_board);
        continue;
      }
      damage(random_, pattern_, one_, other_, stream_);
      if (intact(stream_, one_) || intact(stream_, other_))
        continue;
      ++counts.damaged;
      // What follows begins anew: a delimiter of its own.
      stream_.bytes[stream_.size++] = 0;
      judge(from_board);
    }
  }

  Counts counts;

 private:
  void choose(bool from_board, Sent& sent) {
    if (pools_ == nullptr)
      return make(random_, from_board, sent);
    const Pool& pool = (*pools_)[from_board];
    sent = pool[static_cast<size_t>(random_.below(static_cast<int>(pool.size())))];
  }

  void judge(bool from_board) {
    FrameDecoder& decoder = decoders_[from_board];
    uint8_t accepted[kStreamMax];
    uint8_t accepted_size = 0;
    const uint8_t damaged_before = decoder.damaged();
    for (int from = 0; from < stream_.size;) {
      bool good;
      from += decoder.take(stream_.bytes + from, static_cast<uint8_t>(stream_.size - from), good);
      if (!good)
        continue;
      const int header = header_size(from_board);
      const auto type = static_cast<MessageType>(decoder.data()[0]);
      if (decoder.size() < header || decoder.size() - header != payload_size(type, from_board)) {
        decoder.count_damaged();
        continue;
      }
      const bool sent = equals(decoder, one_) || equals(decoder, other_);
      sent ? ++counts.harmless : ++counts.undetected;
      accepted[accepted_size++] = decoder.size();
      memcpy(accepted + accepted_size, decoder.data(), decoder.size());
      accepted_size += decoder.size();
    }
    if (pools_ == nullptr)
      return;
    putchar(from_board);
    putchar(static_cast<uint8_t>(decoder.damaged() - damaged_before));
    putchar(stream_.size);
    fwrite(stream_.bytes, 1, static_cast<size_t>(stream_.size), stdout);
    putchar(accepted_size);
    fwrite(accepted, 1, accepted_size, stdout);
  }

  static bool equals(const FrameDecoder& decoder, const Sent& sent) {
    return decoder.size() == sent.inside_size &&
           memcmp(decoder.data(), sent.inside, decoder.size()) == 0;
  }

  const int pattern_;
  Random random_;
  const Pool (*const pools_)[2];
  Sent one_ = {};
  Sent other_ = {};
  Stream stream_;
  FrameDecoder decoders_[2];
};

}  // namespace

int main(int count, char** words) {
  const bool dumps = count == 6 && strcmp(words[1], "dump") == 0;
  int pattern = 0;
  while (count > 2 && pattern < kPatternCount && strcmp(kPatterns[pattern], words[2]) != 0)
    ++pattern;
  Pool pools[2];
  if ((count != 5 && !dumps) || pattern == kPatternCount ||
      (dumps && !read_pool(words[5], pools))) {
    fputs(
        "usage: damage count PATTERN FRAMES SEED | damage dump PATTERN FRAMES SEED POOL\n"
        "patterns:",
        stderr);
    for (const char* name : kPatterns)
      fprintf(stderr, " %s", name);
    fputc('\n', stderr);
    return 2;
  }
  Trial trial(pattern, strtoull(words[4], nullptr, 10), dumps ? &pools : nullptr);
  trial.run(strtoull(words[3], nullptr, 10));
  if (!dumps) {
    printf("%" PRIu64 " %" PRIu64 " %" PRIu64 "\n", trial.counts.damaged, trial.counts.harmless,
           trial.counts.undetected);
  }
  return 0;
}
