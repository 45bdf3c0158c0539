// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>

#include "src/simulate/simulators.hpp"
#include "tests/reference/differences.hpp"

namespace eventcamera::reference {

/// I(x, y): bilinear, positions rounded to 1/64 of a pixel, border replicated.
template <class Pixel>
double bilinear(const Image<Pixel>& picture, double x, double y) {
  const double qx = std::clamp(std::floor(x * 64 + 0.5) / 64, 0.0, picture.width() - 1.0);
  const double qy = std::clamp(std::floor(y * 64 + 0.5) / 64, 0.0, picture.height() - 1.0);
  const int x0 = static_cast<int>(qx);
  const int y0 = static_cast<int>(qy);
  const int x1 = std::min(x0 + 1, picture.width() - 1);
  const int y1 = std::min(y0 + 1, picture.height() - 1);
  const double right = qx - x0;
  const double down = qy - y0;
  return (1 - down) * ((1 - right) * picture.at(x0, y0) + right * picture.at(x1, y0)) +
         down * ((1 - right) * picture.at(x0, y1) + right * picture.at(x1, y1));
}

/// I(j/m) for 0 <= j <= m, with I(1) = now.
///   forward: last(x - a F(x))
///   blend:   (1 - a) last(x - a F(x)) + a now(x + (1 - a) F(x)), the weight a to 1/256
template <class Pixel>
Image<Pixel> interpolate(const Image<Pixel>& last, const Image<Pixel>& now,
                         const ImageView<Flow>& flow, int j, int m, Interpolation interpolation) {
  if (j == m) return now;
  const double a = std::floor(256.0 * j / m + 0.5) / 256;
  Image<Pixel> between(last.width(), last.height());
  for (int y = 0; y < last.height(); ++y) {
    for (int x = 0; x < last.width(); ++x) {
      const double dx = motion_per_step(flow.row(y)[x].x, m) / 65536.0;
      const double dy = motion_per_step(flow.row(y)[x].y, m) / 65536.0;
      double value = bilinear(last, x - j * dx, y - j * dy);
      if (interpolation == Interpolation::blend)
        value = (1 - a) * value + a * bilinear(now, x + (m - j) * dx, y + (m - j) * dy);
      between.at(x, y) = static_cast<Pixel>(std::floor(value + 0.5));
    }
  }
  return between;
}

template <class Pixel>
std::vector<Event> dense(const Image<Pixel>& last, const Image<Pixel>& now,
                         const ImageView<Flow>& flow, Interpolation interpolation,
                         const StepTimes& steps, const Thresholds& thresholds) {
  Sequence<Pixel> sequence;
  for (int j = 0; j <= steps.count(); ++j)
    sequence.push_back(interpolate(last, now, flow, j, steps.count(), interpolation));
  return differences(sequence, steps, thresholds);
}

}  // namespace eventcamera::reference
