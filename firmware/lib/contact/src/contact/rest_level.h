// What the sensor reads when the bristle touches nothing: a running mean that follows weather
// and warm-up, and must not follow a contact.
#pragma once

#include <stdint.h>

namespace setae {

class RestLevel {
 public:
  enum class Follow : uint8_t {
    kClosely,  // relaxed: the robot is at its free length
    kSlowly,   // at rest with pulses on: only samples near the mean
    kNot,      // moving, guarded or frozen
  };

  bool known() const { return known_; }
  // scaled_ / kScale, without the 45 us of the UNO's division.
  int32_t raw() const { return (scaled_ < 0 ? scaled_ + (kScale - 1) : scaled_) >> kScaleBits; }

  void take(int32_t raw, Follow follow);

 private:
  // 1260 hPa are 23 bits, so eight more fit.
  static constexpr uint8_t kScaleBits = 8;
  static constexpr int32_t kScale = 1 << kScaleBits;
  static constexpr int32_t kClosely = 16;  // samples: 0.2 s
  static constexpr int32_t kSlowly = 512;  // samples: 7 s
  // 5 hPa: weather and warm-up stay below it for as long as the mean follows.
  static constexpr int32_t kNearRaw = 5 * 4096;

  int32_t scaled_ = 0;
  bool known_ = false;
};

}  // namespace setae
