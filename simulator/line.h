// The serial line between host and board: the USB chip's delays and the time
// that each byte takes.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include <deque>
#include <limits>

namespace setae {
namespace sim {

constexpr int64_t kNever = std::numeric_limits<int64_t>::max();

struct LineSettings {
  int64_t byte_us;
  int64_t down_latency_us;
  int64_t up_flush_us;  // the chip hands bytes to the host on multiples of this; 0: at once
};

class Line {
 public:
  explicit Line(const LineSettings& settings) : settings_(settings) {}

  // Host to board. A byte is there once its stop bit has passed.
  void send(int64_t now_us, const uint8_t* data, size_t size);
  int64_t next_arrival_us() const { return down_.empty() ? kNever : down_.front().time_us; }
  uint8_t take_arrival();

  // Board to host: the board's transmitter takes one byte at a time.
  bool transmitter_free() const { return up_done_us_ == kNever; }
  void transmit(int64_t now_us, uint8_t byte);
  int64_t next_transmitted_us() const { return up_done_us_; }
  void finish_transmit();
  void abort_transmit() { up_done_us_ = kNever; }

  int64_t next_flush_us() const { return flush_us_; }
  void flush();

  // What the host can read now.
  bool host_has_bytes() const { return !host_.empty(); }
  size_t read(uint8_t* data, size_t room);

 private:
  struct Byte {
    int64_t time_us;
    uint8_t value;
  };
  LineSettings settings_;
  std::deque<Byte> down_;
  int64_t down_free_us_ = 0;
  int64_t up_done_us_ = kNever;
  uint8_t up_byte_ = 0;
  std::deque<uint8_t> chip_;
  int64_t flush_us_ = kNever;
  std::deque<uint8_t> host_;
};

}  // namespace sim
}  // namespace setae
