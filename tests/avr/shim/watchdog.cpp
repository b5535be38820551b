#include "watchdog.h"

extern "C" {
#include <sim_regbit.h>
}

#include <utility>

namespace setae {
namespace uno {
namespace {

constexpr uint16_t kMcusr = 0x54;
constexpr uint8_t kWatchdogReset = 1 << 3;
constexpr uint16_t kWdtcsr = 0x60;
constexpr uint8_t kFlag = 1 << 7;
constexpr uint8_t kInterrupt = 1 << 6;
constexpr uint8_t kChange = 1 << 4;
constexpr uint8_t kReset = 1 << 3;
constexpr uint8_t kPrescaler = 0x27;
constexpr Cycle kWindowCycles = 4;
// 2048 periods of 128 kHz.
constexpr Cycle kShortestCycles = 2048 * 125;

}  // namespace

Watchdog::Watchdog(Chip& chip, std::function<void()> on_bite)
    : chip_(chip), on_bite_(std::move(on_bite)), alarm_(chip, [this](Cycle) { time_out(); }) {
  chip_.on_write(kWdtcsr, [this](uint8_t value) { write_control(value); });
  // Section 11.9.1: WDE stays on as long as WDRF does.
  chip_.on_write(kMcusr, [this](uint8_t value) { chip_.set(kMcusr, value); });
}

uint8_t Watchdog::vector() const {
  return chip_.watchdog().watchdog.vector;
}

bool Watchdog::running() const {
  return (chip_.get(kWdtcsr) & (kInterrupt | kReset)) != 0;
}

Cycle Watchdog::period() const {
  const uint8_t control = chip_.get(kWdtcsr);
  return kShortestCycles << ((control & 7) | (control & 0x20) >> 2);
}

void Watchdog::reset() {
  chip_.set(kWdtcsr, chip_.get(kMcusr) & kWatchdogReset ? kReset : 0);
  open_until_ = 0;
  fed_ = chip_.cycle();
  alarm_.cancel();
  if (running())
    alarm_.set(fed_ + period());
}

void Watchdog::feed() {
  ++feeds_;
  fed_ = chip_.cycle();  // the alarm looks at it: to set that anew each time is slow
}

void Watchdog::write_control(uint8_t value) {
  const Cycle now = chip_.cycle();
  const uint8_t before = chip_.get(kWdtcsr);
  const Cycle period_before = period();
  const bool ran = running();
  uint8_t after = static_cast<uint8_t>((before & (kFlag | kPrescaler | kReset)) |
                                       (value & (kInterrupt | kReset)));
  if (value & kFlag) {
    after &= static_cast<uint8_t>(~kFlag);
    avr_clear_interrupt(chip_.avr(), &chip_.watchdog().watchdog);
  }
  if (now <= open_until_ && !(value & kChange)) {
    after =
        static_cast<uint8_t>((after & ~(kPrescaler | kReset)) | (value & (kPrescaler | kReset)));
    open_until_ = 0;
  } else if ((value & (kChange | kReset)) == (kChange | kReset)) {
    open_until_ = now + kWindowCycles;
  }
  if (chip_.get(kMcusr) & kWatchdogReset)
    after |= kReset;
  chip_.set(kWdtcsr, after);
  if (after & kFlag)
    avr_raise_interrupt(chip_.avr(), &chip_.watchdog().watchdog);
  if (!running()) {
    alarm_.cancel();
  } else if (!ran || period() != period_before) {
    if (!ran)
      fed_ = now;
    alarm_.set(fed_ + period());
  }
}

void Watchdog::time_out() {
  const Cycle due = fed_ + period();
  if (due > chip_.cycle()) {
    alarm_.set(due);
    return;
  }
  fed_ = due;
  alarm_.set(due + period());
  const uint8_t control = chip_.get(kWdtcsr);
  // An interrupt that nobody served by the next time-out: WDIE counts as cleared by the first.
  if ((control & kInterrupt) && !(control & kFlag)) {
    avr_raise_interrupt(chip_.avr(), &chip_.watchdog().watchdog);
  } else if (control & kReset) {
    on_bite_();
  }
}

void Watchdog::entered() {
  const uint8_t control = chip_.get(kWdtcsr);
  if (control & kReset)
    chip_.set(kWdtcsr, static_cast<uint8_t>(control & ~kInterrupt));
}

}  // namespace uno
}  // namespace setae
