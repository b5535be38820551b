#include "pins.h"

namespace setae {
namespace uno {
namespace {

constexpr uint16_t kGtccr = 0x43;

struct Port {
  uint16_t pin, ddr, port;
};
constexpr Port kB = {0x23, 0x24, 0x25};
constexpr Port kD = {0x29, 0x2A, 0x2B};

}  // namespace

Pins::Pins(Chip& chip)
    : chip_(chip),
      timer0_(chip, Timer::kTimer0, [](Cycle) {}),
      timer1_(chip, Timer::kTimer1, [this](Cycle when) { look(when); }),
      timer2_(chip, Timer::kTimer2, [this](Cycle when) { look(when); }) {
  for (const Port& port : {kB, kD}) {
    for (const uint16_t address : {port.ddr, port.port}) {
      chip_.on_write(address, [this, address](uint8_t value) {
        chip_.set(address, value);
        look(chip_.cycle());
      });
    }
    // Section 14.2.2: a one written to PIN toggles PORT.
    chip_.on_write(port.pin, [this, port](uint8_t value) {
      chip_.set(port.port, chip_.get(port.port) ^ value);
      look(chip_.cycle());
    });
  }
  chip_.on_write(kGtccr, [this](uint8_t value) {
    timer0_.hold(value);
    timer1_.hold(value);
    timer2_.hold(value);
  });
}

void Pins::reset() {
  for (const Port& port : {kB, kD}) {
    chip_.set(port.ddr, 0);
    chip_.set(port.port, 0);
  }
  timer0_.reset();
  timer1_.reset();
  timer2_.reset();
  look(chip_.cycle());
}

void Pins::look(Cycle when) {
  struct Servo {
    Port port;
    uint8_t bit;
    const Timer* timer;
    Unit unit;
  };
  const Servo servos[kServoPins] = {
      {kB, 1, &timer1_, Unit::kA},
      {kB, 2, &timer1_, Unit::kB},
      {kB, 3, &timer2_, Unit::kA},
      {kD, 3, &timer2_, Unit::kB},
  };
  for (uint8_t i = 0; i < kServoPins; ++i) {
    const Servo& servo = servos[i];
    const bool driven = (chip_.get(servo.port.ddr) >> servo.bit) & 1;
    // Section 14.3.1: a connected compare output overrides PORT, but not DDR.
    const bool wanted = servo.timer->connected(servo.unit)
                            ? servo.timer->latch(servo.unit)
                            : (chip_.get(servo.port.port) >> servo.bit) & 1;
    const bool level = driven && wanted;
    if (level == levels_[i])
      continue;
    levels_[i] = level;
    edges_.push_back({when, i, level});
  }
}

}  // namespace uno
}  // namespace setae
