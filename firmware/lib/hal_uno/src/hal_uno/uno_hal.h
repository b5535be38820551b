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
  ReceiveRing& received() override;
  TransmitRing& to_send() override;
  void start_sending() override;
  LineErrors line_errors() override;
  uint32_t set_pulses(const Pulses& pulses, uint8_t attached) override;
  SensorReading read_sensor() override;
  bool sample_on_its_way() override;
  protocol::ResetCause reset_cause() override;
  Retained& retained() override;
  uint8_t late_pulses() override;
  uint16_t bandgap_part() override;
  bool stop_switch_open() override;
  bool eeprom_ready() override;
  uint8_t eeprom_read(uint16_t address) override;
  void eeprom_write(uint16_t address, uint8_t value) override;

 private:
  Lps33hw sensor_;
};

}  // namespace setae
