// The limits in EEPROM: two slots, of which the newer whole one counts, so that a power cut
// between any two bytes leaves the old limits or the new ones.
#pragma once

#include <stdint.h>

#include "hal/hal.h"

namespace setae {

// 16 MHz needs 3.8 V (data sheet, section 28.3); good again only with some room. A larger part of
// the supply is a lower supply.
constexpr uint16_t kSupplyLowMv = 3800;
constexpr uint16_t kSupplyLowPart = supply_mv(kSupplyLowMv);
constexpr uint16_t kSupplyGoodPart = supply_mv(4000);

// Where the slots begin, and how much of each is used. Address 0 stays free: it is the one that a
// failing supply is known to corrupt.
constexpr uint16_t kSlotAt[2] = {32, 96};
constexpr uint8_t kSlotHeaderBytes = 2;  // generation, layout
constexpr uint8_t kSlotBytes = kSlotHeaderBytes + protocol::SetLimits::kSize + protocol::kCrcBytes;

class LimitsStore {
 public:
  explicit constexpr LimitsStore(HalRef hal) : hal_(hal) {}

  // False, and `limits` as they were, where none are stored.
  bool load(protocol::SetLimits& limits);

  // Begins to write; step() does the rest.
  void start() {
    storing_ = true;
    position_ = 0;
  }
  // The slot that was begun is not whole, hence nothing.
  void cancel() { storing_ = false; }
  bool storing() const { return storing_; }
  // Writes a byte, if it is time. To be called where a write is allowed, with the same limits
  // from start() on. True where this ended it.
  bool step(const protocol::SetLimits& limits);

  // Of the stored limits, as a payload; 0 where there are none.
  uint32_t crc() const { return crc_; }

 private:
  bool read(uint8_t slot, uint8_t* bytes) const;

  HalRef hal_;
  uint32_t crc_ = 0;
  uint8_t slot_ = 0;
  uint8_t generation_ = 0;
  bool storing_ = false;
  uint8_t position_ = 0;
};

}  // namespace setae
