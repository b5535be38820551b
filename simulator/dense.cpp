#include "dense.h"

namespace setae {
namespace sim {

double inner(const Modes& a, const Modes& b) {
  double sum = 0;
  for (int m = 0; m < kMaxModes; ++m)
    sum += a[m] * b[m];
  return sum;
}

double length(const Modes& a) {
  return std::sqrt(inner(a, a));
}

// Column by column, each taken from all that follow: no sum waits for its last term.
bool Cholesky::factor(const Matrix& matrix, int size, double shift) {
  size_ = size;
  for (int k = 0; k < size; ++k) {
    for (int m = k; m < size; ++m)
      columns_[k][m] = matrix[m][k];
    columns_[k][k] += shift;
  }
  for (int k = 0; k < size; ++k) {
    Modes& column = columns_[k];
    if (!(column[k] > 1e-3))
      return false;
    inverse_[k] = 1 / std::sqrt(column[k]);
    for (int m = k + 1; m < size; ++m)
      column[m] *= inverse_[k];
    for (int l = k + 1; l < size; ++l) {
      const double weight = column[l];
      Modes& later = columns_[l];
      for (int m = l; m < size; ++m)
        later[m] -= weight * column[m];
    }
  }
  return true;
}

Modes Cholesky::solve(const Modes& right) const {
  Modes out = right;
  for (int k = 0; k < size_; ++k) {
    out[k] *= inverse_[k];
    for (int m = k + 1; m < size_; ++m)
      out[m] -= columns_[k][m] * out[k];
  }
  for (int k = size_ - 1; k >= 0; --k) {
    double sum = out[k];
    for (int m = k + 1; m < size_; ++m)
      sum -= columns_[k][m] * out[m];
    out[k] = sum * inverse_[k];
  }
  for (int m = size_; m < kMaxModes; ++m)
    out[m] = 0;
  return out;
}

}  // namespace sim
}  // namespace setae
