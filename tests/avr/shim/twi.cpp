#include "twi.h"

namespace setae {
namespace uno {
namespace {

constexpr uint16_t kPinC = 0x26;
constexpr uint16_t kDdrC = 0x27;
constexpr uint16_t kPortC = 0x28;
constexpr uint16_t kTwbr = 0xB8;
constexpr uint16_t kTwsr = 0xB9;
constexpr uint16_t kTwdr = 0xBB;
constexpr uint16_t kTwcr = 0xBC;

constexpr uint8_t kTwint = 1 << 7;
constexpr uint8_t kTwea = 1 << 6;
constexpr uint8_t kTwsta = 1 << 5;
constexpr uint8_t kTwsto = 1 << 4;
constexpr uint8_t kTwwc = 1 << 3;
constexpr uint8_t kTwen = 1 << 2;
constexpr uint8_t kTwie = 1 << 0;

// Section 22.7, master modes.
constexpr uint8_t kStarted = 0x08;
constexpr uint8_t kStartedAgain = 0x10;
constexpr uint8_t kWriteAck = 0x18;
constexpr uint8_t kWriteNoAck = 0x20;
constexpr uint8_t kSentAck = 0x28;
constexpr uint8_t kSentNoAck = 0x30;
constexpr uint8_t kReadAck = 0x40;
constexpr uint8_t kReadNoAck = 0x48;
constexpr uint8_t kReceivedAck = 0x50;
constexpr uint8_t kReceivedNoAck = 0x58;
constexpr uint8_t kNothing = 0xF8;

constexpr uint8_t kSda = 1 << 4;
constexpr uint8_t kScl = 1 << 5;
constexpr unsigned kByteClocks = 9;

}  // namespace

Twi::Twi(Chip& chip, Lps33hw& slave)
    : chip_(chip),
      slave_(slave),
      interrupt_(chip, chip.twi().twi),
      alarm_(chip, [this](Cycle when) { done(when); }) {
  chip_.on_write(kTwcr, [this](uint8_t value) { write_control(value); });
  chip_.on_write(kTwbr, [this](uint8_t value) { chip_.set(kTwbr, value); });
  chip_.on_write(kTwsr, [this](uint8_t value) {
    chip_.set(kTwsr, static_cast<uint8_t>((chip_.get(kTwsr) & 0xF8) | (value & 3)));
  });
  chip_.on_write(kTwdr, [this](uint8_t value) {
    const uint8_t control = chip_.get(kTwcr);
    if (control & kTwint) {
      chip_.set(kTwdr, value);
      chip_.set(kTwcr, static_cast<uint8_t>(control & ~kTwwc));
    } else {
      chip_.set(kTwcr, control | kTwwc);
    }
  });
  chip_.on_read(kPinC, [this] { return read_pins(); });
  for (const uint16_t port : {kDdrC, kPortC}) {
    chip_.on_write(port, [this, port](uint8_t value) {
      chip_.set(port, value);
      port_c_changed();
    });
  }
}

void Twi::reset() {
  let_go();
  chip_.set(kTwcr, 0);
  chip_.set(kTwdr, 0xFF);
  chip_.set(kTwbr, 0);
  chip_.set(kDdrC, 0);
  chip_.set(kPortC, 0);
}

// Section 22.5.2.
Cycle Twi::clock_cycles() const {
  return 16 + (2u * chip_.get(kTwbr) << (2 * (chip_.get(kTwsr) & 3)));
}

void Twi::let_go() {
  alarm_.cancel();
  operation_ = Operation::kNone;
  phase_ = Phase::kIdle;
  owned_ = false;
  interrupt_.set(false);
  chip_.set(kTwsr, static_cast<uint8_t>((chip_.get(kTwsr) & 3) | kNothing));
}

void Twi::begin(Operation operation, Cycle when, unsigned clocks) {
  operation_ = operation;
  alarm_.set(when + clocks * clock_cycles());
}

void Twi::status(uint8_t code) {
  chip_.set(kTwsr, static_cast<uint8_t>((chip_.get(kTwsr) & 3) | code));
  interrupt_.set(true);
}

void Twi::write_control(uint8_t value) {
  const uint8_t before = chip_.get(kTwcr);
  uint8_t control = static_cast<uint8_t>((before & (kTwint | kTwwc)) |
                                         (value & (kTwea | kTwsta | kTwsto | kTwen | kTwie)));
  if (operation_ == Operation::kStop)
    control |= kTwsto;  // only hardware clears it
  chip_.set(kTwcr, control);
  if ((value & kTwen) == 0) {
    let_go();
    return;
  }
  if ((value & kTwint) == 0) {
    interrupt_.look_again();
    return;
  }
  const Cycle now = chip_.cycle();
  interrupt_.set(false);
  if (value & kTwsto) {
    begin(Operation::kStop, now, owned_ ? 1 : 0);
  } else if (value & kTwsta) {
    begin(Operation::kStart, now, 1);
  } else if (phase_ == Phase::kStarted) {
    begin(Operation::kAddress, now, kByteClocks);
  } else if (phase_ == Phase::kTransmitter) {
    begin(Operation::kTransmit, now, kByteClocks);
  } else if (phase_ == Phase::kReceiver) {
    begin(Operation::kReceive, now, kByteClocks);
  }
}

void Twi::done(Cycle when) {
  const Operation operation = operation_;
  operation_ = Operation::kNone;
  switch (operation) {
    case Operation::kStart:
      if (stuck_clocks_ > 0)
        return;  // the bus looks busy, and START waits for ever
      status(owned_ ? kStartedAgain : kStarted);
      owned_ = true;
      phase_ = Phase::kStarted;
      break;
    case Operation::kAddress: {
      const uint8_t data = chip_.get(kTwdr);
      const bool reading = data & 1;
      answered_ = slave_.addressed(data >> 1, reading);
      phase_ = reading ? Phase::kReceiver : Phase::kTransmitter;
      if (reading) {
        status(answered_ ? kReadAck : kReadNoAck);
      } else {
        status(answered_ ? kWriteAck : kWriteNoAck);
      }
      break;
    }
    case Operation::kTransmit:
      if (answered_)
        slave_.write(chip_.get(kTwdr));
      status(answered_ ? kSentAck : kSentNoAck);
      break;
    case Operation::kReceive:
      chip_.set(kTwdr, answered_ ? slave_.read() : 0xFF);
      status(chip_.get(kTwcr) & kTwea ? kReceivedAck : kReceivedNoAck);
      break;
    case Operation::kStop:
      owned_ = false;
      phase_ = Phase::kIdle;
      chip_.set(kTwcr, static_cast<uint8_t>(chip_.get(kTwcr) & ~kTwsto));
      chip_.set(kTwsr, static_cast<uint8_t>((chip_.get(kTwsr) & 3) | kNothing));
      if (chip_.get(kTwcr) & kTwsta)
        begin(Operation::kStart, when, 1);
      break;
    case Operation::kNone:
      break;
  }
}

// With the bus's pull-ups.
uint8_t Twi::read_pins() const {
  const uint8_t driven = chip_.get(kDdrC);
  uint8_t pins = static_cast<uint8_t>((driven & chip_.get(kPortC)) | (~driven & (kSda | kScl)));
  if (stuck_clocks_ > 0)
    pins &= static_cast<uint8_t>(~kSda);
  return pins;
}

void Twi::port_c_changed() {
  const bool low = (chip_.get(kDdrC) & kScl) && !(chip_.get(kPortC) & kScl);
  if (clock_low_ && !low && stuck_clocks_ > 0)
    --stuck_clocks_;
  clock_low_ = low;
}

}  // namespace uno
}  // namespace setae
