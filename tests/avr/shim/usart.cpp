#include "usart.h"

#include <math.h>

#include <algorithm>

namespace setae {
namespace uno {
namespace {

constexpr uint16_t kUcsrA = 0xC0;
constexpr uint16_t kUcsrB = 0xC1;
constexpr uint16_t kUcsrC = 0xC2;
constexpr uint16_t kUbrrL = 0xC4;
constexpr uint16_t kUbrrH = 0xC5;
constexpr uint16_t kUdr = 0xC6;

constexpr uint8_t kDataEmpty = 1 << 5;
constexpr uint8_t kFrameError = 1 << 4;
constexpr uint8_t kOverrun = 1 << 3;
constexpr uint8_t kDoubleSpeed = 1 << 1;
constexpr uint8_t kReceiveEnable = 1 << 4;
constexpr uint8_t kTransmitEnable = 1 << 3;
constexpr uint8_t kUcsrAWritable = 0x03;

constexpr int kFrameBits = 10;
// The stop bit is decided at its tenth of sixteen samples (section 20.8).
constexpr double kStopSampleBits = 9.625;

}  // namespace

Usart::Usart(Chip& chip, UsbChip& usb)
    : chip_(chip),
      usb_(usb),
      receive_complete_(chip, chip.uart().rxc),
      data_empty_(chip, chip.uart().udrc),
      receive_(chip,
               [this](Cycle when) {
                 if (in_frame_) {
                   stop_bit(when);
                 } else {
                   start_bit();
                 }
               }),
      transmit_(chip, [this](Cycle when) { shift_out(when); }) {
  chip_.on_read(kUdr, [this] { return read_data(); });
  chip_.on_read(kUcsrA, [this] { return chip_.get(kUcsrA); });
  chip_.on_write(kUdr, [this](uint8_t value) { write_data(value); });
  chip_.on_write(kUcsrA, [this](uint8_t value) {
    chip_.set(kUcsrA, static_cast<uint8_t>((chip_.get(kUcsrA) & ~kUcsrAWritable) |
                                           (value & kUcsrAWritable)));
  });
  chip_.on_write(kUcsrB, [this](uint8_t value) { write_control_b(value); });
  for (const uint16_t plain : {kUcsrC, kUbrrL, kUbrrH})
    chip_.on_write(plain, [this, plain](uint8_t value) { chip_.set(plain, value); });
}

void Usart::reset() {
  receive_.cancel();
  transmit_.cancel();
  buffer_.clear();
  shift_full_ = lost_ = transmitting_ = waiting_ = false;
  if (in_frame_) {  // the rest of this byte finds nobody
    line_.pop_front();
    in_frame_ = false;
  }
  receive_complete_.set(false);
  chip_.set(kUcsrA, 0);
  data_empty_.set(true);
  chip_.set(kUcsrB, 0);
  chip_.set(kUcsrC, 0x06);
  expect_next();
}

void Usart::send(uint8_t value, Cycle earliest, double bit_cycles) {
  const double start = std::max(line_free_, static_cast<double>(earliest + usb_.down_cycles()));
  line_free_ = start + kFrameBits * bit_cycles;
  line_.push_back({value, start, bit_cycles});
  if (line_.size() == 1)
    expect_next();
}

Cycle Usart::bit_cycles() const {
  const uint16_t divisor = static_cast<uint16_t>(chip_.get(kUbrrL) | (chip_.get(kUbrrH) & 15) << 8);
  return (divisor + 1) * (chip_.get(kUcsrA) & kDoubleSpeed ? 8u : 16u);
}

void Usart::expect_next() {
  if (!line_.empty())
    receive_.set(static_cast<Cycle>(ceil(line_.front().start)));
}

void Usart::start_bit() {
  if ((chip_.get(kUcsrB) & kReceiveEnable) == 0) {
    line_.pop_front();
    expect_next();
    return;
  }
  // Section 20.7.4: buffer and shift register full, and one more frame begins.
  if (shift_full_ && buffer_.size() == 2) {
    shift_full_ = false;
    lost_ = true;
    ++overruns_;
  }
  in_frame_ = true;
  const double sample = kStopSampleBits * static_cast<double>(bit_cycles());
  receive_.set(static_cast<Cycle>(ceil(line_.front().start + sample)));
}

void Usart::stop_bit(Cycle when) {
  const Incoming frame = line_.front();
  line_.pop_front();
  in_frame_ = false;
  // Bits are sampled at this side's rate.
  const bool idle_after =
      line_.empty() || line_.front().start > frame.start + 10.5 * frame.bit_cycles;
  Received received = {0, false, false, when};
  for (int bit = 1; bit <= 9; ++bit) {
    const double middle = (bit + 0.5) * static_cast<double>(bit_cycles());
    const int sent = static_cast<int>(middle / frame.bit_cycles);
    bool level = false;
    if (sent >= 1 && sent <= 8) {
      level = (frame.value >> (sent - 1)) & 1;
    } else if (sent == 9) {
      level = true;
    } else if (sent > 9) {
      level = idle_after;
    }
    if (bit <= 8) {
      received.value = static_cast<uint8_t>(received.value | level << (bit - 1));
    } else if (!level) {
      received.frame_error = true;
      ++frame_errors_;
    }
  }
  if (chip_.get(kUcsrB) & kReceiveEnable) {
    if (buffer_.size() < 2) {
      received.overrun = lost_;
      lost_ = false;
      buffer_.push_back(received);
      show_received();
    } else {
      shift_ = received;
      shift_full_ = true;
    }
  }
  expect_next();
}

void Usart::show_received() {
  uint8_t flags = static_cast<uint8_t>(chip_.get(kUcsrA) & ~(kFrameError | kOverrun));
  if (!buffer_.empty()) {
    flags = static_cast<uint8_t>(flags | (buffer_.front().frame_error ? kFrameError : 0) |
                                 (buffer_.front().overrun ? kOverrun : 0));
  }
  chip_.set(kUcsrA, flags);
  receive_complete_.set(!buffer_.empty());
}

uint8_t Usart::read_data() {
  if (buffer_.empty())
    return 0;
  const Received received = buffer_.front();
  buffer_.pop_front();
  longest_wait_ = std::max(longest_wait_, chip_.cycle() - std::min(received.at, chip_.cycle()));
  if (shift_full_) {
    shift_full_ = false;
    shift_.overrun = lost_;
    lost_ = false;
    buffer_.push_back(shift_);
  }
  show_received();
  return received.value;
}

void Usart::write_data(uint8_t value) {
  if ((chip_.get(kUcsrB) & kTransmitEnable) == 0)
    return;
  if (!transmitting_) {
    transmitting_ = true;
    shifting_ = value;
    transmit_.set(chip_.cycle() + kFrameBits * bit_cycles());
    data_empty_.set(true);
  } else if (!waiting_) {
    waiting_ = true;
    next_ = value;
    data_empty_.set(false);
  }  // else it is ignored, as on the part
}

void Usart::shift_out(Cycle when) {
  usb_.from_board({when, shifting_});
  transmitting_ = waiting_;
  if (waiting_) {
    waiting_ = false;
    shifting_ = next_;
    transmit_.set(when + kFrameBits * bit_cycles());
    data_empty_.set(true);
  }
}

void Usart::write_control_b(uint8_t value) {
  const uint8_t before = chip_.get(kUcsrB);
  chip_.set(kUcsrB, value);
  if ((before & kReceiveEnable) && !(value & kReceiveEnable)) {
    buffer_.clear();
    shift_full_ = false;
    show_received();
  }
  receive_complete_.look_again();
  data_empty_.look_again();
}

}  // namespace uno
}  // namespace setae
