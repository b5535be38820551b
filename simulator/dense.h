// The small symmetric systems of Newton's method.
#pragma once

#include "rod.h"

namespace setae {
namespace sim {

using Matrix = std::array<Modes, kMaxModes>;

double inner(const Modes& a, const Modes& b);
double length(const Modes& a);

class Cholesky {
 public:
  // Of the lower half of the leading `size` rows. False where the matrix, with
  // `shift` added to its diagonal, is not well positive.
  bool factor(const Matrix& matrix, int size, double shift);
  Modes solve(const Modes& right) const;

 private:
  int size_ = 0;
  Matrix columns_;  // of the lower factor: columns_[k][m] below the diagonal at m > k
  Modes inverse_;   // of the diagonal
};

}  // namespace sim
}  // namespace setae
