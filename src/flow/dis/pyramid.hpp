// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "src/core/image.hpp"

namespace eventcamera {

/// Shrinks images, row by row: a pixel becomes the mean over its area.
class AreaShrink {
 public:
  AreaShrink(int from_width, int from_height, int width, int height);

  int width() const { return columns_.size(); }
  int height() const { return rows_.size(); }
  /// Writes row y to `out`. `sums` is scratch.
  void row(const ImageView<std::uint8_t>& image, int y, std::vector<float>& sums,
           std::uint8_t* out) const;

 private:
  /// Coverage of each pixel by a shrunk pixel along one axis, in integers that add up to `from`, so
  /// that sums are exact.
  struct Axis {
    Axis(int from, int to);
    int size() const { return static_cast<int>(first.size()); }
    const float* weights_of(int i) const { return weights.data() + std::ptrdiff_t{i} * taps; }

    int from;
    int taps = 1;
    std::vector<int> first;
    std::vector<float> weights;
  };

  Axis columns_;
  Axis rows_;
};

/// Level of an image pyramid, with replicated pixels around it.
class PyramidImage {
 public:
  static constexpr int margin = 16;

  PyramidImage(int width, int height) : grey_(width, height, margin) {}

  const Image<std::uint8_t>& grey() const { return grey_; }
  void shrink_row(const AreaShrink& shrink, const ImageView<std::uint8_t>& image, int y,
                  std::vector<float>& sums);
  /// Fills the rows above and below, once all rows are computed.
  void replicate_rows();

 private:
  Image<std::uint8_t> grey_;
};

/// Gradients of an image, as by the Sobel operator: eight times the slope in grey levels per pixel;
/// the slope across a border is 0.
class Gradients {
 public:
  Gradients(int width, int height) : x_(width, height), y_(width, height) {}

  const Image<std::int16_t>& x() const { return x_; }
  const Image<std::int16_t>& y() const { return y_; }
  /// Computes row y. `scratch` holds sums over columns.
  void row(const Image<std::uint8_t>& image, int y, std::vector<std::int16_t>& scratch);

 private:
  Image<std::int16_t> x_;
  Image<std::int16_t> y_;
};

}  // namespace eventcamera
