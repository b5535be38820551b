// The 16U2 between USART and host, where it is switched on: what the host sends comes 1 ms later;
// what the board sends is held until the chip's 4 ms come round, or until 64 bytes are there.
#pragma once

#include <deque>
#include <vector>

#include "chip.h"

namespace setae {
namespace uno {

struct LineByte {
  Cycle end;  // of its stop bit, or when the host could read it
  uint8_t value;
};

class UsbChip {
 public:
  explicit UsbChip(Chip& chip);
  // A reset of the board, which is none of the chip's business, but empties simavr's alarms.
  void reset();

  void set_present(bool present) { present_ = present; }
  bool present() const { return present_; }
  // From the host's call to the first start bit.
  Cycle down_cycles() const;
  void from_board(const LineByte& byte);
  std::deque<LineByte>& for_host() { return for_host_; }

 private:
  void flush(Cycle when);

  Chip& chip_;
  Alarm alarm_;
  bool present_ = false;
  Cycle flush_at_ = 0;
  std::vector<uint8_t> held_;
  std::deque<LineByte> for_host_;
};

}  // namespace uno
}  // namespace setae
