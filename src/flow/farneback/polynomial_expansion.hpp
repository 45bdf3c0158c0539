// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace eventcamera {

/// Quadratic polynomials fitted to an image around each pixel with Gaussian weights: b_y y + b_x x
/// + a_yy y^2 + a_xx x^2 + a_xy x y, with (0, 0) at the pixel. The constant term, which flow does
/// not need, is left out.
class PolynomialExpansion {
 public:
  static constexpr int coefficients = 5;  ///< in the order above
  static constexpr int reach = 5;         ///< pixels each way from the centre of a fit
  using Window = std::array<const float*, 2 * reach + 1>;  ///< rows y - reach ... y + reach

  PolynomialExpansion() = default;
  PolynomialExpansion(int width, int height);

  int width() const { return width_; }
  int height() const { return height_; }
  /// Floats from one row to the next.
  int stride() const { return coefficients * (width_ + 1); }
  /// Polynomials of a row. One more past its end may be read, which is finite, and two rows of
  /// zeros below the last row.
  const float* row(int y) const { return data_.data() + std::ptrdiff_t{y} * stride(); }

  struct Scratch {
    std::array<std::vector<float>, 3> column_sums;
    std::vector<float> coefficients;
  };
  /// Fits row y.
  void fit(int y, const Window& window, Scratch& scratch);

 private:
  int width_ = 0;
  int height_ = 0;
  std::vector<float> data_;
};

/// Kernels of the least-squares fit, which is separable: each coefficient is one kernel along the
/// columns, then one along the rows. Only the half from the centre on is stored; `slope` is odd,
/// the others are even.
struct FitKernels {
  static constexpr int count = PolynomialExpansion::reach + 1;
  FitKernels();

  float smooth[count];  ///< Gaussian
  float slope[count];   ///< for x, with `smooth` across; for x y, with `slope` across
  float bend[count];    ///< for x^2, with `smooth` across
};

}  // namespace eventcamera
