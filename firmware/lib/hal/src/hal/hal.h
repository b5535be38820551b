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

// A computer runs several boards at a time, and tests answer for some of them: calls are virtual.
// The UNO is one machine, known when the firmware is linked: there they are plain functions of
// hal_uno, with nothing to keep and nothing to look up.
#ifdef __AVR__
#define SETAE_ASK static
#define SETAE_ANSWER
#else
#define SETAE_ASK virtual
#define SETAE_ANSWER = 0
#endif

class Hal {
 public:
  SETAE_ASK BoardTime now() SETAE_ANSWER;
  SETAE_ASK uint32_t frame() SETAE_ANSWER;
  SETAE_ASK bool frame_ends_within(uint16_t us) SETAE_ANSWER;

  // Serial line: what has come, and what is to go. The board reads the one and writes the other.
  SETAE_ASK ReceiveRing& received() SETAE_ANSWER;
  SETAE_ASK TransmitRing& to_send() SETAE_ANSWER;
  // So much waits on its way to the host that an answer would have to wait, for a millisecond at
  // most.
  SETAE_ASK bool sending() SETAE_ANSWER;
  // After each publish().
  SETAE_ASK void start_sending() SETAE_ANSWER;
  // What the line lost; each modulo 256.
  SETAE_ASK LineErrors line_errors() SETAE_ANSWER;

  // Pulses for the next servo frame and those after it. The last call before a
  // frame starts counts, for all servos at once. Bit i of `attached`: servo i
  // gets pulses.
  // Returns the frame that was running at that moment; a loop that looks at the time itself can
  // be overtaken by the next frame before it calls.
  SETAE_ASK uint32_t set_pulses(const Pulses& pulses, uint8_t attached) SETAE_ANSWER;
  // Edges that were armed too late, modulo 256.
  SETAE_ASK uint8_t late_pulses() SETAE_ANSWER;

  // Never waits longer than 1 ms.
  SETAE_ASK SensorReading read_sensor() SETAE_ANSWER;

  // It is being fetched, or waits for read_sensor().
  SETAE_ASK bool sample_on_its_way() SETAE_ANSWER;

  SETAE_ASK protocol::ResetCause reset_cause() SETAE_ANSWER;
  SETAE_ASK Retained& retained() SETAE_ANSWER;

  // The bandgap in parts of the supply, see supply.h; 0 before it was measured.
  SETAE_ASK uint16_t bandgap_part() SETAE_ANSWER;
  // The normally closed switch; open, too, where there is none.
  SETAE_ASK bool stop_switch_open() SETAE_ANSWER;

  // A byte takes 3.4 ms to write. Neither reading nor writing is allowed before it is ready.
  SETAE_ASK bool eeprom_ready() SETAE_ANSWER;
  SETAE_ASK uint8_t eeprom_read(uint16_t address) SETAE_ANSWER;
  SETAE_ASK void eeprom_write(uint16_t address, uint8_t value) SETAE_ANSWER;

#ifndef __AVR__
 protected:
  ~Hal() = default;
#endif
};

// What keeps hold of one.
#ifdef __AVR__
using HalRef = Hal;
#else
using HalRef = Hal&;
#endif

}  // namespace setae
