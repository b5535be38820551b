// The machine that the board runs on here: the host's HAL, whose frames can begin at the worst
// moment, and which shows every frame's pulses and every reading to an observer.
#pragma once

#include "hal_host/host_hal.h"

namespace setae {
namespace fuzz {

// A servo frame's outputs.
struct Output {
  uint32_t frame;
  Pulses pulses;
  uint8_t attached;
};

class Machine final : public HostHal {
 public:
  class Listener {
   public:
    virtual void on_output(const Output& output) = 0;

   protected:
    ~Listener() = default;
  };

  void listen(Listener* listener) { listener_ = listener; }

  // Frame by frame, so that none is missed.
  void move_to(uint64_t time_us) {
    while (true) {
      const uint64_t edge_us = next_edge_us();
      if (edge_us > time_us)
        break;
      advance_to(edge_us);
      listener_->on_output({HostHal::now().frame, output(), attached()});
    }
    advance_to(time_us);
  }

  // The next frame begins just before the board looks at the time, or sets pulses, for the
  // `calls`th time from now. 0: not by itself.
  void begin_frame_at_call(uint8_t calls) { calls_to_edge_ = calls; }

  // What the board last got; taken away by asking.
  bool take_reading(SensorReading& reading) {
    const bool read = read_;
    reading = reading_;
    read_ = false;
    return read;
  }

  BoardTime now() override {
    count_call();
    return HostHal::now();
  }
  uint32_t frame() override {
    count_call();
    return HostHal::frame();
  }
  uint32_t set_pulses(const Pulses& pulses, uint8_t attached) override {
    count_call();
    const uint8_t calls = calls_to_edge_;
    calls_to_edge_ = 0;
    const uint32_t frame = HostHal::set_pulses(pulses, attached);
    calls_to_edge_ = calls;
    return frame;
  }
  SensorReading read_sensor() override {
    reading_ = HostHal::read_sensor();
    read_ = true;
    return reading_;
  }

 private:
  uint64_t next_edge_us() const {
    return (board_us() / protocol::kServoFrameUs + 1) * protocol::kServoFrameUs;
  }
  void count_call() {
    if (calls_to_edge_ != 0 && --calls_to_edge_ == 0)
      move_to(next_edge_us());
  }

  Listener* listener_ = nullptr;
  uint8_t calls_to_edge_ = 0;
  SensorReading reading_ = {};
  bool read_ = false;
};

}  // namespace fuzz
}  // namespace setae
