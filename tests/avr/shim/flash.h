// Self-programming of the flash, as a bootloader does it. Data sheet section 27.
#pragma once

#include "chip.h"

namespace setae {
namespace uno {

class Flash {
 public:
  // From here on code may write the flash: the boot section of the UNO's fuses.
  static constexpr uint16_t kBootStart = 0x7E00;
  static constexpr uint16_t kPageBytes = 128;

  explicit Flash(Chip& chip);
  void reset();
  // The instruction SPM.
  void store_program_memory();
  // Pages erased and written since power-on.
  uint32_t writes() const { return writes_; }

 private:
  void write_control(uint8_t value);
  void begin(uint16_t address, bool erases);
  void clear_buffer();
  void set(uint8_t flags);

  Chip& chip_;
  Alarm alarm_;
  Cycle open_until_ = 0;
  bool busy_ = false;
  uint8_t buffer_[kPageBytes];
  bool filled_[kPageBytes / 2] = {};
  uint32_t writes_ = 0;
};

}  // namespace uno
}  // namespace setae
