// The bristle's pressure sensor, ST LPS33HW.
//
// A sample is fetched by handlers alone, so that a busy loop can't delay it: where the sensor's
// data-ready output is wired to D2, that starts the transfer; else Timer0 does, a little before the
// next sample is due, and the status is read without a break until it is there.
#pragma once

#include <stdint.h>

#include "hal/hal.h"
#include "hal_uno/twi.h"

namespace setae {

class Lps33hw {
 public:
  void begin();

  // Hands out what has come, without waiting.
  SensorReading poll();

  // A sample is about to come, on its way, or there for poll() to hand out.
  bool fetching() const { return running_ && twi_.pending(); }

  // For the handlers: by the timer, or by D2.
  void fetch(bool by_timer);

 private:
  enum class Step : uint8_t {
    kPause,  // until it makes sense to look for the sensor again
    kIdentify,
    kReset,
    kSetAddressing,
    kSetDataReady,
    kSetRate,
    kRun,
  };

  void on_done(SensorReading& reading);
  void take_sample(SensorReading& reading);
  void follow(uint8_t misses);
  void expect_next(uint16_t elapsed_ticks);
  void fail(protocol::Sensor status);

  Twi twi_;
  Step step_ = Step::kPause;
  protocol::Sensor status_ = protocol::Sensor::kAbsent;
  uint8_t address_ = 0x5D;  // SA0 high; else 0x5C
  bool running_ = false;
  bool by_timer_ = false;
  uint16_t wait_ = 0;         // from one fetch to the next, Timer0 ticks
  bool late_before_ = false;  // the last sample was there at the first look
  uint32_t since_frame_ = 0;  // the last sample, or failure
};

}  // namespace setae
