// One I2C register transfer at a time, byte by byte in the interrupt: however busy the loop is, a
// transfer takes 0.2 ms. No call waits, and what takes too long is given up. (The Arduino Wire
// library waits for ever on a stuck bus.)
#pragma once

#include <stdint.h>

namespace setae {

class Twi {
 public:
  static constexpr uint8_t kReadMax = 4;

  enum class Result : uint8_t {
    kIdle,
    kBusy,
    kDone,    // once for each transfer, as are the next two
    kNoAck,   // nobody answers at the address
    kFailed,  // the bus is stuck or disturbed
  };

  // There is one bus, and its handler serves the last one that began.
  void begin();

  // Only after a result other than kBusy.
  void start_write(uint8_t address, uint8_t reg, uint8_t value);
  void start_read(uint8_t address, uint8_t reg, uint8_t size);
  // Makes ready to read a status and a value of three bytes, and again until the status has one of
  // these bits or the value is another than that of the time before, but not more often than that.
  void prepare_polling(uint8_t address, uint8_t reg, uint8_t bits, uint8_t most);
  // For the handler that begins it.
  void go();

  Result poll();
  // Until poll() has told how it ended.
  bool pending() const { return !told_; }
  const uint8_t* data() const { return data_; }
  // How polling went: what data() has is new; how often it was read in vain; and when the last read
  // began, in servo_pulses::ticks().
  bool found() const { return found_; }
  uint8_t misses() const { return misses_; }
  uint16_t begun_ticks() const { return begun_ticks_; }

  // Frees a bus that a slave holds, cut off in the middle of a byte. Takes 0.1 ms.
  void recover();

  // For the handler.
  void advance();

 private:
  void prepare(uint8_t address, uint8_t reg, uint8_t size, bool reading);
  void start(uint8_t address, uint8_t reg, uint8_t size, bool reading);
  void begin_transfer();
  void finish(Result result);
  bool again();

  uint8_t address_ = 0;
  uint8_t reg_ = 0;
  uint8_t size_ = 0;
  bool reading_ = false;
  bool begun_ = false;  // the START is on its way
  // The handler's, while a transfer runs.
  volatile bool told_ = true;
  volatile uint16_t begun_ticks_ = 0;
  uint8_t moved_ = 0;  // bytes
  bool reg_sent_ = false;
  uint8_t bits_ = 0;
  uint8_t tries_ = 0;
  uint8_t misses_ = 0;
  bool found_ = false;
  volatile Result result_ = Result::kIdle;
  uint8_t data_[kReadMax] = {};
  uint8_t last_[kReadMax - 1] = {};
  bool seen_ = false;  // last_ is a sample
};

}  // namespace setae
