#include "contact/rest_level.h"

namespace setae {

void RestLevel::take(int32_t raw, Follow follow) {
  const int32_t sample = raw * kScale;
  if (!known_) {
    scaled_ = sample;
    known_ = true;
    return;
  }
  const int32_t off = sample - scaled_;
  switch (follow) {
    case Follow::kClosely:
      scaled_ += off / kClosely;
      break;
    case Follow::kSlowly:
      if (off < kNearRaw * kScale && off > -kNearRaw * kScale)
        scaled_ += off / kSlowly;
      break;
    case Follow::kNot:
      break;
  }
}

}  // namespace setae
