#include "hal_uno/twi.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>
#include <util/delay.h>
#include <util/twi.h>

#include "hal_uno/servo_pulses.h"

namespace setae {
namespace {

constexpr uint32_t kClockHz = 400000;
constexpr uint8_t kBitRate = (F_CPU / kClockHz - 16) / 2;  // data sheet section 22.5.2
static_assert(F_CPU / (16 + 2UL * kBitRate) <= kClockHz, "faster than the sensor allows");

// The longest transfer has 8 bytes: 0.18 ms, and other handlers' time.
constexpr uint16_t kDeadlineTicks = 2000;  // 1 ms

constexpr uint8_t kGo = _BV(TWINT) | _BV(TWEN) | _BV(TWIE);

Twi* served = nullptr;

}  // namespace

void Twi::begin() {
  // Weak pull-ups, so that a bus with nothing on it reads as idle: then no answer means no
  // sensor.
  PORTC |= _BV(PORTC4) | _BV(PORTC5);
  served = this;
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

void Twi::prepare_polling(uint8_t address, uint8_t reg, uint8_t bits, uint8_t most) {
  prepare(address, reg, kReadMax, true);
  bits_ = bits;
  tries_ = most;
  misses_ = 0;
  found_ = false;
}

void Twi::go() {
  begun_ticks_ = TCNT1;
  begun_ = true;
  told_ = false;
  result_ = Result::kBusy;
  TWCR = kGo | _BV(TWSTA);
}

void Twi::prepare(uint8_t address, uint8_t reg, uint8_t size, bool reading) {
  address_ = address;
  reg_ = reg;
  size_ = size;
  reading_ = reading;
  moved_ = 0;
  reg_sent_ = false;
  tries_ = 0;
}

void Twi::start(uint8_t address, uint8_t reg, uint8_t size, bool reading) {
  prepare(address, reg, size, reading);
  begun_ = false;
  told_ = false;
  seen_ = false;  // a sensor that is set up anew may show another value without having measured
  result_ = Result::kBusy;
  begun_ticks_ = servo_pulses::ticks();
  begin_transfer();
}

void Twi::begin_transfer() {
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {  // all that the handler reads is written before
    if ((TWCR & _BV(TWSTO)) == 0) {    // the last transfer's STOP is out
      TWCR = kGo | _BV(TWSTA);
      begun_ = true;
      begun_ticks_ = servo_pulses::ticks();
    }
  }
}

Twi::Result Twi::poll() {
  if (told_)
    return Result::kIdle;
  // First what came, then the time: the loop may be late.
  Result result = result_;
  if (result == Result::kBusy) {
    if (!begun_)
      begin_transfer();
    uint16_t elapsed;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
      elapsed = TCNT1 - begun_ticks_;
    }
    if (elapsed <= kDeadlineTicks)
      return result;
    result_ = result = Result::kFailed;
  }
  told_ = true;
  asm volatile("" ::: "memory");  // all that the handler wrote is read after
  if (result == Result::kFailed)
    recover();
  return result;
}

// Whether to read once more: no sample yet.
bool Twi::again() {
  if (tries_ == 0)
    return false;
  // A sample that comes between the status and the value is told by the value alone.
  const bool changed = data_[1] != last_[0] || data_[2] != last_[1] || data_[3] != last_[2];
  if ((data_[0] & bits_) != 0 || (changed && seen_)) {
    seen_ = true;
    last_[0] = data_[1];
    last_[1] = data_[2];
    last_[2] = data_[3];
    found_ = true;
    return false;
  }
  ++misses_;
  if (--tries_ == 0)
    return false;
  moved_ = 0;
  reg_sent_ = false;
  begun_ticks_ = TCNT1;
  return true;
}

// Data sheet section 22.7.
void Twi::advance() {
  switch (TW_STATUS) {
    case TW_START:
    case TW_REP_START:
      TWDR = static_cast<uint8_t>(address_ << 1) | (reg_sent_ ? TW_READ : TW_WRITE);
      TWCR = kGo;
      return;
    case TW_MT_SLA_ACK:
      TWDR = reg_;
      TWCR = kGo;
      return;
    case TW_MT_DATA_ACK:
      if (!reg_sent_ && reading_) {
        reg_sent_ = true;
        TWCR = kGo | _BV(TWSTA);
        return;
      }
      reg_sent_ = true;
      if (moved_ == size_)
        return finish(Result::kDone);
      TWDR = data_[moved_++];
      TWCR = kGo;
      return;
    case TW_MR_SLA_ACK:
      TWCR = size_ > 1 ? kGo | _BV(TWEA) : kGo;
      return;
    case TW_MR_DATA_ACK:
      data_[moved_++] = TWDR;
      TWCR = moved_ + 1 < size_ ? kGo | _BV(TWEA) : kGo;
      return;
    case TW_MR_DATA_NACK:
      data_[moved_++] = TWDR;
      if (again()) {
        TWCR = kGo | _BV(TWSTA);
        return;
      }
      return finish(Result::kDone);
    case TW_MT_SLA_NACK:
    case TW_MR_SLA_NACK:
      return finish(Result::kNoAck);
    default:
      return finish(Result::kFailed);
  }
}

void Twi::finish(Result result) {
  // No more interrupts until the next START; recover() takes a failed bus apart.
  TWCR = result == Result::kFailed ? 0 : _BV(TWINT) | _BV(TWEN) | _BV(TWSTO);
  result_ = result;
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

ISR(TWI_vect) {
  setae::served->advance();
}
