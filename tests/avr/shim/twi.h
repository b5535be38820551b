// The I2C master, and the bus with one slave. Data sheet section 22: bit rate, status codes,
// TWINT. Port C is here too, since a stuck bus is freed by clocking its pins by hand.
#pragma once

#include "chip.h"
#include "lps33hw.h"

namespace setae {
namespace uno {

class Twi {
 public:
  Twi(Chip& chip, Lps33hw& slave);
  void reset();
  // A slave cut off in mid-byte holds SDA until it has seen that many clocks.
  void stick(int clocks) { stuck_clocks_ = clocks; }

 private:
  enum class Operation : uint8_t { kNone, kStart, kAddress, kTransmit, kReceive, kStop };
  enum class Phase : uint8_t { kIdle, kStarted, kTransmitter, kReceiver };

  void write_control(uint8_t value);
  void begin(Operation operation, Cycle when, unsigned clocks);
  void done(Cycle when);
  void status(uint8_t code);
  void let_go();
  void port_c_changed();
  uint8_t read_pins() const;
  Cycle clock_cycles() const;

  Chip& chip_;
  Lps33hw& slave_;
  LevelInterrupt interrupt_;
  Alarm alarm_;
  Operation operation_ = Operation::kNone;
  Phase phase_ = Phase::kIdle;
  bool owned_ = false;
  bool answered_ = false;
  int stuck_clocks_ = 0;
  bool clock_low_ = false;
};

}  // namespace uno
}  // namespace setae
