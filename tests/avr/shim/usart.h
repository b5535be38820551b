// USART0 and the line to it. Data sheet section 20: frames of exactly 10 bits, two receive
// buffers and a shift register, overrun and frame error.
#pragma once

#include <deque>

#include "chip.h"
#include "usb_chip.h"

namespace setae {
namespace uno {

class Usart {
 public:
  Usart(Chip& chip, UsbChip& usb);
  void reset();

  // Puts a byte on the line to the board as soon as that is free, not before `earliest`.
  void send(uint8_t value, Cycle earliest, double bit_cycles);

  // When the line to the board is free again.
  Cycle line_free() const { return static_cast<Cycle>(line_free_ + 0.5); }

  uint32_t overruns() const { return overruns_; }
  uint32_t frame_errors() const { return frame_errors_; }
  // Cycles from a byte's arrival to its being read, at worst.
  Cycle longest_wait() const { return longest_wait_; }
  void clear_longest_wait() { longest_wait_ = 0; }

 private:
  struct Incoming {
    uint8_t value;
    double start;
    double bit_cycles;
  };
  struct Received {
    uint8_t value;
    bool frame_error;
    bool overrun;
    Cycle at;
  };

  void expect_next();
  void start_bit();
  void stop_bit(Cycle when);
  void shift_out(Cycle when);
  void show_received();
  uint8_t read_data();
  void write_data(uint8_t value);
  void write_control_b(uint8_t value);
  Cycle bit_cycles() const;

  Chip& chip_;
  UsbChip& usb_;
  LevelInterrupt receive_complete_;
  LevelInterrupt data_empty_;
  Alarm receive_;
  Alarm transmit_;

  std::deque<Incoming> line_;
  double line_free_ = 0;
  bool in_frame_ = false;
  std::deque<Received> buffer_;  // two at most
  bool shift_full_ = false;
  Received shift_ = {};
  bool lost_ = false;

  bool transmitting_ = false;
  bool waiting_ = false;
  uint8_t shifting_ = 0;
  uint8_t next_ = 0;

  uint32_t overruns_ = 0;
  uint32_t frame_errors_ = 0;
  Cycle longest_wait_ = 0;
};

}  // namespace uno
}  // namespace setae
