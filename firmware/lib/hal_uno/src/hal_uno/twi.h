// One I2C register transfer at a time, byte by byte in the interrupt: however busy the loop is, a
// transfer takes 0.2 ms. No call waits, and what takes too long is given up. (The Arduino Wire
// library waits for ever on a stuck bus.)
#pragma once

#include <stdint.h>

namespace setae {

class Twi {
 public:
  static constexpr uint8_t kReadMax = 3;

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

  Result poll();
  const uint8_t* data() const { return data_; }

  // Frees a bus that a slave holds, cut off in the middle of a byte. Takes 0.1 ms.
  void recover();

  // For the handler.
  void advance();

 private:
  void start(uint8_t address, uint8_t reg, uint8_t size, bool reading);
  void begin_transfer();
  void finish(Result result);

  uint8_t address_ = 0;
  uint8_t reg_ = 0;
  uint8_t size_ = 0;
  bool reading_ = false;
  bool running_ = false;
  bool begun_ = false;  // the START is on its way
  uint16_t begun_ticks_ = 0;
  // The handler's, while a transfer runs.
  uint8_t moved_ = 0;  // bytes
  bool reg_sent_ = false;
  volatile Result result_ = Result::kIdle;
  uint8_t data_[kReadMax] = {};
};

}  // namespace setae
