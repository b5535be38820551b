// A board on the test bench: real Board, host HAL, and the host's end of the line.
#pragma once

#include <memory>
#include <vector>

#include "board/board.h"
#include "board/default_limits.h"
#include "hal_host/host_hal.h"
#include "protocol/frame.h"

namespace setae {

constexpr int32_t kHpa = protocol::kPressureLsbPerHpa;
constexpr uint16_t kFree = HostHal::kFreeTicks;
constexpr uint32_t kStepUs = 500;
constexpr uint32_t kSampleUs = 13333;  // 75 Hz

// What one `Message` came with.
template <typename Message>
struct Heard {
  protocol::BoardHeader header;
  Message message;
};

class Rig {
 public:
  Rig() : board(new Board(hal)) { run_frames(2); }
  Rig(const Rig&) = delete;  // the board refers to the HAL beside it

  // ---- time ----

  void run_frames(uint32_t frames) {
    run_until(static_cast<uint64_t>(hal.now().frame + frames) * protocol::kServoFrameUs);
  }

  void run_until(uint64_t until_us) {
    while (hal.board_us() < until_us) {
      const uint64_t next_us = hal.board_us() + kStepUs;
      if (sensor == protocol::Sensor::kOk) {
        if (next_us >= sample_due_us_) {
          // A sensor's value is never the same for long.
          hal.push_sample(sensor, pressure_raw ^ (++samples_ % 8 == 0), next_us);
          sample_due_us_ = next_us + kSampleUs;
        }
      } else {
        hal.push_sample(sensor, 0, next_us);
      }
      const uint32_t frame = hal.now().frame;
      hal.advance_to(next_us);
      if (hal.now().frame != frame)
        outputs.push_back({hal.output(), hal.attached()});
      poll();
    }
  }

  void poll() {
    board->poll();
    uint8_t byte;
    while (hal.pop_tx(byte))
      take(byte);
  }

  // A byte from the board.
  void take(uint8_t byte) {
    if (decoder_.push(byte))
      hear();
  }

  void restart(protocol::ResetCause cause) {
    hal.restart(cause);
    board.reset(new Board(hal));
    sample_due_us_ = 0;
    outputs.clear();
    run_frames(2);
  }
  void power_cycle() {
    hal.forget_retained();
    restart(protocol::ResetCause::kPowerOn);
  }

  // ---- the host's end ----

  template <typename Message>
  void send(const Message& message, uint8_t sequence = 0) {
    send_as(session, message, sequence);
  }

  template <typename Message>
  void send_as(uint8_t as_session, const Message& message, uint8_t sequence = 0) {
    uint8_t frame[protocol::kFrameBytesMax];
    const protocol::HostHeader header = {static_cast<uint8_t>(Message::kType), as_session,
                                         sequence};
    encode(header, frame);
    encode(message, frame + protocol::HostHeader::kSize);
    send_raw(frame, protocol::HostHeader::kSize + Message::kSize);
  }

  void send_raw(uint8_t* frame, uint8_t size) {
    uint8_t wire[protocol::kFrameWireBytesMax];
    const uint8_t wire_size = protocol::encode_frame(frame, size, wire);
    for (uint8_t i = 0; i < wire_size; ++i)
      hal.push_rx(wire[i]);
    poll();
  }

  // Sends a command in sequence; whether the board took it (carried out, discarded or refused).
  template <typename Message>
  bool command(const Message& message) {
    send(message, next_sequence);
    if (header.expected != static_cast<uint8_t>(next_sequence + 1))
      return false;
    ++next_sequence;
    return true;
  }

  void open(uint8_t new_session = 7) {
    session = new_session;
    next_sequence = 0;
    const protocol::Hello hello = {protocol::kProtocolVersion, protocol::kSchemaHash, new_session,
                                   0x12345678};
    send_as(0, hello);
  }

  void acknowledge_all() {
    if (!trips.empty())
      acknowledge(protocol::Record::kTrip, trips.back().message.record_id);
    if (!faults.empty())
      acknowledge(protocol::Record::kFault, faults.back().message.record_id);
    if (!refusals.empty()) {
      acknowledge(protocol::Record::kRefusal, refusals.back().message.record_id);
    }
  }

  void acknowledge(protocol::Record record, uint8_t id) {
    send(protocol::Acknowledge{static_cast<uint8_t>(record), id});
  }

  // ---- ready-made ----

  static protocol::Segment segment(uint16_t frames, uint16_t ticks) {
    return {frames, {ticks, ticks, ticks, ticks}};
  }

  protocol::Segments segments(std::vector<protocol::Segment> list) const {
    protocol::Segments message = {};
    message.epoch = header.epoch;
    message.count = static_cast<uint8_t>(list.size());
    for (size_t i = 0; i < list.size(); ++i)
      message.segments[i] = list[i];
    return message;
  }

  protocol::GuardMessage guard(protocol::Reflex reflex = protocol::Reflex::kHold) const {
    protocol::GuardMessage message = {};
    message.epoch = header.epoch;
    message.threshold_raw = 15 * kHpa;
    message.consecutive = 2;
    message.deadline_frames = 1000;
    message.reflex = static_cast<uint8_t>(reflex);
    for (uint16_t& ticks : message.retract_ticks)
      ticks = kFree;
    message.retract_slew_ticks = 20;
    return message;
  }

  static protocol::Enable enable(uint16_t ticks = kFree) { return {{ticks, ticks, ticks, ticks}}; }
  static protocol::Relax relax(uint16_t slew_ticks = 20) {
    return {slew_ticks, {kFree, kFree, kFree, kFree}};
  }
  protocol::Resume resume() const { return {header.epoch}; }

  // ---- to a state ----

  void hold() {
    open();
    command(enable());
    run_frames(25);
  }
  // Holding at a pose away from the free one.
  void hold_at(uint16_t ticks) {
    hold();
    command(segments({segment(100, ticks)}));
    run_frames(103);
  }
  void arm(protocol::Reflex reflex = protocol::Reflex::kHold) {
    command(guard(reflex));
    run_frames(12);
  }

  protocol::State state() const {
    return static_cast<protocol::State>(header.state & ~protocol::kRefusalWaits);
  }
  protocol::Refusal last_refusal() const {
    return refusals.empty() ? protocol::Refusal::kNone
                            : static_cast<protocol::Refusal>(refusals.back().message.reason);
  }
  const protocol::Telemetry& telemetry() const { return telemetries.back().message; }
  uint16_t pulse(uint8_t servo = 0) const { return hal.output().ticks[servo]; }

  struct Output {
    Pulses pulses;
    uint8_t attached;
  };

  HostHal hal;
  std::unique_ptr<Board> board;
  uint8_t session = 0;
  uint8_t next_sequence = 0;
  int32_t pressure_raw = 1013 * kHpa;
  protocol::Sensor sensor = protocol::Sensor::kOk;

  protocol::BoardHeader header = {};  // the last one
  std::vector<Output> outputs;        // by frame
  std::vector<Heard<protocol::HelloReply>> hellos;
  std::vector<Heard<protocol::Receipt>> receipts;
  std::vector<Heard<protocol::Pong>> pongs;
  std::vector<Heard<protocol::Telemetry>> telemetries;
  std::vector<Heard<protocol::Trip>> trips;
  std::vector<Heard<protocol::FaultMessage>> faults;
  std::vector<Heard<protocol::RefusalMessage>> refusals;
  std::vector<Heard<protocol::Limits>> limits;
  std::vector<Heard<protocol::Status>> statuses;
  uint32_t malformed = 0;

 private:
  template <typename Message>
  void keep(std::vector<Heard<Message>>& list) {
    if (decoder_.size() != protocol::BoardHeader::kSize + Message::kSize) {
      ++malformed;
      return;
    }
    Heard<Message> heard = {};
    heard.header = header;
    decode(decoder_.data() + protocol::BoardHeader::kSize, heard.message);
    list.push_back(heard);
  }

  void hear() {
    decode(decoder_.data(), header);
    switch (static_cast<protocol::MessageType>(header.type)) {
      case protocol::MessageType::kHelloReply:
        return keep(hellos);
      case protocol::MessageType::kReceipt:
        return keep(receipts);
      case protocol::MessageType::kPong:
        return keep(pongs);
      case protocol::MessageType::kTelemetry:
        return keep(telemetries);
      case protocol::MessageType::kTrip:
        return keep(trips);
      case protocol::MessageType::kFault:
        return keep(faults);
      case protocol::MessageType::kRefusal:
        return keep(refusals);
      case protocol::MessageType::kLimits:
        return keep(limits);
      case protocol::MessageType::kStatus:
        return keep(statuses);
      default:
        ++malformed;
    }
  }

  protocol::FrameDecoder decoder_;
  uint64_t sample_due_us_ = 0;
  uint32_t samples_ = 0;
};

}  // namespace setae
