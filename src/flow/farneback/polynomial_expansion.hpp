// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "src/core/image.hpp"
#include "src/flow/resampling.hpp"

namespace eventcamera {

/// Blurs an image with a Gaussian and shrinks it to 1 / 2^level of its size, row by row. The blur,
/// about half a pixel of the shrunk image, prevents aliasing; on level 0 it reduces noise.
class PyramidLevel {
 public:
  struct Scratch {
    std::vector<float> column_sums;
    std::vector<float> blurred;
  };

  PyramidLevel(int width, int height, int level);

  int width() const { return columns_.size(); }
  int height() const { return rows_.size(); }
  /// Weights of the blur along each axis, an odd number.
  const std::vector<float>& kernel() const { return kernel_; }
  /// Writes row y to `out`, which must have row_padding elements past its end.
  void row(const ImageView<std::uint8_t>& image, int y, Scratch& scratch, float* out) const;

 private:
  bool full_size_;
  std::vector<float> kernel_;
  Resampling columns_;
  Resampling rows_;
};

/// Quadratic polynomials fitted to an image around each pixel with Gaussian weights: b_y y + b_x x
/// + a_yy y^2 + a_xx x^2 + a_xy x y, with (0, 0) at the pixel. The constant term is omitted,
/// because flow does not need it.
class PolynomialExpansion {
 public:
  static constexpr int coefficients = 5;  ///< in the order above
  static constexpr int reach = 5;         ///< pixels each way from the centre of a fit
  static constexpr int group = 16;  ///< pixels of a row whose coefficients are stored together
  using Window = std::array<const float*, 2 * reach + 1>;  ///< rows y - reach ... y + reach

  PolynomialExpansion() = default;
  PolynomialExpansion(int width, int height);

  int width() const { return width_; }
  int height() const { return height_; }
  /// First coefficient of the polynomial at (x, y); the others follow `group` floats apart. `group`
  /// more pixels to the right, and the row below the last one, may be read: they are finite.
  const float* at(int x, int y) const { return groups_.row(y) + place(x); }

  using Scratch = std::array<std::vector<float>, 3>;  ///< sums along the columns
  void fit(int y, const Window& window, Scratch& scratch);

 private:
  static constexpr std::size_t place(int x) {
    const auto column = static_cast<std::size_t>(x);
    return column / group * group * coefficients + column % group;
  }

  int width_ = 0;
  int height_ = 0;
  Image<float> groups_;  ///< in a group, each coefficient of all pixels in turn
};

/// Kernels of the least-squares fit, which is separable: each coefficient applies one kernel along
/// the columns, then one along the rows. Only the half from the centre on is stored; `slope` is
/// odd, the others are even.
struct FitKernels {
  static constexpr int count = PolynomialExpansion::reach + 1;
  FitKernels();

  float smooth[count];  ///< Gaussian
  float slope[count];   ///< for x, with `smooth` across; for x y, with `slope` across
  float bend[count];    ///< for x^2, with `smooth` across
};

}  // namespace eventcamera
