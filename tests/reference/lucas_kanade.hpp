// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "src/flow/lucas_kanade/point_tracker.hpp"

namespace eventcamera::reference {

/// Image mirrored at its border pixels.
struct Mirrored {
  const Image<std::uint8_t>& picture;

  int operator()(int x, int y) const {
    return picture.at(mirror(x, picture.width()), mirror(y, picture.height()));
  }

  static int mirror(int p, int size) {
    if (size == 1) return 0;
    while (p < 0 || p >= size) p = p < 0 ? -p : 2 * (size - 1) - p;
    return p;
  }
};

/// Next level of a pyramid.
inline Image<std::uint8_t> halved(const Image<std::uint8_t>& picture) {
  constexpr int weight[] = {1, 4, 6, 4, 1};
  const Mirrored at{picture};
  Image<std::uint8_t> half((picture.width() + 1) / 2, (picture.height() + 1) / 2);
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

/// Scharr gradient, horizontal or vertical; 0 outside the image.
inline int slope(const Image<std::uint8_t>& picture, int x, int y, bool across) {
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
inline void search(const Image<std::uint8_t>& from, const Image<std::uint8_t>& to, const Tile& tile,
                   Search& search) {
  const int left = tile.left + search.x - 7;
  const int top = tile.top + search.y - 7;
  const float right = static_cast<float>(tile.right) / 8;
  const float down = static_cast<float>(tile.down) / 8;
  // Bilinear, rounded after each direction as SIMD code does.
  const auto here = [&](int x, int y, auto&& at) {
    const auto between = [](int a, int b, int eighths) {
      return a + (((b - a) * eighths + 4) >> 3);
    };
    const auto across = [&](int v) {
      return between(at(left + x, v), at(left + x + 1, v), tile.right);
    };
    return between(across(top + y), across(top + y + 1), tile.down);
  };
  const auto slope_x = [&](int x, int y) {
    return here(x, y, [&](int u, int v) { return slope(from, u, v, true); });
  };
  const auto slope_y = [&](int x, int y) {
    return here(x, y, [&](int u, int v) { return slope(from, u, v, false); });
  };
  const auto grey = [&](int x, int y) {
    return here(x, y, [at = Mirrored{from}](int u, int v) { return 4 * at(u, v); });
  };
  const auto sum = [](auto&& term) {
    std::int64_t total = 0;
    for (int y = 0; y < 15; ++y)
      for (int x = 0; x < 15; ++x) total += std::int64_t{term(x, y)};
    return static_cast<float>(total);
  };

  search.found = false;
  const float scale = 1.0F / (1 << 20);
  const float xx = sum([&](int x, int y) { return slope_x(x, y) * slope_x(x, y); }) * scale;
  const float xy = sum([&](int x, int y) { return slope_x(x, y) * slope_y(x, y); }) * scale;
  const float yy = sum([&](int x, int y) { return slope_y(x, y) * slope_y(x, y); }) * scale;
  const float least = (xx + yy - std::sqrt((xx - yy) * (xx - yy) + 4 * (xy * xy))) / 450;
  const float determinant = xx * yy - xy * xy;
  if (least < 1e-4F || determinant < std::numeric_limits<float>::epsilon()) return;

  auto& flow = search.flow;
  const auto inside = [&] {
    const float x = static_cast<float>(left) + std::floor(flow.x + right);
    const float y = static_cast<float>(top) + std::floor(flow.y + down);
    return x >= -15 && x < static_cast<float>(to.width()) && y >= -15 &&
           y < static_cast<float>(to.height());
  };
  Flow before{};
  for (int i = 0; i < 10; ++i) {
    if (!inside()) return;
    const float cell_x = std::floor(flow.x + right);
    const float cell_y = std::floor(flow.y + down);
    const auto mismatch = [&](auto&& weight) {
      const auto there = [&](int u, int v) {
        return sum([&](int x, int y) {
          const int there_x = left + static_cast<int>(cell_x) + u + x;
          const int there_y = top + static_cast<int>(cell_y) + v + y;
          return (4 * Mirrored{to}(there_x, there_y) - grey(x, y)) * weight(x, y);
        });
      };
      const auto between = [](float a, float b, float part) { return a + (b - a) * part; };
      const auto across = [&](int v) {
        return between(there(0, v), there(1, v), flow.x + right - cell_x);
      };
      return between(across(0), across(1), flow.y + down - cell_y) * (8 * scale);
    };
    const float x = mismatch(slope_x);
    const float y = mismatch(slope_y);
    const Flow move{(xy * y - yy * x) * (1 / determinant), (xy * x - xx * y) * (1 / determinant)};
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

/// Tracks a point: twice its flow on one level is the start of the search on the next.
inline Track track(const Image<std::uint8_t>& from, const Image<std::uint8_t>& to,
                   const Point& point) {
  std::vector<std::pair<Image<std::uint8_t>, Image<std::uint8_t>>> levels{{from, to}};
  while (levels.size() < 4) {
    const auto& [a, b] = levels.back();
    if (std::min(a.width(), a.height()) <= 30) break;  // half of it would not exceed a window
    levels.emplace_back(halved(a), halved(b));
  }
  Search result{0, 0, {0, 0}, false};
  for (int level = static_cast<int>(levels.size()) - 1; level >= 0; --level) {
    const auto eighths = [level](int position) { return (position << 3 >> level) & 7; };
    const Tile pixel{point.x >> level, point.y >> level, eighths(point.x), eighths(point.y)};
    result.flow = {2 * result.flow.x, 2 * result.flow.y};
    const auto& [a, b] = levels[static_cast<std::size_t>(level)];
    search(a, b, pixel, result);
  }
  return {result.flow, result.found};
}

}  // namespace eventcamera::reference
