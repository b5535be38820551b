#include "hal_uno/lps33hw.h"

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
constexpr uint8_t kAutoIncrement = 1 << 4;
constexpr uint8_t kStatusRegister = 0x27;
constexpr uint8_t kPressureReady = 1 << 0;
constexpr uint8_t kPressOutXl = 0x28;  // the high byte last: reading it frees the registers

constexpr uint32_t kRetryUs = 100000;
constexpr uint32_t kSilentUs = 100000;
// 75 Hz is 13.3 ms, 12.9 with a fast oscillator. To look earlier only loads the bus; from then
// on the status is read without a break. Counted from where the last sample was seen, and with
// room for the transfers: each look must begin a little earlier than the sample before, or they
// fall behind the sensor, up to a whole period, and nobody notices.
constexpr uint32_t kEarliestUs = 12000;

}  // namespace

SensorReading Lps33hw::poll(const BoardTime& now) {
  const uint32_t now_us = now.frame * protocol::kServoFrameUs + now.phase_us;
  SensorReading reading = {status_, false, 0, now};
  switch (twi_.poll()) {
    case Twi::Result::kBusy:
      break;
    case Twi::Result::kNoAck:
      address_ ^= 1;
      fail(Sensor::kAbsent, now_us);
      break;
    case Twi::Result::kFailed:
      fail(Sensor::kBus, now_us);
      break;
    case Twi::Result::kIdle:
      if (!due(now_us))
        break;
      if (step_ == Step::kPause) {
        step_ = Step::kIdentify;
        twi_.start_read(address_, kWhoAmI, 1);
      } else {
        step_ = Step::kStatus;
        twi_.start_read(address_, kStatusRegister, 1);
      }
      break;
    case Twi::Result::kDone:
      ready_ = step_ == Step::kStatus ? now : ready_;
      on_done(now_us, reading);
      break;
  }
  reading.status = status_;
  return reading;
}

void Lps33hw::on_done(uint32_t now_us, SensorReading& reading) {
  const uint8_t* data = twi_.data();
  switch (step_) {
    case Step::kIdentify:
      if (data[0] != kIdentity)
        return fail(Sensor::kWrong, now_us);
      step_ = Step::kSetAddressing;
      return twi_.start_write(address_, kCtrlReg2, kAutoIncrement);
    case Step::kSetAddressing:
      step_ = Step::kSetRate;
      return twi_.start_write(address_, kCtrlReg1, kRate75Hz | kBlockDataUpdate);
    case Step::kSetRate:
      status_ = Sensor::kOk;
      sampled_us_ = now_us;
      step_ = Step::kWait;
      due_us_ = now_us;
      return;
    case Step::kStatus:
      if (data[0] & kPressureReady) {
        step_ = Step::kData;
        due_us_ = now_us + kEarliestUs;
        return twi_.start_read(address_, kPressOutXl, 3);
      }
      if (now_us - sampled_us_ > kSilentUs)
        return fail(Sensor::kSilent, now_us);
      step_ = Step::kWait;
      return;
    case Step::kData: {
      const uint32_t raw =
          static_cast<uint32_t>(data[2]) << 16 | static_cast<uint16_t>(data[1]) << 8 | data[0];
      reading.fresh = true;
      reading.pressure_raw = static_cast<int32_t>(raw << 8) / 256;  // sign of 24 bits
      reading.sampled = ready_;
      sampled_us_ = now_us;
      step_ = Step::kWait;
      return;
    }
    default:
      return fail(Sensor::kBus, now_us);
  }
}

void Lps33hw::fail(Sensor status, uint32_t now_us) {
  status_ = status;
  step_ = Step::kPause;
  due_us_ = now_us + kRetryUs;
}

}  // namespace setae
