// What the board's logic asks of the machine it runs on: the UNO (hal_uno) or a
// computer (hal_host). Nothing else in the firmware may touch registers.
#pragma once

#include <stdint.h>

#include "hal/retained.h"
#include "hal/ring.h"
#include "hal/supply.h"
#include "protocol/messages.h"

namespace setae {

// Board time: servo frames since start, and microseconds into the current one.
struct BoardTime {
  uint32_t frame;
  uint16_t phase_us;
};

// Status and value travel together: a value is never used where a read failed.
struct SensorReading {
  protocol::Sensor status;
  bool fresh;            // a sample that was not handed out before
  int32_t pressure_raw;  // 4096 LSB/hPa; meaningful only if fresh
  BoardTime sampled;     // when the sensor had it ready
};

// Bytes that never became part of a frame, since start, each modulo 256.
struct LineErrors {
  uint8_t framing;  // no stop bit: noise, or another rate
  uint8_t overrun;  // the handler came too late
  uint8_t dropped;  // the loop came too late: the ring was full
};

class Hal {
 public:
  virtual BoardTime now() = 0;

  // Serial line: what has come, and what is to go. The board reads the one and writes the other.
  virtual ReceiveRing& received() = 0;
  virtual TransmitRing& to_send() = 0;
  // After each publish().
  virtual void start_sending() = 0;
  // What the line lost; each modulo 256.
  virtual LineErrors line_errors() = 0;

  // Pulses for the next servo frame and those after it. The last call before a
  // frame starts counts, for all servos at once. Bit i of `attached`: servo i
  // gets pulses.
  // Returns the frame that was running at that moment; a loop that looks at the time itself can
  // be overtaken by the next frame before it calls.
  virtual uint32_t set_pulses(const Pulses& pulses, uint8_t attached) = 0;
  // Edges that were armed too late, modulo 256.
  virtual uint8_t late_pulses() = 0;

  // Never waits longer than 1 ms.
  virtual SensorReading read_sensor() = 0;

  // It is being fetched: soon read_sensor() has it.
  virtual bool sample_on_its_way() = 0;

  virtual protocol::ResetCause reset_cause() = 0;
  virtual Retained& retained() = 0;

  // The bandgap in parts of the supply, see supply.h; 0 before it was measured.
  virtual uint16_t bandgap_part() = 0;
  // The normally closed switch; open, too, where there is none.
  virtual bool stop_switch_open() = 0;

  // A byte takes 3.4 ms to write. Neither reading nor writing is allowed before it is ready.
  virtual bool eeprom_ready() = 0;
  virtual uint8_t eeprom_read(uint16_t address) = 0;
  virtual void eeprom_write(uint16_t address, uint8_t value) = 0;

 protected:
  ~Hal() = default;
};

}  // namespace setae
