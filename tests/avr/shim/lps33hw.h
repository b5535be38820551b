// The pressure sensor as an I2C slave: its register file, and samples at its rate. Data sheet of
// the LPS33HW, section 9.
#pragma once

#include <stdint.h>

#include <vector>

#include "chip.h"

namespace setae {
namespace uno {

struct PressureSample {
  Cycle ready;
  int32_t raw;
};

class Lps33hw {
 public:
  // `on_ready` gets the level of the INT_DRDY pin whenever it may have changed.
  Lps33hw(Chip& chip, std::function<void(bool level)> on_ready);

  // Power comes anew: the registers are lost.
  void power_up();
  // A reset of the board, which is none of the sensor's business, but empties simavr's alarms.
  void keep_sampling();

  // I2C, as its master's side calls it.
  bool addressed(uint8_t address, bool reading);
  void write(uint8_t value);
  uint8_t read();

  // What can be wrong with it.
  void set_present(bool present) { present_ = present; }
  void set_silent(bool silent) { silent_ = silent; }
  void set_identity(uint8_t identity) { identity_ = identity; }
  void set_address(uint8_t address) { address_ = address; }

  // Its own oscillator against the nominal 75 Hz.
  void set_rate(double relative) { rate_ = relative; }
  // The pressure from that cycle on.
  void set_pressure(Cycle from, int32_t raw);
  // When it takes the next sample; 0: it takes none.
  Cycle next_sample() const;
  // Samples that became ready.
  std::vector<PressureSample>& samples() { return samples_; }

 private:
  void clear();
  void tell_ready();
  void write_register(uint8_t reg, uint8_t value);
  uint8_t read_register(uint8_t reg);
  void sample(Cycle when);
  void show(int32_t raw);

  Chip& chip_;
  std::function<void(bool)> on_ready_;
  Alarm next_sample_;
  uint8_t address_ = 0x5D;
  uint8_t identity_ = 0xB1;
  bool present_ = true;
  bool silent_ = false;
  double rate_ = 1.0;

  uint8_t registers_[128] = {};
  uint8_t pointer_ = 0;
  bool pointer_next_ = false;
  bool locked_ = false;  // BDU: the low byte was read, the high one not yet
  bool held_back_ = false;
  int32_t held_raw_ = 0;
  double due_ = 0;

  int32_t raw_ = 0;
  int32_t last_raw_ = 0;
  std::vector<PressureSample> pending_;  // pressures to come, in order
  std::vector<PressureSample> samples_;
};

}  // namespace uno
}  // namespace setae
