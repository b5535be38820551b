// The watchdog. Data sheet section 11.8 and 11.9: 128 kHz, interrupt first and reset then, the
// timed sequence that a change needs, and its being on after a reset that it caused.
#pragma once

#include "chip.h"

namespace setae {
namespace uno {

class Watchdog {
 public:
  // `on_bite` asks for a reset; it is called between two instructions.
  Watchdog(Chip& chip, std::function<void()> on_bite);
  void reset();

  // The instruction WDR.
  void feed();
  // How often that was: a main loop does it once a turn.
  uint64_t feeds() const { return feeds_; }
  uint8_t vector() const;
  // The handler of its interrupt begins.
  void entered();

 private:
  void write_control(uint8_t value);
  void time_out();
  bool running() const;
  Cycle period() const;

  Chip& chip_;
  std::function<void()> on_bite_;
  Alarm alarm_;
  Cycle fed_ = 0;
  Cycle open_until_ = 0;  // of a timed sequence
  uint64_t feeds_ = 0;
};

}  // namespace uno
}  // namespace setae
