#include "hal_uno/twi.h"

#include <avr/io.h>
#include <util/delay.h>
#include <util/twi.h>

#include "hal_uno/servo_pulses.h"

namespace setae {
namespace {

constexpr uint32_t kClockHz = 400000;
constexpr uint8_t kBitRate = (F_CPU / kClockHz - 16) / 2;  // data sheet section 21.5.2
static_assert(F_CPU / (16 + 2UL * kBitRate) <= kClockHz, "faster than the sensor allows");

// For one step on the bus: a byte takes 23 us. Not for a whole transfer, which lasts as long as
// the loop has other things to do between its steps.
constexpr uint16_t kDeadlineTicks = 2000;  // 1 ms

constexpr uint8_t kGo = _BV(TWINT) | _BV(TWEN);

}  // namespace

void Twi::begin() {
  // Weak pull-ups, so that a bus with nothing on it reads as idle: then no answer means no
  // sensor.
  PORTC |= _BV(PORTC4) | _BV(PORTC5);
  TWSR = 0;
  TWBR = kBitRate;
  TWCR = _BV(TWEN);
}

void Twi::start_write(uint8_t address, uint8_t reg, uint8_t value) {
  data_[0] = value;
  start(address, reg, 1, false);
}

void Twi::start_read(uint8_t address, uint8_t reg, uint8_t size) {
  start(address, reg, size, true);
}

void Twi::start(uint8_t address, uint8_t reg, uint8_t size, bool reading) {
  address_ = address;
  reg_ = reg;
  size_ = size;
  reading_ = reading;
  moved_ = 0;
  reg_sent_ = false;
  begun_ = false;
  running_ = true;
  step_ticks_ = servo_pulses::ticks();
}

Twi::Result Twi::poll() {
  if (!running_)
    return Result::kIdle;
  const uint16_t now_ticks = servo_pulses::ticks();
  if (!begun_ && (TWCR & _BV(TWSTO)) == 0) {  // the last transfer's STOP is out
    TWCR = kGo | _BV(TWSTA);
    begun_ = true;
    step_ticks_ = now_ticks;
  } else if (begun_ && (TWCR & _BV(TWINT))) {
    step_ticks_ = now_ticks;
    return advance(TW_STATUS);
  } else if (static_cast<uint16_t>(now_ticks - step_ticks_) > kDeadlineTicks) {
    return finish(Result::kFailed);
  }
  return Result::kBusy;
}

// Data sheet section 21.7, tables 21-3 and 21-4.
Twi::Result Twi::advance(uint8_t status) {
  switch (status) {
    case TW_START:
      TWDR = static_cast<uint8_t>(address_ << 1) | TW_WRITE;
      TWCR = kGo;
      return Result::kBusy;
    case TW_REP_START:
      TWDR = static_cast<uint8_t>(address_ << 1) | TW_READ;
      TWCR = kGo;
      return Result::kBusy;
    case TW_MT_SLA_ACK:
      TWDR = reg_;
      TWCR = kGo;
      return Result::kBusy;
    case TW_MT_DATA_ACK:
      if (!reg_sent_ && reading_) {
        reg_sent_ = true;
        TWCR = kGo | _BV(TWSTA);
        return Result::kBusy;
      }
      reg_sent_ = true;
      if (moved_ == size_)
        return finish(Result::kDone);
      TWDR = data_[moved_++];
      TWCR = kGo;
      return Result::kBusy;
    case TW_MR_SLA_ACK:
      TWCR = size_ > 1 ? kGo | _BV(TWEA) : kGo;
      return Result::kBusy;
    case TW_MR_DATA_ACK:
      data_[moved_++] = TWDR;
      TWCR = moved_ + 1 < size_ ? kGo | _BV(TWEA) : kGo;
      return Result::kBusy;
    case TW_MR_DATA_NACK:
      data_[moved_++] = TWDR;
      return finish(Result::kDone);
    case TW_MT_SLA_NACK:
    case TW_MR_SLA_NACK:
      return finish(Result::kNoAck);
    default:
      return finish(Result::kFailed);
  }
}

Twi::Result Twi::finish(Result result) {
  running_ = false;
  if (result == Result::kFailed) {
    recover();
  } else {
    TWCR = kGo | _BV(TWSTO);
  }
  return result;
}

void Twi::recover() {
  constexpr uint8_t kSda = _BV(PORTC4);
  constexpr uint8_t kScl = _BV(PORTC5);
  TWCR = 0;
  // Open drain by hand: low is an output of 0, high the pull-up of an input.
  for (uint8_t i = 0; i < 9 && (PINC & kSda) == 0; ++i) {
    PORTC &= static_cast<uint8_t>(~kScl);
    DDRC |= kScl;
    _delay_us(5);
    DDRC &= static_cast<uint8_t>(~kScl);
    PORTC |= kScl;
    _delay_us(5);
  }
  // STOP: SDA rises while SCL is high.
  PORTC &= static_cast<uint8_t>(~kSda);
  DDRC |= kSda;
  _delay_us(5);
  DDRC &= static_cast<uint8_t>(~kSda);
  PORTC |= kSda;
  begin();
}

}  // namespace setae
