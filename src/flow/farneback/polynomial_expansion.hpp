// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <vector>

#include "src/core/image.hpp"
#include "src/flow/scratch.hpp"

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
  /// Coefficient k of each polynomial of a row; coefficient k + 1 is `stride` floats further on.
  /// `row_padding` more to the left, twice as many to the right, and two rows below the last one
  /// may be read, and are finite.
  const float* row(int y, int k = 0) const { return planes_.row(coefficients * y + k); }
  /// Floats.
  std::ptrdiff_t stride() const {
    return planes_.stride() / static_cast<std::ptrdiff_t>(sizeof(float));
  }

  using Scratch = std::array<std::vector<float>, 3>;  ///< sums along the columns
  /// Fits row y.
  void fit(int y, const Window& window, Scratch& scratch);

 private:
  int width_ = 0;
  int height_ = 0;
  Image<float> planes_;  ///< a row of each coefficient in turn
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
