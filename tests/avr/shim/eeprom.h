// The EEPROM. Data sheet section 8.4 and 8.6: the timed sequence that a write needs, 3.4 ms for it
// (1.8 ms to erase or write only), the busy bit, the halts of the core, the ready interrupt.
#pragma once

#include <vector>

#include "chip.h"

namespace setae {
namespace uno {

class Eeprom {
 public:
  explicit Eeprom(Chip& chip);
  // A write that is under way goes on.
  void reset();
  // Power goes: the byte of a write that is under way becomes `torn`.
  void cut(uint8_t torn);

  uint8_t get(uint16_t address) const { return cells_[address]; }
  void set(uint16_t address, uint8_t value) { cells_[address] = value; }
  // Bytes written since power was first there.
  uint32_t writes() const { return writes_; }

 private:
  void write_control(uint8_t value);
  void begin_write();
  void done();
  bool busy() const;
  uint16_t address() const;

  Chip& chip_;
  LevelInterrupt ready_;
  Alarm alarm_;
  std::vector<uint8_t> cells_;
  Cycle open_until_ = 0;  // of the timed sequence
  Cycle done_at_ = 0;
  uint16_t writing_at_ = 0;
  uint8_t becomes_ = 0;
  bool writing_ = false;
  uint32_t writes_ = 0;
};

}  // namespace uno
}  // namespace setae
