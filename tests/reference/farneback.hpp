// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numeric>
#include <vector>

#include "src/core/image.hpp"
#include "src/flow/dense_flow.hpp"

/// Farneback, "Two-frame motion estimation based on polynomial expansion" (SCIA 2003), with the
/// pyramid, window and border weights of OpenCV.
namespace eventcamera::reference {

/// Gaussian at -reach ... reach, normalised to a sum of 1.
inline std::vector<double> gaussian(double sigma, int reach) {
  std::vector<double> weights(2 * static_cast<std::size_t>(reach) + 1);
  for (int k = -reach; k <= reach; ++k) weights[reach + k] = std::exp(-k * k / (2 * sigma * sigma));
  const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
  for (auto& weight : weights) weight /= sum;
  return weights;
}

inline Flow operator*(const Flow& flow, double factor) {
  return {static_cast<float>(flow.x * factor), static_cast<float>(flow.y * factor)};
}
inline Flow operator+(const Flow& a, const Flow& b) {
  return {a.x + b.x, a.y + b.y};
}

/// Position between two pixels of a row.
struct Between {
  int first;
  int second;
  double weight;  ///< weight of the second

  /// Position of pixel i of a row of `to` pixels, on a row of `from` pixels.
  Between(int i, int from, int to) {
    const double place = std::clamp((i + 0.5) * from / to - 0.5, 0.0, from - 1.0);
    first = static_cast<int>(place);
    second = std::min(first + 1, from - 1);
    weight = place - first;
  }
  template <class T>
  T of(const T& a, const T& b) const {
    return a * (1 - weight) + b * weight;
  }
};

template <class T>
Image<T> resized(const Image<T>& plane, int width, int height) {
  Image<T> result(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Between column(x, plane.width(), width);
      const Between row(y, plane.height(), height);
      const auto along = [&](int line) {
        return column.of(plane.at(column.first, line), plane.at(column.second, line));
      };
      result.at(x, y) = row.of(along(row.first), along(row.second));
    }
  }
  return result;
}

/// Image blurred and shrunk to 1 / 2^level; the border is mirrored.
inline Image<double> pyramid_level(const Image<std::uint8_t>& picture, int level) {
  const double sigma = level == 0 ? std::sqrt(0.5 / std::log(2)) : ((1 << level) - 1) / 2.0;
  const int reach = level == 0 ? 1 : static_cast<int>(std::lrint(5 * sigma)) / 2;
  const auto weights = gaussian(sigma, reach);
  const auto mirrored = [](int i, int length) {
    if (length == 1) return 0;
    const int period = 2 * (length - 1);
    return std::min(std::abs(i) % period, period - std::abs(i) % period);
  };
  Image<double> blurred(picture.width(), picture.height());
  for (int y = 0; y < picture.height(); ++y)
    for (int x = 0; x < picture.width(); ++x)
      for (int v = -reach; v <= reach; ++v)
        for (int u = -reach; u <= reach; ++u)
          blurred.at(x, y) +=
              weights[reach + u] * weights[reach + v] *
              picture.at(mirrored(x + u, picture.width()), mirrored(y + v, picture.height()));
  return resized(blurred, static_cast<int>(std::lrint(picture.width() / std::pow(2, level))),
                 static_cast<int>(std::lrint(picture.height() / std::pow(2, level))));
}

/// f(x, y) ~ b_y y + b_x x + a_yy y^2 + a_xx x^2 + 2 a_xy x y + c
struct Polynomial {
  double b_y, b_x;
  double a_yy, a_xx, a_xy;
};

/// Least-squares fit around (x, y), border replicated: under the weight with moments m2 and m4, the
/// functions x, y, x y, x^2 - m2 and y^2 - m2 are orthogonal to each other and to 1.
inline Polynomial fit(const Image<double>& picture, int x, int y) {
  constexpr int reach = 5;
  const auto weights = gaussian(1.2, reach);
  double m2 = 0;
  double m4 = 0;
  for (int k = -reach; k <= reach; ++k) {
    m2 += weights[reach + k] * std::pow(k, 2);
    m4 += weights[reach + k] * std::pow(k, 4);
  }
  Polynomial p{};
  for (int v = -reach; v <= reach; ++v) {
    for (int u = -reach; u <= reach; ++u) {
      const double f = weights[reach + v] * weights[reach + u] *
                       picture.at(std::clamp(x + u, 0, picture.width() - 1),
                                  std::clamp(y + v, 0, picture.height() - 1));
      p.b_y += f * v / m2;
      p.b_x += f * u / m2;
      p.a_yy += f * (v * v - m2) / (m4 - m2 * m2);
      p.a_xx += f * (u * u - m2) / (m4 - m2 * m2);
      p.a_xy += f * u * v / (m2 * m2) / 2;
    }
  }
  return p;
}

inline Image<Polynomial> expansion(const Image<double>& picture) {
  Image<Polynomial> result(picture.width(), picture.height());
  for (int y = 0; y < picture.height(); ++y)
    for (int x = 0; x < picture.width(); ++x) result.at(x, y) = fit(picture, x, y);
  return result;
}

/// Weight of the polynomial at (x, y) in an image of this size.
inline double border_weight(int x, int y, int width, int height) {
  constexpr double weights[] = {0.14, 0.14, 0.4472, 0.4472, 0.4472};
  const auto along = [&](int i) { return i < 5 ? weights[i] : 1; };
  return along(x) * along(width - 1 - x) * along(y) * along(height - 1 - y);
}

/// A^T A d = A^T b for the flow d of one pixel, or the sum of many.
struct Equations {
  double g_yy = 0, g_xy = 0, g_xx = 0;
  double h_y = 0, h_x = 0;

  Equations& operator+=(const Equations& o) {
    g_yy += o.g_yy;
    g_xy += o.g_xy;
    g_xx += o.g_xx;
    h_y += o.h_y;
    h_x += o.h_x;
    return *this;
  }
  /// Solves the mean of `count` equations, slightly regularised.
  Flow solution(int count) const {
    const double determinant = g_yy * g_xx - g_xy * g_xy + 1e-4 * count * count;
    return {static_cast<float>((g_yy * h_x - g_xy * h_y) / determinant),
            static_cast<float>((g_xx * h_y - g_xy * h_x) / determinant)};
  }
};

/// A is the mean of the A of both polynomials, b the difference of their b plus A times the current
/// flow. The later polynomial is that at the end of the flow; there is none outside the image.
inline Equations equations(const Image<Polynomial>& from, const Image<Polynomial>& to,
                           const Flow& flow, int x, int y) {
  const Polynomial& p = from.at(x, y);
  double a_yy = p.a_yy;
  double a_xx = p.a_xx;
  double a_xy = p.a_xy;
  double b_y = p.b_y / 2;
  double b_x = p.b_x / 2;
  const double to_x = static_cast<float>(x) + flow.x;
  const double to_y = static_cast<float>(y) + flow.y;
  if (to_x >= 0 && to_x <= to.width() - 1 && to_y >= 0 && to_y <= to.height() - 1) {
    const int x0 = static_cast<int>(to_x);
    const int y0 = static_cast<int>(to_y);
    const double right = to_x - x0;
    const double down = to_y - y0;
    const auto there = [&](double Polynomial::*part) {
      const auto at = [&](int u, int v) {
        return to.at(std::min(u, to.width() - 1), std::min(v, to.height() - 1)).*part;
      };
      return (1 - down) * ((1 - right) * at(x0, y0) + right * at(x0 + 1, y0)) +
             down * ((1 - right) * at(x0, y0 + 1) + right * at(x0 + 1, y0 + 1));
    };
    a_yy = (a_yy + there(&Polynomial::a_yy)) / 2;
    a_xx = (a_xx + there(&Polynomial::a_xx)) / 2;
    a_xy = (a_xy + there(&Polynomial::a_xy)) / 2;
    b_y -= there(&Polynomial::b_y) / 2;
    b_x -= there(&Polynomial::b_x) / 2;
  }
  const double weight = border_weight(x, y, from.width(), from.height());
  const double w2 = weight * weight;
  b_y += a_yy * flow.y + a_xy * flow.x;
  b_x += a_xy * flow.y + a_xx * flow.x;
  return {w2 * (a_yy * a_yy + a_xy * a_xy), w2 * (a_yy + a_xx) * a_xy,
          w2 * (a_xx * a_xx + a_xy * a_xy), w2 * (a_yy * b_y + a_xy * b_x),
          w2 * (a_xy * b_y + a_xx * b_x)};
}

/// One iteration: solves the equations of 15x7 pixels around each pixel of every other row, border
/// replicated; these are 15 adjacent columns, and every other row. The rows between have the mean.
inline Image<Flow> better_flow(const Image<Polynomial>& from, const Image<Polynomial>& to,
                               const Image<Flow>& flow) {
  const int width = flow.width();
  const int height = flow.height();
  Image<Equations> of_pixel(width, height);
  for (int y = 0; y < height; y += 2)
    for (int x = 0; x < width; ++x) of_pixel.at(x, y) = equations(from, to, flow.at(x, y), x, y);
  Image<Flow> result(width, height);
  const int last_row = (height - 1) / 2 * 2;
  for (int y = 0; y < height; y += 2) {
    for (int x = 0; x < width; ++x) {
      Equations sum;
      for (int v = -6; v <= 6; v += 2)
        for (int u = -7; u <= 7; ++u)
          sum += of_pixel.at(std::clamp(x + u, 0, width - 1), std::clamp(y + v, 0, last_row));
      result.at(x, y) = sum.solution(15 * 7);
    }
  }
  for (int y = 1; y < height; y += 2)
    for (int x = 0; x < width; ++x)
      result.at(x, y) = (result.at(x, y - 1) + result.at(x, std::min(y + 1, last_row))) * 0.5;
  return result;
}

inline Image<Flow> farneback(const Image<std::uint8_t>& from, const Image<std::uint8_t>& to) {
  constexpr int iterations[] = {2, 3, 4, 5};
  int coarsest = 0;
  while (coarsest < 3 && std::min(from.width(), from.height()) >= 32 << (coarsest + 1)) ++coarsest;
  Image<Flow> flow;
  for (int level = coarsest; level >= 0; --level) {
    const auto last = pyramid_level(from, level);
    const auto next = pyramid_level(to, level);
    if (level == coarsest) {
      flow = Image<Flow>(last.width(), last.height());
    } else {
      flow = resized(flow, last.width(), last.height());
      for (int y = 0; y < flow.height(); ++y)
        for (int x = 0; x < flow.width(); ++x) flow.at(x, y) = flow.at(x, y) * 2;
    }
    const auto here = expansion(last);
    const auto there = expansion(next);
    for (int i = 0; i < iterations[level]; ++i) flow = better_flow(here, there, flow);
  }
  return flow;
}

}  // namespace eventcamera::reference
