// A board, its machine, the line to it, and everything that watches them.
#pragma once

#include <memory>

#include "contact_watch.h"
#include "line_watch.h"
#include "machine.h"
#include "motion_watch.h"
#include "state_watch.h"
#include "step.h"

namespace setae {
namespace fuzz {

class Bench final : Machine::Listener {
 public:
  Bench();
  Bench(const Bench&) = delete;

  // `powered_off`: what is retained through a reset is lost.
  void restart(protocol::ResetCause cause, bool powered_off = false);
  void run_us(uint32_t duration_us);
  // Time passes, but the board is busy elsewhere.
  void stall_us(uint32_t duration_us);
  // The board's end of the line: bytes as they come, and a poll.
  void receive(const uint8_t* wire, size_t size);
  void poll();
  // Whether somebody takes what the board sends.
  void listen(bool listening);
  bool listening() const { return listening_; }

  const Snapshot& board() const { return shot_; }
  const LineWatch& line() const { return line_; }

  Machine machine;
  protocol::Sensor sensor = protocol::Sensor::kOk;
  bool sensor_silent = false;
  bool sensor_stuck = false;  // a true one never says the same for long
  int32_t swing_raw = 0;      // from sample to sample
  int32_t pressure_raw = 1013 * protocol::kPressureLsbPerHpa;

 private:
  void on_output(const Output& output) override;
  void sample(uint64_t now_us);
  void drain();

  std::unique_ptr<Board> board_;
  Snapshot shot_ = {};
  Step step_ = {};
  uint64_t sample_due_us_ = 0;
  uint32_t samples_ = 0;
  bool listening_ = true;
  bool polling_ = false;
  ReferenceDecoder tap_;
  MotionWatch motion_;
  StateWatch state_;
  ContactWatch contact_;
  LineWatch line_;
};

}  // namespace fuzz
}  // namespace setae
