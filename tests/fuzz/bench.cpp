#include "bench.h"

#include <stdio.h>
#include <stdlib.h>

namespace setae {
namespace fuzz {

namespace {

constexpr uint32_t kPollUs = 10000;
constexpr uint32_t kSampleUs = 13333;  // 75 Hz
// One poll of the board takes as much.
constexpr size_t kBytesPerPoll = 63;

void print(const Step& step) {
  fprintf(stderr, "frame %u  mode %d  epoch %d  session %d  expects %d  queued %d  attached %d",
          step.after.frame, static_cast<int>(step.after.mode), step.after.epoch, step.after.session,
          step.after.expected, step.after.queued, step.after.attached);
  fprintf(stderr, "  guard %d", static_cast<int>(step.after.guard));
  if (step.reading.fresh)
    fprintf(stderr, "  sample %d", step.reading.pressure_raw);
  if (step.delivered)
    fprintf(stderr, "  message %02x session %d number %d", step.host.bytes[0], step.session(),
            step.sequence());
  fputc('\n', stderr);
}

}  // namespace

Bench::Bench() {
  machine.listen(this);
  restart(protocol::ResetCause::kPowerOn);
}

void Bench::restart(protocol::ResetCause cause, bool powered_off) {
  if (powered_off)
    machine.forget_retained();
  machine.restart(cause);
  machine.begin_frame_at_call(0);
  board_.reset(new Board(machine));
  sample_due_us_ = 0;
  tap_ = ReferenceDecoder();
  motion_.on_restart();
  state_.on_restart();
  contact_.on_restart();
  line_.on_restart(powered_off);
  listening_ = true;
  board_->poll();
  shot_ = BoardProbe::look(*board_);
  poll();
}

void Bench::sample(uint64_t now_us) {
  if (sensor != protocol::Sensor::kOk) {
    machine.push_sample(sensor, 0, now_us);
  } else if (now_us >= sample_due_us_ && !sensor_silent) {
    const uint32_t number = sensor_stuck ? 0 : ++samples_;
    const int32_t swing_raw = (number & 1) != 0 ? this->swing_raw : 0;
    machine.push_sample(sensor, (pressure_raw + swing_raw) ^ (number % 8 == 0), now_us);
    sample_due_us_ = now_us + kSampleUs;
  }
}

void Bench::run_us(uint32_t duration_us) {
  for (uint32_t gone_us = 0; gone_us < duration_us; gone_us += kPollUs) {
    const uint64_t now_us = machine.board_us() + kPollUs;
    sample(now_us);
    machine.move_to(now_us);
    poll();
  }
}

void Bench::stall_us(uint32_t duration_us) {
  machine.move_to(machine.board_us() + duration_us);
  sample(machine.board_us());
  poll();
}

void Bench::receive(const uint8_t* wire, size_t size) {
  for (size_t i = 0; i < size; ++i) {
    if (machine.push_rx(wire[i]) && tap_.push(wire[i]) == ReferenceDecoder::Found::kFrame) {
      const Inside& inside = tap_.inside();
      const auto type = static_cast<protocol::MessageType>(inside.bytes[0]);
      if (inside.size >= 3 && protocol::host_payload_size(type) == inside.size - 3) {
        step_.delivered = true;
        step_.host = inside;
      }
    }
    // One frame a poll, so that it is known which one did what.
    if (step_.delivered || i % kBytesPerPoll == kBytesPerPoll - 1)
      poll();
  }
  poll();
}

void Bench::poll() {
  step_.before = shot_;
  line_.on_poll();
  polling_ = true;
  board_->poll();
  polling_ = false;
  shot_ = BoardProbe::look(*board_);
  step_.after = shot_;
  step_.frame_began = step_.after.frame != step_.before.frame;
  step_.stalled = !listening_;
  step_.switch_open = machine.stop_switch_open();
  machine.take_reading(step_.reading);
  static const bool tracing = getenv("SETAE_TRACE") != nullptr;
  if (tracing)
    print(step_);
  drain();
  state_.on_step(step_);
  motion_.on_step(step_, machine.output());
  contact_.on_step(step_);
  line_.on_step(step_);
  step_.delivered = false;
}

void Bench::listen(bool listening) {
  listening_ = listening;
  drain();
}

void Bench::drain() {
  TransmitRing& ring = machine.to_send();
  while (listening_ && ring.size() != 0) {
    const uint8_t count = ring.front_size();
    line_.on_bytes(ring.front(), count);
    ring.drop(count);
  }
}

void Bench::on_output(const Output& output) {
  // Limits change only while nothing has pulses, so those of the last poll hold.
  motion_.on_output(output, shot_.limits, polling_);
}

}  // namespace fuzz
}  // namespace setae
