// Who the board listens to, and which of its reliable commands comes next.
#pragma once

#include <stdint.h>

namespace setae {

class Session {
 public:
  enum class Order : uint8_t {
    kNext,
    kOld,  // carried out already; its receipt was lost
    kGap,  // one before it was lost
  };

  uint8_t id() const { return id_; }
  bool open() const { return id_ != 0; }
  uint8_t previous() const { return previous_; }
  uint8_t expected() const { return expected_; }

  void start(uint8_t id) {
    previous_ = id_;
    id_ = id;
    expected_ = 0;
  }

  Order judge(uint8_t sequence) const {
    if (sequence == expected_)
      return Order::kNext;
    const bool behind = static_cast<uint8_t>(expected_ - sequence) < 128;
    return behind ? Order::kOld : Order::kGap;
  }
  void accept() { ++expected_; }

 private:
  uint8_t id_ = 0;  // 0 after a reset: no session
  uint8_t previous_ = 0;
  uint8_t expected_ = 0;
};

}  // namespace setae
