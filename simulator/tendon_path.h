// A taut tendon is the shortest string between its two holes that stays inside
// the spring's bore.
#pragma once

#include <array>

#include "rod.h"

namespace setae {
namespace sim {

class TendonPath {
 public:
  // Finds the path from `base` (on the base plate, frame D) to the hole `top` (in
  // the last station's frame). Starts from the path of the last call. Any path shorter than
  // `slack_mm` will do: the tendon is slack then.
  void solve(const Shape& shape, const Vec3& base, const Vec3& top, double bore_radius_mm,
             double slack_mm);

  // Takes another's path as the start of the next call's.
  void start_from(const TendonPath& other);

  // Length, a soft bore's small energy included: exactly the function whose
  // gradient wrenches() holds.
  double length_mm() const { return length_mm_; }

  // Derivative of the length by a small body motion of each station.
  const Wrenches& wrenches() const { return wrenches_; }

  // The same where friction on the bore lets the tension fall by exp(-decay * angle)
  // from the base on, beside its derivative by `decay`. Only where it touches.
  void wrenches(const Shape& shape, double decay, Wrenches& out, Wrenches& by_decay) const;

  bool touches_bore() const { return touches_; }
  // False where the path did not settle; its length is then an upper bound.
  bool converged() const { return converged_; }

 private:
  bool straight(const Shape& shape, double bore_radius_mm);
  void bend(const Shape& shape, double bore_radius_mm, double slack_mm);

  struct Crossing {
    double u, v;
  };
  std::array<Crossing, kMaxStations> crossing_{};  // of the plane of each inner station
  std::array<Vec3, kMaxStations> point_{};
  std::array<Vec3, kMaxElements> direction_{};  // of its pieces, where it touches
  Vec3 top_{};
  Wrenches wrenches_{};
  double length_mm_ = 0;
  bool touches_ = false;
  bool converged_ = true;
};

}  // namespace sim
}  // namespace setae
