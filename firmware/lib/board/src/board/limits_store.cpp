#include "board/limits_store.h"

#include "protocol/crc32c.h"

namespace setae {

using protocol::SetLimits;

namespace {

// Raised when the stored bytes change their meaning: those of an older firmware then count as none.
constexpr uint8_t kLayout = 1;
static_assert(SetLimits::kSize == 41, "a new layout");

}  // namespace

bool LimitsStore::load(SetLimits& limits) {
  crc_ = 0;
  for (uint8_t slot = 0; slot < 2; ++slot) {
    uint8_t bytes[kSlotBytes];
    if (!read(slot, bytes))
      continue;
    if (crc_ != 0 && static_cast<int8_t>(bytes[0] - generation_) < 0)
      continue;
    slot_ = slot;
    generation_ = bytes[0];
    crc_ = protocol::crc32c(bytes + kSlotHeaderBytes, SetLimits::kSize);
    decode(bytes + kSlotHeaderBytes, limits);
  }
  return crc_ != 0;
}

bool LimitsStore::read(uint8_t slot, uint8_t* bytes) const {
  protocol::Crc32c crc;
  for (uint8_t i = 0; i < kSlotBytes; ++i) {
    bytes[i] = hal_.eeprom_read(kSlotAt[slot] + i);
    crc.add(bytes[i]);
  }
  return crc.matched() && bytes[1] == kLayout;
}

bool LimitsStore::step(const SetLimits& limits) {
  if (!storing_ || !hal_.eeprom_ready() || hal_.bandgap_part() > kSupplyLowPart)
    return false;
  if (position_ == kSlotBytes) {
    storing_ = false;
    SetLimits unused;
    load(unused);  // what can't be read back is not stored
    return true;
  }
  // All before it is gone through again for each byte: no memory for what is needed once a year.
  constexpr uint8_t kContentBytes = kSlotBytes - protocol::kCrcBytes;
  protocol::Wire<SetLimits> wire(limits);
  protocol::Crc32c crc;
  uint8_t byte = generation_ + 1;
  for (uint8_t i = 0; i < position_;) {
    if (i < kContentBytes)
      crc.add(byte);
    ++i;
    byte = i == 1              ? kLayout
           : i < kContentBytes ? wire.bytes()[i - kSlotHeaderBytes]
                               : static_cast<uint8_t>(crc.value() >> 8 * (i - kContentBytes));
  }
  hal_.eeprom_write(kSlotAt[slot_ ^ 1] + position_, byte);
  ++position_;
  return false;
}

}  // namespace setae
