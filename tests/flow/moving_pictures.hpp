// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <ostream>

#include "src/flow/dense_flow.hpp"
#include "tests/simulate/scene.hpp"

/// Pictures to find the flow between, and flows to compare.
namespace eventcamera {

using Picture = Image<std::uint8_t>;

/// A sequence.
struct Pictures {
  int width;
  int height;
  bool noise;  ///< unrelated pictures; else a moving texture

  Picture at(int i) const {
    if (noise) return scene::noise<std::uint8_t>(width, height, 8, 1 + i);
    return scene::texture<std::uint8_t>(width, height, 8, 2.3 * i, -1.4 * i);
  }
};

inline void PrintTo(const Pictures& pictures, std::ostream* out) {
  *out << pictures.width << "x" << pictures.height << (pictures.noise ? "_noise" : "_texture");
}

inline Image<Flow> copy(const ImageView<Flow>& flow) {
  Image<Flow> result(flow.width, flow.height);
  result.assign(flow);
  return result;
}

/// True if all bytes are equal.
inline bool equal(const Image<Flow>& a, const Image<Flow>& b) {
  if (a.width() != b.width() || a.height() != b.height()) return false;
  const auto row_size = static_cast<std::size_t>(a.width()) * sizeof(Flow);
  for (int y = 0; y < a.height(); ++y)
    if (std::memcmp(a.row(y), b.row(y), row_size) != 0) return false;
  return true;
}

/// Distance in pixels between what two flows point at.
struct Difference {
  double mean = 0;
  double max = 0;
};

/// `b` may be larger.
inline Difference difference(const Image<Flow>& a, const Image<Flow>& b) {
  Difference result;
  for (int y = 0; y < a.height(); ++y) {
    for (int x = 0; x < a.width(); ++x) {
      const double error = std::hypot(a.at(x, y).x - b.at(x, y).x, a.at(x, y).y - b.at(x, y).y);
      result.mean += error / (a.width() * a.height());
      result.max = std::max(result.max, error);
    }
  }
  return result;
}

}  // namespace eventcamera
