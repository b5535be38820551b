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

bool Cholesky::factor(const Matrix& matrix, int size, double shift) {
  size_ = size;
  for (int m = 0; m < size; ++m) {
    for (int k = 0; k <= m; ++k) {
      double sum = matrix[m][k] + (m == k ? shift : 0);
      for (int l = 0; l < k; ++l)
        sum -= factor_[m][l] * factor_[k][l];
      if (m > k) {
        factor_[m][k] = sum / factor_[k][k];
      } else if (sum > 1e-3) {
        factor_[m][m] = std::sqrt(sum);
      } else {
        return false;
      }
    }
  }
  return true;
}

Modes Cholesky::solve(const Modes& right) const {
  Modes out{};
  for (int m = 0; m < size_; ++m) {
    double sum = right[m];
    for (int k = 0; k < m; ++k)
      sum -= factor_[m][k] * out[k];
    out[m] = sum / factor_[m][m];
  }
  for (int m = size_ - 1; m >= 0; --m) {
    double sum = out[m];
    for (int k = m + 1; k < size_; ++k)
      sum -= factor_[k][m] * out[k];
    out[m] = sum / factor_[m][m];
  }
  return out;
}

}  // namespace sim
}  // namespace setae
