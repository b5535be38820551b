#include "hal_host/host_hal.h"

#include <string.h>

namespace setae {

constexpr uint16_t HostHal::kFreeTicks;

HostHal::HostHal() {
  memset(eeprom_, 0xFF, sizeof(eeprom_));
  forget_retained();
  retained_.pose.clear();
  retained_.pose.value.known = true;
  for (uint16_t& ticks : retained_.pose.value.pulses.ticks)
    ticks = kFreeTicks;
  retained_.pose.seal();
}

void HostHal::forget_retained() {
  memset(&retained_, 0xA5, sizeof(retained_));
}

void HostHal::eeprom_write(uint16_t address, uint8_t value) {
  eeprom_[address] = value;
  eeprom_address_ = address;
  ++eeprom_writes_;
  eeprom_ready_us_ = board_us_ + kEepromWriteUs;
}

BoardTime HostHal::to_board_time(uint64_t time_us) {
  return {static_cast<uint32_t>(time_us / protocol::kServoFrameUs),
          static_cast<uint16_t>(time_us % protocol::kServoFrameUs)};
}

void HostHal::advance_to(uint64_t board_us) {
  if (board_us / protocol::kServoFrameUs != board_us_ / protocol::kServoFrameUs) {
    output_ = next_;
    output_attached_ = next_attached_;
  }
  board_us_ = board_us;
}

bool HostHal::push_rx(uint8_t byte) {
  if (receive_.push(byte)) {
    receive_.ended = receive_.ended || byte == 0;
    return true;
  }
  ++errors_.dropped;
  return false;
}

void HostHal::push_sample(protocol::Sensor status, int32_t pressure_raw, uint64_t sampled_us) {
  sensor_ = status;
  if (status != protocol::Sensor::kOk)
    return;
  if (sample_count_ == kSamples) {  // the sensor overwrites what nobody read
    for (uint8_t i = 1; i < kSamples; ++i)
      samples_[i - 1] = samples_[i];
    --sample_count_;
  }
  samples_[sample_count_++] = {pressure_raw, sampled_us};
}

void HostHal::restart(protocol::ResetCause cause) {
  board_us_ = 0;
  eeprom_ready_us_ = 0;
  errors_ = {};
  late_pulses_ = 0;
  receive_.clear();
  transmit_.clear();
  next_attached_ = 0;
  output_attached_ = 0;
  sensor_ = protocol::Sensor::kAbsent;
  sample_count_ = 0;
  reset_cause_ = cause;
}

uint32_t HostHal::set_pulses(const Pulses& pulses, uint8_t attached) {
  next_ = pulses;
  next_attached_ = attached;
  return now().frame;
}

SensorReading HostHal::read_sensor() {
  SensorReading reading = {sensor_, false, 0, {0, 0}};
  if (sample_count_ == 0)
    return reading;
  reading.fresh = true;
  reading.pressure_raw = samples_[0].pressure_raw;
  reading.sampled = to_board_time(samples_[0].sampled_us);
  --sample_count_;
  for (uint8_t i = 0; i < sample_count_; ++i)
    samples_[i] = samples_[i + 1];
  return reading;
}

}  // namespace setae
