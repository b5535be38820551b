// The HAL of an Arduino UNO: ATmega328P at 16 MHz.
#pragma once

#include <stdint.h>

#include "hal/hal.h"
#include "hal_uno/lps33hw.h"

namespace setae {

class UnoHal final : public Hal {
 public:
  void begin();
  // Once per turn of the loop: tells the watchdog that the loop turns.
  void service();

  BoardTime now() override;
  bool read_byte(uint8_t& byte) override;
  uint8_t write_room() override;
  void write(const uint8_t* data, uint8_t size) override;
  uint32_t set_pulses(const Pulses& pulses, uint8_t attached) override;
  SensorReading read_sensor() override;
  protocol::ResetCause reset_cause() override;
  Retained& retained() override;

 private:
  Lps33hw sensor_;
};

}  // namespace setae
