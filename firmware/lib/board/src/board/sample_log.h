// Pressure samples since the last telemetry.
#pragma once

#include <stdint.h>

#include "hal/hal.h"

namespace setae {

class SampleLog {
 public:
  struct Entry {
    int32_t pressure_raw;
    BoardTime sampled;
  };

  void clear() { size_ = 0; }
  uint8_t size() const { return size_; }
  const Entry& operator[](uint8_t index) const { return entries_[index]; }

  // The newest stay.
  void add(int32_t pressure_raw, const BoardTime& sampled) {
    if (size_ == protocol::kTelemetrySamples) {
      for (uint8_t i = 1; i < size_; ++i)
        entries_[i - 1] = entries_[i];
      --size_;
    }
    entries_[size_++] = {pressure_raw, sampled};
  }

 private:
  Entry entries_[protocol::kTelemetrySamples] = {};
  uint8_t size_ = 0;
};

}  // namespace setae
