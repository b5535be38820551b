#include "hal_uno/lps33hw.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

#include "hal_uno/servo_pulses.h"

namespace setae {

using protocol::Sensor;

namespace {

// Data sheet section 9.
constexpr uint8_t kWhoAmI = 0x0F;
constexpr uint8_t kIdentity = 0xB1;
constexpr uint8_t kCtrlReg1 = 0x10;
constexpr uint8_t kRate75Hz = 5 << 4;
constexpr uint8_t kBlockDataUpdate = 1 << 1;  // the three bytes are of one sample
constexpr uint8_t kCtrlReg2 = 0x11;
constexpr uint8_t kSoftwareReset = 1 << 2;
constexpr uint8_t kAutoIncrement = 1 << 4;
constexpr uint8_t kCtrlReg3 = 0x12;
constexpr uint8_t kDataReadyOut = 1 << 2;  // INT_DRDY is high from a sample until it is read
constexpr uint8_t kStatusRegister = 0x27;  // PRESS_OUT follows, the high byte last
constexpr uint8_t kPressureReady = 1 << 0;

constexpr uint8_t kRetryFrames = 5;
constexpr uint8_t kSilentFrames = 5;

// Timer0 ticks of 16 us. 75 Hz is 13.3 ms, 12.9 with a fast oscillator.
constexpr uint16_t kEarliestWait = 12000 / 16;
constexpr uint16_t kLatestWait = 14000 / 16;
// With D2 wired the timer only steps in where an edge was missed.
constexpr uint16_t kWiredWait = 16000 / 16;
// Each look that comes to nothing takes so long. One of them shows that the sample was not late.
constexpr uint8_t kLookTicks = 16;
constexpr uint8_t kWaitStep = 4;
constexpr uint8_t kLooksMax = 12;

constexpr uint8_t kSoonestMatch = 2;
constexpr uint8_t kTimerTicks = 32;     // of 0.5 us each
constexpr uint16_t kStatusTicks = 240;  // a read's start to its look at the status

Lps33hw* served = nullptr;
uint8_t rounds_left;  // of Timer0, 4.1 ms each

constexpr uint8_t kTimerOn = _BV(OCIE0A);

// Timer0 matches once in 256 ticks. One that is due now, or at the next tick, would come a whole
// turn too soon or too late.
void start_timer(uint16_t ticks) {
  uint8_t first = static_cast<uint8_t>(ticks);
  if (first < kSoonestMatch)
    first = kSoonestMatch;
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    rounds_left = static_cast<uint8_t>(ticks >> 8);
    OCR0A = static_cast<uint8_t>(TCNT0 + first);
    TIFR0 = _BV(OCF0A);
    TIMSK0 |= kTimerOn;
  }
}

void stop_handlers() {
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {  // unit B is the servos'
    TIMSK0 &= static_cast<uint8_t>(~kTimerOn);
  }
  EIMSK = 0;
}

bool data_ready_pin() {
  return (PIND & _BV(PIND2)) != 0;
}

}  // namespace

void Lps33hw::begin() {
  served = this;
  // Weakly up: high for ever where nothing is wired.
  PORTD |= _BV(PORTD2);
  EICRA = _BV(ISC01) | _BV(ISC00);  // rising
  stop_handlers();
  twi_.begin();
}

void Lps33hw::fetch(bool by_timer) {
  stop_handlers();
  by_timer_ = by_timer;
  twi_.go();
}

SensorReading Lps33hw::poll() {
  SensorReading reading = {status_, false, 0, {0, 0}};
  switch (twi_.poll()) {
    case Twi::Result::kBusy:
      break;
    case Twi::Result::kNoAck:
      address_ ^= 1;
      fail(Sensor::kAbsent);
      break;
    case Twi::Result::kFailed:
      fail(Sensor::kBus);
      break;
    case Twi::Result::kIdle:
      if (step_ == Step::kPause && servo_pulses::frame_number() - since_frame_ >= kRetryFrames) {
        step_ = Step::kIdentify;
        twi_.start_read(address_, kWhoAmI, 1);
      }
      break;
    case Twi::Result::kDone:
      on_done(reading);
      break;
  }
  reading.status = status_;
  return reading;
}

void Lps33hw::on_done(SensorReading& reading) {
  switch (step_) {
    case Step::kIdentify:
      if (twi_.data()[0] != kIdentity)
        return fail(Sensor::kWrong);
      step_ = Step::kReset;
      return twi_.start_write(address_, kCtrlReg2, kSoftwareReset | kAutoIncrement);
    case Step::kReset:
      step_ = Step::kSetAddressing;
      return twi_.start_write(address_, kCtrlReg2, kAutoIncrement);
    case Step::kSetAddressing:
      step_ = Step::kSetDataReady;
      return twi_.start_write(address_, kCtrlReg3, kDataReadyOut);
    case Step::kSetDataReady:
      step_ = Step::kSetRate;
      return twi_.start_write(address_, kCtrlReg1, kRate75Hz | kBlockDataUpdate);
    case Step::kSetRate:
      status_ = Sensor::kOk;
      step_ = Step::kRun;
      running_ = true;
      since_frame_ = servo_pulses::frame_number();
      wait_ = kEarliestWait;
      return expect_next(0);
    case Step::kRun:
      return take_sample(reading);
    default:
      return fail(Sensor::kBus);
  }
}

void Lps33hw::take_sample(SensorReading& reading) {
  const uint8_t* data = twi_.data();
  const uint16_t begun_ticks = twi_.begun_ticks();
  if (twi_.found()) {
    const uint8_t sign = (data[3] & 0x80) != 0 ? 0xFF : 0;  // of 24 bits
    const uint32_t raw = static_cast<uint32_t>(sign) << 24 | static_cast<uint32_t>(data[3]) << 16 |
                         static_cast<uint16_t>(data[2]) << 8 | data[1];
    reading.fresh = true;
    reading.pressure_raw = static_cast<int32_t>(raw);
    reading.sampled = servo_pulses::at(static_cast<uint16_t>(begun_ticks + kStatusTicks));
    since_frame_ = servo_pulses::frame_number();
    if (by_timer_)
      follow(twi_.misses());
    return expect_next(static_cast<uint16_t>(servo_pulses::ticks() - begun_ticks));
  }
  if (servo_pulses::frame_number() - since_frame_ > kSilentFrames)
    return fail(Sensor::kSilent);
  expect_next(0xFFFF);  // at once: it is overdue
}

// How long to wait for the next sample, by how many looks this one took in vain.
void Lps33hw::follow(uint8_t misses) {
  if (misses != 0) {
    late_before_ = false;
    if (misses > 1)
      wait_ += kWaitStep + (misses - 2) * kLookTicks;
    if (wait_ > kLatestWait)
      wait_ = kLatestWait;
    return;
  }
  // It was there already, nobody knows for how long. The second time the sensor is faster than it
  // was, and what is late adds up from sample to sample: begin anew.
  if (late_before_ || wait_ < kEarliestWait + 2 * kWaitStep) {
    wait_ = kEarliestWait;
  } else {
    wait_ -= 2 * kWaitStep;
  }
  late_before_ = true;
}

void Lps33hw::expect_next(uint16_t elapsed_ticks) {
  twi_.prepare_polling(address_, kStatusRegister, kPressureReady, kLooksMax);
  // The last one has just been read: a wired line is low until the next is there.
  const bool wired = !data_ready_pin();
  if (wired) {
    EIFR = _BV(INTF0);
    EIMSK = _BV(INT0);
  }
  const uint16_t elapsed = elapsed_ticks / kTimerTicks;
  const uint16_t wait = wired ? kWiredWait : wait_;
  start_timer(elapsed < wait ? static_cast<uint16_t>(wait - elapsed) : 1);
}

void Lps33hw::fail(Sensor status) {
  stop_handlers();
  running_ = false;
  status_ = status;
  step_ = Step::kPause;
  since_frame_ = servo_pulses::frame_number();
}

}  // namespace setae

ISR(INT0_vect) {
  setae::served->fetch(false);
}

ISR(TIMER0_COMPA_vect) {
  if (setae::rounds_left == 0) {
    setae::served->fetch(true);
  } else {
    --setae::rounds_left;
  }
}
