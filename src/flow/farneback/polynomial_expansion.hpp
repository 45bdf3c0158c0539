// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace eventcamera {

/// Quadratic polynomials fitted to a picture around each pixel, with a Gaussian weight:
/// b_y y + b_x x + a_yy y^2 + a_xx x^2 + a_xy x y, with (0, 0) at the pixel. The constant, which
/// does not depend on motion, is left out.
class PolynomialExpansion {
 public:
  static constexpr int coefficients = 5;                   ///< in the order above
  static constexpr int reach = 5;                          ///< pixels each way of a fit
  using Window = std::array<const float*, 2 * reach + 1>;  ///< rows y - reach ... y + reach

  PolynomialExpansion() = default;
  PolynomialExpansion(int width, int height);

  int width() const { return width_; }
  int height() const { return height_; }
  /// Floats from one row to the next.
  int stride() const { return coefficients * (width_ + 1); }
  /// The polynomials of a row. One more on the right may be read, which is finite, and two rows of
  /// zeros below the last one.
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

/// The kernels of the least-squares fit, which is separable: each coefficient is one kernel along
/// the columns, then one along the rows. Halves from the centre on; the slope is odd, the others
/// even.
struct FitKernels {
  static constexpr int count = PolynomialExpansion::reach + 1;
  FitKernels();

  float smooth[count];  ///< the Gaussian
  float slope[count];   ///< of x with `smooth` across, and of x y with `slope` across
  float bend[count];    ///< of x^2 with `smooth` across
};

}  // namespace eventcamera
