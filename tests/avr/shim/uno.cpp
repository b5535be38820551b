#include "uno.h"

extern "C" {
#include <avr_flash.h>
#include <sim_interrupts.h>
}

#include <string.h>

#include <algorithm>

namespace setae {
namespace uno {
namespace {

constexpr uint16_t kMcusr = 0x54;
constexpr uint8_t kPowerOnReset = 1 << 0;
constexpr uint8_t kExternalReset = 1 << 1;
constexpr uint8_t kBrownOutReset = 1 << 2;
constexpr uint8_t kWatchdogReset = 1 << 3;
// The UNO's fuses.
constexpr double kBrownOutVolts = 2.7;
constexpr uint16_t kRamStart = 0x100;
// Memory holds anything at power-on; no counter or pointer is likely to be that.
constexpr uint8_t kPaint = 0xC5;
// Section 7.7.1: four cycles to the vector, which simavr doesn't count.
constexpr int kInterruptCycles = 4;
constexpr int kRetiCycles = 4;
constexpr Cycle kBurst = 1000000;

const char* kNoNames[] = {nullptr};

}  // namespace

Uno::Uno(const std::string& elf_path)
    : chip_(elf_path),
      usb_(chip_),
      usart_(chip_, usb_),
      d2_(chip_),
      sensor_(chip_, [this](bool level) { d2_.drive(level); }),
      twi_(chip_, sensor_),
      pins_(chip_),
      watchdog_(chip_, [this] { bitten_ = true; }),
      eeprom_(chip_),
      adc_(chip_),
      flash_(chip_),
      end_(chip_, [](Cycle) {}),
      hold_(chip_, [this](Cycle) { chip_.avr()->cycle += hold_cycles_; }) {
  avr_t* avr = chip_.avr();
  listener_.uno = this;
  listener_.io.kind = "uno";
  listener_.io.avr = avr;
  listener_.io.irq_names = kNoNames;
  listener_.io.ioctl = on_ioctl;
  // Last, so that simavr's own have done theirs.
  avr_io_t* last = avr->io_port;
  while (last->next != nullptr)
    last = last->next;
  last->next = &listener_.io;

  for (int i = 0; i < avr->interrupts.vector_count; ++i) {
    vectors_.push_back(std::make_unique<Vector>(Vector{this, avr->interrupts.vector[i], {}, 0}));
    avr_irq_register_notify(&avr->interrupts.vector[i]->irq[AVR_INT_IRQ_RUNNING], on_running,
                            vectors_.back().get());
  }
  paint_ram();
  avr_reset(avr);
  chip_.set(kMcusr, kPowerOnReset);
  reset_peripherals();
}

void Uno::paint_ram() {
  avr_t* avr = chip_.avr();
  memset(avr->data + kRamStart, kPaint, avr->ramend + 1u - kRamStart);
}

Uno::~Uno() {
  // It is no peripheral that simavr may free.
  for (avr_io_t* io = chip_.avr()->io_port; io != nullptr; io = io->next) {
    if (io->next == &listener_.io)
      io->next = nullptr;
  }
}

int Uno::on_ioctl(avr_io_t* io, uint32_t request, void*) {
  Uno& uno = *reinterpret_cast<Listener*>(io)->uno;
  if (request == AVR_IOCTL_WATCHDOG_RESET) {
    uno.watchdog_.feed();
  } else if (request == AVR_IOCTL_FLASH_SPM) {
    uno.flash_.store_program_memory();
  } else {
    return -1;
  }
  return 0;
}

void Uno::reset_peripherals() {
  usart_.reset();
  twi_.reset();
  pins_.reset();
  watchdog_.reset();
  usb_.reset();
  eeprom_.reset();
  adc_.reset();
  flash_.reset();
  sensor_.keep_sampling();
  d2_.reset();
  if (run_end_ > chip_.cycle())  // a reset empties simavr's list of events
    end_.set(run_end_);
}

void Uno::press_reset() {
  restart(kExternalReset);
}

void Uno::restart(uint8_t cause) {
  ++resets_;
  const Cycle now = chip_.cycle();
  const uint8_t flags = static_cast<uint8_t>(chip_.get(kMcusr) | cause);
  avr_reset(chip_.avr());
  chip_.avr()->cycle = now;
  chip_.set(kMcusr, flags);
  reset_peripherals();
}

void Uno::cycle_power(uint8_t torn) {
  eeprom_.cut(torn);
  sensor_.power_up();
  chip_.set(kMcusr, 0);
  restart(kPowerOnReset);
  paint_ram();
  resets_ = 0;
}

void Uno::set_supply(double volts) {
  adc_.set_supply(volts);
  const bool low = volts < kBrownOutVolts;
  if (low && !held_) {
    eeprom_.cut(0);
    restart(kBrownOutReset);
  }
  held_ = low;
}

void Uno::load(uint16_t address, const uint8_t* data, size_t size) {
  memcpy(chip_.avr()->flash + address, data, size);
}

void Uno::set_start(uint16_t address) {
  chip_.avr()->reset_pc = address;
  if (chip_.cycle() == 0)
    chip_.avr()->pc = address;
}

void Uno::hold_program(Cycle from, Cycle duration) {
  hold_cycles_ = duration;
  hold_.set(from);
}

void Uno::on_running(avr_irq_t*, uint32_t running, void* entry) {
  Vector& vector = *static_cast<Vector*>(entry);
  avr_t* avr = vector.uno->chip_.avr();
  if (running) {
    vector.entered = avr->cycle;
    if (vector.vector->vector == vector.uno->watchdog_.vector())
      vector.uno->watchdog_.entered();
    avr->cycle += kInterruptCycles;
    avr->run_cycle_count -= std::min<avr_cycle_count_t>(avr->run_cycle_count, kInterruptCycles);
    avr->run_cycle_count = std::max<avr_cycle_count_t>(avr->run_cycle_count, 1);
    return;
  }
  const Cycle took = avr->cycle + kRetiCycles - vector.entered;
  ++vector.time.count;
  vector.time.total += took;
  vector.time.longest = std::max(vector.time.longest, took);
  // After RETI the part runs one more instruction, simavr 1.6 two.
  if (avr->interrupt_state == -2)
    avr->interrupt_state = -1;
}

void Uno::run(Cycle end, bool stop_after_frame) {
  avr_t* avr = chip_.avr();
  run_end_ = end;
  if (chip_.cycle() >= end)
    return;
  if (held_ || crashed()) {
    chip_.avr()->cycle = end;
    return;
  }
  end_.set(end);
  size_t seen = usb_.for_host().size();
  while (chip_.cycle() < end) {
    // simavr runs instructions in a burst until its next event.
    avr->run_cycle_limit = watching_ ? 1 : kBurst;
    if (watching_)
      avr->run_cycle_count = 1;
    const Cycle before = chip_.cycle();
    avr_run(avr);
    if (crashed())
      break;
    if (chip_.cycle() < before)
      avr->cycle = before;
    if (bitten_) {
      bitten_ = false;
      restart(kWatchdogReset);
    }
    if (watching_) {
      const bool off = !avr->sreg[S_I];
      if (off && !was_off_) {
        off_since_ = before;
        off_at_ = avr->pc;
      } else if (!off && was_off_ && chip_.cycle() - off_since_ > longest_off_) {
        longest_off_ = chip_.cycle() - off_since_;
        longest_off_at_ = off_at_;
      }
      was_off_ = off;
    }
    if (stop_after_frame && usb_.for_host().size() > seen) {
      seen = usb_.for_host().size();
      if (usb_.present() || usb_.for_host().back().value == 0)
        break;
    }
  }
  end_.cancel();
}

void Uno::watch_interrupts(bool on) {
  watching_ = on;
  was_off_ = !chip_.avr()->sreg[S_I];
  off_since_ = chip_.cycle();
  longest_off_ = 0;
}

HandlerTime Uno::handler(int number) const {
  for (const auto& vector : vectors_) {
    if (vector->vector->vector == number)
      return vector->time;
  }
  return {};
}

int Uno::stack_bytes() const {
  const avr_t* avr = const_cast<Chip&>(chip_).avr();
  // Up from the variables' end: what was never touched still has its paint.
  uint16_t longest_start = 0, longest = 0, start = kRamStart, run = 0;
  for (uint16_t address = kRamStart; address <= avr->ramend; ++address) {
    if (avr->data[address] == kPaint) {
      if (run++ == 0)
        start = address;
      if (run > longest) {
        longest = run;
        longest_start = start;
      }
    } else {
      run = 0;
    }
  }
  return avr->ramend + 1 - (longest_start + longest);
}

}  // namespace uno
}  // namespace setae
