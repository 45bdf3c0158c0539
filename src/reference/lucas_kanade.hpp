// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "src/flow/lucas_kanade/search.hpp"

namespace eventcamera::reference {

/// A picture that goes on beyond its border, mirrored at its border pixels.
struct Mirrored {
  const Plane<std::uint8_t>& picture;

  int operator()(int x, int y) const {
    return picture.at(mirror(x, picture.width()), mirror(y, picture.height()));
  }

  static int mirror(int p, int size) {
    if (size == 1) return 0;
    while (p < 0 || p >= size) p = p < 0 ? -p : 2 * (size - 1) - p;
    return p;
  }
};

/// The next level of a pyramid.
inline Plane<std::uint8_t> halved(const Plane<std::uint8_t>& picture) {
  constexpr int weight[] = {1, 4, 6, 4, 1};
  const Mirrored at{picture};
  Plane<std::uint8_t> half((picture.width() + 1) / 2, (picture.height() + 1) / 2);
  for (int y = 0; y < half.height(); ++y) {
    for (int x = 0; x < half.width(); ++x) {
      int sum = 0;
      for (int v = 0; v < 5; ++v)
        for (int u = 0; u < 5; ++u) sum += weight[u] * weight[v] * at(2 * x + u - 2, 2 * y + v - 2);
      half.at(x, y) = static_cast<std::uint8_t>((sum + 128) / 256);
    }
  }
  return half;
}

/// Scharr's operator, across or down; 0 outside the picture.
inline int slope(const Plane<std::uint8_t>& picture, int x, int y, bool across) {
  if (x < 0 || x >= picture.width() || y < 0 || y >= picture.height()) return 0;
  constexpr int weight[] = {3, 10, 3};
  const Mirrored at{picture};
  int sum = 0;
  for (int i = -1; i <= 1; ++i)
    sum += weight[i + 1] *
           (across ? at(x + 1, y + i) - at(x - 1, y + i) : at(x + i, y + 1) - at(x + i, y - 1));
  return sum;
}

/// Lucas-Kanade on one level, pixel by pixel.
inline void search(const Plane<std::uint8_t>& from, const Plane<std::uint8_t>& to, Search& search) {
  struct Corner {
    Corner(float left, float top)
        : x(static_cast<int>(std::floor(left))),
          y(static_cast<int>(std::floor(top))),
          right(fraction(left - std::floor(left))),
          down(fraction(top - std::floor(top))) {}
    static int fraction(float part) {
      return static_cast<int>(std::min(part * 32768 + 0.5F, 32767.0F));
    }
    int x, y, right, down;
  };
  /// Bilinear, rounded after each way as the hardware does it.
  const auto sample = [](const Corner& c, int x, int y, auto&& at) {
    const auto between = [](int a, int b, int part) {
      return a + (((b - a) * part + 16384) >> 15);
    };
    const auto across = [&](int v) { return between(at(c.x + x, v), at(c.x + x + 1, v), c.right); };
    return between(across(c.y + y), across(c.y + y + 1), c.down);
  };
  const auto grey = [](const Plane<std::uint8_t>& picture) {
    return [at = Mirrored{picture}](int x, int y) { return 64 * at(x, y); };
  };
  const auto slope_of = [&](bool across) {
    return [&from, across](int x, int y) { return slope(from, x, y, across); };
  };
  const auto sum = [](auto&& term) {
    std::int64_t total = 0;
    for (int y = 0; y < 15; ++y)
      for (int x = 0; x < 15; ++x) total += std::int64_t{term(x, y)};
    return static_cast<float>(total);
  };
  const auto reachable = [](const Corner& c, const Plane<std::uint8_t>& picture) {
    return c.x >= -15 && c.x < picture.width() && c.y >= -15 && c.y < picture.height();
  };

  search.found = false;
  const Corner start(search.x - 7, search.y - 7);
  if (!reachable(start, from)) return;
  const auto sx = [&](int x, int y) { return sample(start, x, y, slope_of(true)); };
  const auto sy = [&](int x, int y) { return sample(start, x, y, slope_of(false)); };
  const float scale = 1.0F / (1 << 20);
  const float xx = sum([&](int x, int y) { return sx(x, y) * sx(x, y); }) * scale;
  const float xy = sum([&](int x, int y) { return sx(x, y) * sy(x, y); }) * scale;
  const float yy = sum([&](int x, int y) { return sy(x, y) * sy(x, y); }) * scale;
  const float least = (xx + yy - std::sqrt((xx - yy) * (xx - yy) + 4 * xy * xy)) / 450;
  const float determinant = xx * yy - xy * xy;
  if (least < 1e-4F || determinant < std::numeric_limits<float>::epsilon()) return;

  auto& flow = search.flow;
  const auto corner = [&] { return Corner(search.x - 7 + flow.x, search.y - 7 + flow.y); };
  const auto inside = [&] {
    return std::abs(flow.x) <= from.width() && std::abs(flow.y) <= from.height() &&
           reachable(corner(), to);
  };
  Flow before{};
  for (int i = 0; i < 10; ++i) {
    if (!inside()) return;
    const auto here = corner();
    const auto mismatch = [&](int x, int y) {
      return sample(here, x, y, grey(to)) - sample(start, x, y, grey(from));
    };
    const float bx = sum([&](int x, int y) { return mismatch(x, y) * sx(x, y); }) * (scale / 2);
    const float by = sum([&](int x, int y) { return mismatch(x, y) * sy(x, y); }) * (scale / 2);
    const Flow move{(xy * by - yy * bx) * (1 / determinant),
                    (xy * bx - xx * by) * (1 / determinant)};
    flow = {flow.x + move.x, flow.y + move.y};
    if (move.x * move.x + move.y * move.y <= 0.03F * 0.03F) break;
    if (i > 0 && std::abs(move.x + before.x) < 0.01F && std::abs(move.y + before.y) < 0.01F) {
      flow = {flow.x - move.x / 2, flow.y - move.y / 2};
      break;
    }
    before = move;
  }
  search.found = inside();
}

}  // namespace eventcamera::reference
