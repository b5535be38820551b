#include "timers.h"

extern "C" {
#include <sim_regbit.h>
}

#include <utility>

namespace setae {
namespace uno {
namespace {

constexpr uint8_t kHoldAll = 0x80;  // TSM
constexpr uint8_t kWaveformBitsA = 0x03;
constexpr uint8_t kOverflow = 1 << 0;  // TOV

}  // namespace

const Timer::Kind Timer::kTimer0 = {0,
                                    0x100,
                                    0x44,
                                    0x45,
                                    0x45,
                                    0x46,
                                    0x47,
                                    0x48,
                                    0x35,
                                    0x6E,
                                    // Section 15.9, TCCR0B; 6 and 7 are an external clock.
                                    {0xFF, 0, 3, 6, 8, 10, 0xFF, 0xFF},
                                    1 << 0};
const Timer::Kind Timer::kTimer1 = {1,
                                    0x10000,
                                    0x80,
                                    0x81,
                                    0x82,
                                    0x84,
                                    0x88,
                                    0x8A,
                                    0x36,
                                    0x6F,
                                    // Section 16.11, TCCR1B; 6 and 7 are an external clock.
                                    {0xFF, 0, 3, 6, 8, 10, 0xFF, 0xFF},
                                    1 << 0};
const Timer::Kind Timer::kTimer2 = {2,
                                    0x100,
                                    0xB0,
                                    0xB1,
                                    0xB1,
                                    0xB2,
                                    0xB3,
                                    0xB4,
                                    0x37,
                                    0x70,
                                    // Section 18.11, TCCR2B.
                                    {0xFF, 0, 3, 5, 6, 7, 8, 10},
                                    1 << 1};

Timer::Timer(Chip& chip, const Kind& kind, OnOutput on_output)
    : chip_(chip),
      kind_(kind),
      on_output_(std::move(on_output)),
      units_{{chip, [this](Cycle when) { match(0, when); }},
             {chip, [this](Cycle when) { match(1, when); }}},
      vectors_{&chip.timer(kind.number).comp[0].interrupt,
               &chip.timer(kind.number).comp[1].interrupt} {
  for (const uint16_t control : {kind_.tccra, kind_.tccrb, kind_.force})
    chip_.on_write(control, [this, control](uint8_t value) { on_control(control, value); });
  read_write_16(
      kind_.tcnt, [this] { return count(chip_.cycle()); },
      [this](uint32_t value) {
        overflowed_ = overflowed();
        rebase(chip_.cycle(), value);
        // Section 16.7.2: writing the counter suppresses a match at the next clock.
        schedule_all(true);
      },
      true);
  for (int unit = 0; unit < 2; ++unit) {
    read_write_16(
        unit == 0 ? kind_.ocra : kind_.ocrb, [this, unit] { return units_[unit].value; },
        [this, unit](uint32_t value) {
          units_[unit].value = value;
          schedule(unit);
        },
        false);
  }
  // Section 16.9.1: set as the counter becomes 0; looked for when it is read, as no interrupt is
  // made of it here.
  chip_.on_read(kind_.tifr, [this] {
    const uint8_t others = chip_.get(kind_.tifr) & static_cast<uint8_t>(~kOverflow);
    return static_cast<uint8_t>(others | (overflowed() ? kOverflow : 0));
  });
  chip_.on_write(kind_.tifr, [this](uint8_t value) {
    if (value & kOverflow) {
      overflowed_ = false;
      wraps_cleared_ = wraps(chip_.cycle());
    }
    for (avr_int_vector_t* vector : vectors_) {
      if ((value >> vector->raised.bit) & 1) {
        avr_clear_interrupt(chip_.avr(), vector);
        avr_regbit_clear(chip_.avr(), vector->raised);
      }
    }
  });
  chip_.on_write(kind_.timsk, [this](uint8_t value) {
    chip_.set(kind_.timsk, value);
    for (avr_int_vector_t* vector : vectors_) {
      if (avr_regbit_get(chip_.avr(), vector->raised))
        avr_raise_interrupt(chip_.avr(), vector);
    }
  });
}

// Sections 16.3 (TEMP: one for all 16-bit registers of the timer; a high byte is written first
// and read last) and 18 (8 bits, none of that).
void Timer::read_write_16(uint16_t low, std::function<uint32_t()> read,
                          std::function<void(uint32_t)> write, bool temp_at_read) {
  if (!wide()) {
    chip_.on_read(low, [read] { return static_cast<uint8_t>(read()); });
    chip_.on_write(low, [write](uint8_t value) { write(value); });
    return;
  }
  const uint16_t high = static_cast<uint16_t>(low + 1);
  chip_.on_read(low, [this, read, temp_at_read] {
    const uint32_t value = read();
    if (temp_at_read)
      temp_ = static_cast<uint8_t>(value >> 8);
    return static_cast<uint8_t>(value);
  });
  chip_.on_read(high, [this, read, temp_at_read] {
    return temp_at_read ? temp_ : static_cast<uint8_t>(read() >> 8);
  });
  chip_.on_write(high, [this](uint8_t value) { temp_ = value; });
  chip_.on_write(
      low, [this, write](uint8_t value) { write(static_cast<uint32_t>(temp_ << 8 | value)); });
}

void Timer::reset() {
  for (Compare& unit : units_) {
    unit.alarm.cancel();
    unit.value = 0;
    unit.latch = false;
  }
  for (const uint16_t address : {kind_.tccra, kind_.tccrb, kind_.tifr, kind_.timsk})
    chip_.set(address, 0);
  origin_ = chip_.cycle();
  shift_ = kStopped;
  held_ = false;
  normal_ = true;
  base_count_ = 0;
  base_tick_ = 0;
  wraps_cleared_ = 0;
  overflowed_ = false;
  temp_ = 0;
}

uint32_t Timer::count(Cycle when) const {
  if (!running())
    return base_count_;
  return static_cast<uint32_t>(base_count_ + (tick(when) - base_tick_)) % kind_.modulus;
}

uint64_t Timer::wraps(Cycle when) const {
  return running() ? (base_count_ + (tick(when) - base_tick_)) / kind_.modulus : 0;
}

Cycle Timer::was_at(uint32_t value) const {
  const Cycle now = chip_.cycle();
  const uint32_t back = (count(now) + kind_.modulus - value) % kind_.modulus;
  return origin_ + ((tick(now) - back) << shift_);
}

void Timer::rebase(Cycle when, uint32_t count) {
  base_count_ = count;
  wraps_cleared_ = 0;
  base_tick_ = shift_ == kStopped ? 0 : tick(when);
}

// Section 16.10: flag and output change at the timer clock that takes the counter past the match.
void Timer::schedule(int unit, bool skip_present) {
  Compare& compare = units_[unit];
  if (!running()) {
    compare.alarm.cancel();
    return;
  }
  const Cycle now = chip_.cycle();
  uint32_t ahead = (compare.value + kind_.modulus - count(now)) % kind_.modulus;
  if (ahead == 0 && skip_present)
    ahead = kind_.modulus;
  compare.alarm.set(origin_ + ((tick(now) + ahead + 1) << shift_));
}

void Timer::schedule_all(bool skip_present) {
  schedule(0, skip_present);
  schedule(1, skip_present);
}

void Timer::match(int unit, Cycle when) {
  avr_raise_interrupt(chip_.avr(), vectors_[unit]);
  act(unit, when);
  units_[unit].alarm.set(when + (static_cast<Cycle>(kind_.modulus) << shift_));
}

uint8_t Timer::mode_of_output(int unit) const {
  return (chip_.get(kind_.tccra) >> (unit == 0 ? 6 : 4)) & 3;
}

bool Timer::connected(Unit unit) const {
  return mode_of_output(static_cast<int>(unit)) != 0;
}

// Section 16.11, TCCR1A: toggle, clear, set.
void Timer::act(int unit, Cycle when) {
  bool& latch = units_[unit].latch;
  switch (mode_of_output(unit)) {
    case 1:
      latch = !latch;
      break;
    case 2:
      latch = false;
      break;
    case 3:
      latch = true;
      break;
    default:
      return;
  }
  on_output_(when);
}

void Timer::on_control(uint16_t address, uint8_t value) {
  const Cycle now = chip_.cycle();
  const uint32_t reached = count(now);
  overflowed_ = overflowed();
  uint8_t forced = 0;
  if (address == kind_.force) {
    forced = value & 0xC0;  // strobes: they read as 0
    value &= 0x3F;
  }
  chip_.set(address, value);
  // WGM bits: two in A, one (timer 2) or two (timer 1) in B.
  const uint8_t waveform_b = chip_.get(kind_.tccrb) & (wide() ? 0x18 : 0x08);
  const bool was_running = running();
  const uint8_t shift_before = shift_;
  normal_ = (chip_.get(kind_.tccra) & kWaveformBitsA) == 0 && waveform_b == 0;
  shift_ = kind_.shifts[chip_.get(kind_.tccrb) & 7];
  misused_ = misused_ || (!normal_ && (chip_.get(kind_.tccra) & 0xF0) != 0);
  if (running() != was_running || shift_ != shift_before) {
    rebase(now, reached);
    schedule_all();
  }
  if (forced & 0x80)
    act(0, now);
  if (forced & 0x40)
    act(1, now);
  if (address == kind_.tccra)
    on_output_(now);
}

// Section 17.4.1: while TSM is set the prescaler stays at 0; without it the bit resets it once.
void Timer::hold(uint8_t gtccr) {
  const Cycle now = chip_.cycle();
  const uint32_t reached = count(now);
  overflowed_ = overflowed();
  const bool hold_now = (gtccr & kHoldAll) && (gtccr & kind_.hold);
  if (held_ && !hold_now) {
    held_ = false;
    origin_ = now;
  } else if (hold_now) {
    held_ = true;
  } else if (gtccr & kind_.hold) {
    origin_ = now;
  } else {
    return;
  }
  rebase(now, reached);
  schedule_all();
}

}  // namespace uno
}  // namespace setae
