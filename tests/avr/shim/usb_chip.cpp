#include "usb_chip.h"

namespace setae {
namespace uno {
namespace {

constexpr Cycle kCyclesPerMs = 16000;
constexpr Cycle kDownCycles = kCyclesPerMs;
constexpr Cycle kFlushCycles = 4 * kCyclesPerMs;
constexpr size_t kPacketBytes = 64;

}  // namespace

UsbChip::UsbChip(Chip& chip) : chip_(chip), alarm_(chip, [this](Cycle when) { flush(when); }) {}

void UsbChip::reset() {
  if (!held_.empty())
    alarm_.set(flush_at_);
}

Cycle UsbChip::down_cycles() const {
  return present_ ? kDownCycles : 0;
}

void UsbChip::from_board(const LineByte& byte) {
  if (!present_) {
    for_host_.push_back(byte);
    return;
  }
  held_.push_back(byte.value);
  if (held_.size() == kPacketBytes) {
    alarm_.cancel();
    flush(byte.end);
  } else if (held_.size() == 1) {
    flush_at_ = (byte.end / kFlushCycles + 1) * kFlushCycles;
    alarm_.set(flush_at_);
  }
}

void UsbChip::flush(Cycle when) {
  for (const uint8_t value : held_)
    for_host_.push_back({when, value});
  held_.clear();
}

}  // namespace uno
}  // namespace setae
