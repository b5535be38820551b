// The C interface that ../simavr.py loads. No call keeps a pointer beyond its return.
#include <string.h>

#include <algorithm>
#include <exception>
#include <string>

#include "uno.h"

using setae::uno::Uno;

namespace {

std::string error;

}  // namespace

extern "C" {

struct uno_edge {
  uint64_t cycle;
  uint32_t servo;
  uint32_t level;
};

struct uno_sample {
  uint64_t ready;
  int64_t raw;
};

struct uno_statistics {
  uint64_t receive_overruns;
  uint64_t receive_frame_errors;
  uint64_t receive_longest_wait;
  uint64_t interrupts_off_longest;
  uint64_t interrupts_off_at;
  uint64_t stack_bytes;
  uint64_t resets;
  uint64_t turns;
  uint64_t eeprom_writes;
  uint64_t timers_misused;
  uint64_t crashed;
};

Uno* uno_create(const char* elf_path) {
  try {
    return new Uno(elf_path);
  } catch (const std::exception& problem) {
    error = problem.what();
    return nullptr;
  }
}

const char* uno_error() {
  return error.c_str();
}

void uno_destroy(Uno* uno) {
  delete uno;
}

void uno_press_reset(Uno* uno) {
  uno->press_reset();
}

void uno_cycle_power(Uno* uno, uint8_t torn) {
  uno->cycle_power(torn);
}

void uno_supply(Uno* uno, double volts) {
  uno->set_supply(volts);
}

void uno_bandgap(Uno* uno, double volts) {
  uno->adc().set_bandgap(volts);
}

void uno_load(Uno* uno, uint16_t address, const uint8_t* data, size_t size) {
  uno->load(address, data, size);
}

uint8_t uno_flash_get(Uno* uno, uint16_t address) {
  return uno->chip().avr()->flash[address];
}

void uno_start(Uno* uno, uint16_t address) {
  uno->set_start(address);
}

uint8_t uno_eeprom_get(Uno* uno, uint16_t address) {
  return uno->eeprom().get(address);
}

void uno_eeprom_set(Uno* uno, uint16_t address, uint8_t value) {
  uno->eeprom().set(address, value);
}

uint64_t uno_cycle(Uno* uno) {
  return uno->chip().cycle();
}

void uno_run(Uno* uno, uint64_t end, int stop_after_frame) {
  uno->run(end, stop_after_frame != 0);
}

void uno_send(Uno* uno, const uint8_t* data, size_t size, uint64_t earliest, double bit_cycles) {
  for (size_t i = 0; i < size; ++i)
    uno->usart().send(data[i], earliest, bit_cycles);
}

// When the last byte sent to the board has passed.
uint64_t uno_line_free(Uno* uno) {
  return uno->usart().line_free();
}

// Returns how many; `end` is when the last of them had passed.
size_t uno_receive(Uno* uno, uint8_t* data, size_t room, uint64_t* end) {
  auto& sent = uno->usb().for_host();
  size_t count = 0;
  for (; count < room && !sent.empty(); ++count) {
    data[count] = sent.front().value;
    *end = sent.front().end;
    sent.pop_front();
  }
  return count;
}

size_t uno_edges(Uno* uno, uno_edge* out, size_t room) {
  auto& edges = uno->pins().edges();
  const size_t count = std::min(room, edges.size());
  for (size_t i = 0; i < count; ++i)
    out[i] = {edges[i].cycle, edges[i].servo, edges[i].level};
  edges.erase(edges.begin(), edges.begin() + static_cast<std::ptrdiff_t>(count));
  return count;
}

size_t uno_samples(Uno* uno, uno_sample* out, size_t room) {
  auto& samples = uno->sensor().samples();
  const size_t count = std::min(room, samples.size());
  for (size_t i = 0; i < count; ++i)
    out[i] = {samples[i].ready, samples[i].raw};
  samples.erase(samples.begin(), samples.begin() + static_cast<std::ptrdiff_t>(count));
  return count;
}

void uno_sensor_pressure(Uno* uno, uint64_t from, int32_t raw) {
  uno->sensor().set_pressure(from, raw);
}

// When the sensor takes its next sample; 0: it takes none.
uint64_t uno_sensor_next(Uno* uno) {
  return uno->sensor().next_sample();
}

void uno_sensor_rate(Uno* uno, double relative) {
  uno->sensor().set_rate(relative);
}

void uno_sensor_present(Uno* uno, int present) {
  uno->sensor().set_present(present != 0);
}

void uno_sensor_silent(Uno* uno, int silent) {
  uno->sensor().set_silent(silent != 0);
}

void uno_sensor_identity(Uno* uno, uint8_t identity) {
  uno->sensor().set_identity(identity);
}

void uno_sensor_ready_wired(Uno* uno, int wired) {
  uno->d2().set_wired(wired != 0);
}

void uno_stop_switch_closed(Uno* uno, int closed) {
  uno->d2().set_switch_closed(closed != 0);
}

void uno_hold_program(Uno* uno, uint64_t from, uint64_t duration) {
  uno->hold_program(from, duration);
}

uint32_t uno_program_counter(Uno* uno) {
  return uno->program_counter();
}

int uno_interrupts_on(Uno* uno) {
  return uno->interrupts_on();
}

void uno_usb_chip(Uno* uno, int present) {
  uno->usb().set_present(present != 0);
}

void uno_sensor_address(Uno* uno, uint8_t address) {
  uno->sensor().set_address(address);
}

void uno_stick_bus(Uno* uno, int clocks) {
  uno->twi().stick(clocks);
}

void uno_watch_interrupts(Uno* uno, int on) {
  uno->watch_interrupts(on != 0);
}

void uno_statistics_get(Uno* uno, uno_statistics* out) {
  *out = {uno->usart().overruns(),
          uno->usart().frame_errors(),
          uno->usart().longest_wait(),
          uno->longest_interrupts_off(),
          uno->longest_off_at(),
          static_cast<uint64_t>(uno->stack_bytes()),
          static_cast<uint64_t>(uno->resets()),
          uno->turns(),
          uno->eeprom().writes(),
          uno->pins().timer0().misused() || uno->pins().timer1().misused() ||
              uno->pins().timer2().misused(),
          uno->crashed()};
}

void uno_handler(Uno* uno, int vector, uint64_t* count, uint64_t* total, uint64_t* longest) {
  const setae::uno::HandlerTime time = uno->handler(vector);
  *count = time.count;
  *total = time.total;
  *longest = time.longest;
}

// A byte of the data space, without the side effects of reading it.
uint8_t uno_peek(Uno* uno, uint16_t address) {
  return uno->chip().get(address);
}

// The last cycle at which timer 1 became `count`.
uint64_t uno_timer1_was_at(Uno* uno, uint32_t count) {
  return uno->pins().timer1().was_at(count);
}

}  // extern "C"
