// Random numbers that are the same on every machine: xoshiro256** seeded by
// splitmix64, and normal deviates by Box and Muller.
#pragma once

#include <stdint.h>

namespace setae {
namespace sim {

class Random {
 public:
  // Streams of one seed are independent, so that a change of one part's noise
  // leaves the others' as it was.
  Random(uint64_t seed, uint64_t stream);

  uint64_t next();
  double uniform();  // above 0, up to 1
  double normal();

 private:
  uint64_t state_[4];
  double spare_ = 0;
  bool has_spare_ = false;
};

}  // namespace sim
}  // namespace setae
