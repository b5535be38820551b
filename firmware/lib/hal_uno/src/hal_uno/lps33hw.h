// The bristle's pressure sensor, ST LPS33HW.
#pragma once

#include <stdint.h>

#include "hal/hal.h"
#include "hal_uno/twi.h"

namespace setae {

class Lps33hw {
 public:
  void begin() { twi_.begin(); }

  // Advances whatever is under way, without waiting.
  SensorReading poll(const BoardTime& now);

 private:
  enum class Step : uint8_t {
    kPause,  // until it makes sense to look for the sensor again
    kIdentify,
    kSetAddressing,
    kSetRate,
    kWait,  // until a sample may be ready
    kStatus,
    kData,
  };

  void on_done(uint32_t now_us, SensorReading& reading);
  void fail(protocol::Sensor status, uint32_t now_us);
  bool due(uint32_t now_us) const { return static_cast<int32_t>(now_us - due_us_) >= 0; }

  Twi twi_;
  Step step_ = Step::kPause;
  protocol::Sensor status_ = protocol::Sensor::kAbsent;
  uint8_t address_ = 0x5D;  // SA0 high; else 0x5C
  uint32_t due_us_ = 0;
  uint32_t sampled_us_ = 0;
  BoardTime ready_ = {};
};

}  // namespace setae
