// The timers in normal mode; timer 1's and timer 2's compare outputs are on the four servo pins.
// Data sheet sections 15 to 18: prescaler hold, the 16-bit registers' TEMP, output latches, force
// compare.
#pragma once

#include <functional>

#include "chip.h"

namespace setae {
namespace uno {

enum class Unit : uint8_t { kA, kB };

// Level of an output, and the cycle of the edge.
using OnOutput = std::function<void(Cycle when)>;

class Timer {
 public:
  // The timers differ in width, addresses, prescaler taps and where force compare is.
  struct Kind {
    int number;
    uint32_t modulus;
    uint16_t tccra, tccrb, force, tcnt, ocra, ocrb, tifr, timsk;
    uint8_t shifts[8];  // log2 of the divider for each clock select; 0xFF stops
    uint8_t hold;       // its bit in GTCCR
  };
  static const Kind kTimer0;
  static const Kind kTimer1;
  static const Kind kTimer2;

  Timer(Chip& chip, const Kind& kind, OnOutput on_output);
  void reset();

  bool connected(Unit unit) const;
  bool latch(Unit unit) const { return units_[static_cast<int>(unit)].latch; }
  // The last cycle at which the counter became that. Only while it runs.
  Cycle was_at(uint32_t value) const;
  // GTCCR was written.
  void hold(uint8_t gtccr);
  // A pin was driven by a timer in a mode that is not modelled here.
  bool misused() const { return misused_; }

 private:
  struct Compare {
    Compare(Chip& chip, std::function<void(Cycle)> action) : alarm(chip, action) {}
    uint32_t value = 0;
    bool latch = false;
    Alarm alarm;
  };

  bool wide() const { return kind_.modulus > 256; }
  bool running() const { return shift_ != kStopped && !held_ && normal_; }
  uint64_t tick(Cycle when) const { return (when - origin_) >> shift_; }
  uint32_t count(Cycle when) const;
  // How often the counter has passed its top since it was last set.
  uint64_t wraps(Cycle when) const;
  void rebase(Cycle when, uint32_t count);
  bool overflowed() const { return overflowed_ || wraps(chip_.cycle()) > wraps_cleared_; }
  void schedule(int unit, bool skip_present = false);
  void schedule_all(bool skip_present = false);
  void match(int unit, Cycle when);
  void act(int unit, Cycle when);
  uint8_t mode_of_output(int unit) const;
  void on_control(uint16_t address, uint8_t value);
  void read_write_16(uint16_t low, std::function<uint32_t()> read,
                     std::function<void(uint32_t)> write, bool temp_at_read);

  static constexpr uint8_t kStopped = 0xFF;

  Chip& chip_;
  const Kind& kind_;
  OnOutput on_output_;
  Compare units_[2];
  avr_int_vector_t* vectors_[2];
  Cycle origin_ = 0;  // when the prescaler was at 0
  uint64_t base_tick_ = 0;
  uint32_t base_count_ = 0;
  uint64_t wraps_cleared_ = 0;
  bool overflowed_ = false;  // before the counter was last set
  uint8_t shift_ = kStopped;
  bool held_ = false;
  bool normal_ = true;
  bool misused_ = false;
  uint8_t temp_ = 0;
};

}  // namespace uno
}  // namespace setae
