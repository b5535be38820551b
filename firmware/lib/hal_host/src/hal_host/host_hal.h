// The HAL on a computer: a board whose time, bytes and samples come from the
// caller. Buffers are as long as on the UNO, so that they overflow alike.
#pragma once

#include <stdint.h>

#include "hal/hal.h"

namespace setae {

class HostHal : public Hal {
 public:
  // What the servos are taken to have been left at: `pulse_free_us` of the
  // default robot, 850 us. A real board after a power cut knows nothing; see
  // forget_pose().
  static constexpr uint16_t kFreeTicks = 1700;

  HostHal();

  // ---- for the simulator ----

  // Board time, microseconds since the board's start; never backwards. At each
  // multiple of the servo frame the pulses last set become the output.
  void advance_to(uint64_t board_us);
  uint64_t board_us() const { return board_us_; }

  // A byte from the line; false and counted where the ring is full.
  bool push_rx(uint8_t byte);
  // The next byte for the line.
  bool pop_tx(uint8_t& byte) { return transmit_.pop(byte); }
  // What the hardware would notice, for a test to set; push_rx() counts what it drops.
  LineErrors& errors() { return errors_; }
  uint8_t& late() { return late_pulses_; }

  // Status `ok`: a sample that was ready at `sampled_us` (not after now). Any
  // other status: the sensor fails like this until the next call.
  void push_sample(protocol::Sensor status, int32_t pressure_raw, uint64_t sampled_us);

  // What the servos get in this frame.
  const Pulses& output() const { return output_; }
  uint8_t attached() const { return output_attached_; }

  // The board starts anew at time 0: line, pulses and sensor are lost, retained
  // memory is not. The caller makes a new Board.
  void restart(protocol::ResetCause cause);
  // As after power-on: the retained memory holds anything. EEPROM stays.
  void forget_retained();
  void forget_pose() { retained_.pose.clear(); }

  void set_supply_mv(uint16_t mv) { bandgap_part_ = supply_mv(mv); }
  void set_stop_switch(bool open) { stop_switch_open_ = open; }

  // How many bytes were written to EEPROM, and its content.
  uint32_t eeprom_writes() const { return eeprom_writes_; }
  uint8_t& eeprom(uint16_t address) { return eeprom_[address]; }
  uint16_t last_eeprom_address() const { return eeprom_address_; }

  // ---- Hal ----

  BoardTime now() override { return to_board_time(board_us_); }
  uint32_t frame() override { return to_board_time(board_us_).frame; }
  bool frame_ends_within(uint16_t us) override {
    return to_board_time(board_us_).phase_us >= protocol::kServoFrameUs - us;
  }
  ReceiveRing& received() override { return receive_; }
  TransmitRing& to_send() override { return transmit_; }
  bool sending() override { return false; }  // whoever runs it takes the bytes at once
  void start_sending() override {}
  LineErrors line_errors() override { return errors_; }
  uint32_t set_pulses(const Pulses& pulses, uint8_t attached) override;
  uint8_t late_pulses() override { return late_pulses_; }
  SensorReading read_sensor() override;
  bool sample_on_its_way() override { return false; }
  protocol::ResetCause reset_cause() override { return reset_cause_; }
  Retained& retained() override { return retained_; }
  uint16_t bandgap_part() override { return bandgap_part_; }
  bool stop_switch_open() override { return stop_switch_open_; }
  bool eeprom_ready() override { return board_us_ >= eeprom_ready_us_; }
  uint8_t eeprom_read(uint16_t address) override { return eeprom_[address]; }
  void eeprom_write(uint16_t address, uint8_t value) override;

 private:
  static constexpr uint8_t kSamples = 8;
  static constexpr uint16_t kEepromBytes = 1024;
  static constexpr uint16_t kEepromWriteUs = 3400;
  struct Sample {
    int32_t pressure_raw;
    uint64_t sampled_us;
  };

  static BoardTime to_board_time(uint64_t time_us);

  uint64_t board_us_ = 0;
  ReceiveRing receive_;
  TransmitRing transmit_;
  LineErrors errors_ = {};
  uint8_t late_pulses_ = 0;
  Pulses next_ = {};
  uint8_t next_attached_ = 0;
  Pulses output_ = {};
  uint8_t output_attached_ = 0;
  protocol::Sensor sensor_ = protocol::Sensor::kAbsent;
  Sample samples_[kSamples] = {};
  uint8_t sample_count_ = 0;
  protocol::ResetCause reset_cause_ = protocol::ResetCause::kPowerOn;
  Retained retained_;
  uint16_t bandgap_part_ = supply_mv(5000);
  bool stop_switch_open_ = true;  // there is none
  uint8_t eeprom_[kEepromBytes];
  uint32_t eeprom_writes_ = 0;
  uint16_t eeprom_address_ = 0;
  uint64_t eeprom_ready_us_ = 0;
};

}  // namespace setae
