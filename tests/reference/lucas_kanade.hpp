// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
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

/// Lucas-Kanade on one level for the block whose first pixel is (x, y), pixel by pixel: a window of
/// 16x16 pixels around it. Starts from `track.flow`, which a lost track keeps.
inline void search(const Image<std::uint8_t>& from, const Image<std::uint8_t>& to, int x, int y,
                   Track& track) {
  const int left = x - 7;
  const int top = y - 7;
  const auto slope_x = [&](int u, int v) { return slope(from, left + u, top + v, true); };
  const auto slope_y = [&](int u, int v) { return slope(from, left + u, top + v, false); };
  const auto sum = [](auto&& term) {
    std::int64_t total = 0;
    for (int v = 0; v < 16; ++v)
      for (int u = 0; u < 16; ++u) total += std::int64_t{term(u, v)};
    return static_cast<float>(total);
  };

  track.found = false;
  const float scale = 1.0F / (1 << 20);
  const float xx = sum([&](int u, int v) { return slope_x(u, v) * slope_x(u, v); }) * scale;
  const float xy = sum([&](int u, int v) { return slope_x(u, v) * slope_y(u, v); }) * scale;
  const float yy = sum([&](int u, int v) { return slope_y(u, v) * slope_y(u, v); }) * scale;
  const float least = (xx + yy - std::sqrt((xx - yy) * (xx - yy) + 4 * (xy * xy))) / 512;
  const float determinant = xx * yy - xy * xy;
  if (least < 1.6e-4F || determinant < std::numeric_limits<float>::epsilon()) return;

  Flow flow = track.flow;
  const auto inside = [&] {
    const float column = static_cast<float>(left) + std::floor(flow.x);
    const float row = static_cast<float>(top) + std::floor(flow.y);
    return column >= -16 && column < static_cast<float>(to.width()) && row >= -16 &&
           row < static_cast<float>(to.height());
  };
  Flow before{};
  for (int i = 0; i < 11; ++i) {
    if (!inside()) return;
    const float cell_x = std::floor(flow.x);
    const float cell_y = std::floor(flow.y);
    const auto mismatch = [&](auto&& weight) {
      const auto at = [&](int right, int down) {
        return sum([&](int u, int v) {
          const int there = Mirrored{to}(left + static_cast<int>(cell_x) + right + u,
                                         top + static_cast<int>(cell_y) + down + v);
          return (there - Mirrored{from}(left + u, top + v)) * weight(u, v);
        });
      };
      const auto between = [](float a, float b, float part) { return a + (b - a) * part; };
      const auto across = [&](int down) {
        return between(at(0, down), at(1, down), flow.x - cell_x);
      };
      return between(across(0), across(1), flow.y - cell_y) * (32 * scale);
    };
    const float across = mismatch(slope_x);
    const float down = mismatch(slope_y);
    const Flow move{(xy * down - yy * across) * (1 / determinant),
                    (xy * across - xx * down) * (1 / determinant)};
    flow = {flow.x + move.x, flow.y + move.y};
    const float square = move.x * move.x + move.y * move.y;
    if (square <= 0.03F * 0.03F || (i >= 4 && square > 2.0F * 2.0F)) break;
    if (i > 0 && std::abs(move.x + before.x) < 0.01F && std::abs(move.y + before.y) < 0.01F) {
      flow = {flow.x - move.x / 2, flow.y - move.y / 2};
      break;
    }
    before = move;
  }
  track.found = inside();
  if (track.found) track.flow = flow;
}

/// Tracks the block that contains a point: twice the flow of the block that contains it on one
/// level is the start of the search on the next.
inline Track track_block(const Image<std::uint8_t>& from, const Image<std::uint8_t>& to,
                         const Point& point, int side) {
  std::vector<std::pair<Image<std::uint8_t>, Image<std::uint8_t>>> levels{{from, to}};
  while (levels.size() < 4) {
    const auto& [a, b] = levels.back();
    if (std::min(a.width(), a.height()) <= 30) break;  // half of it would not exceed 15
    levels.emplace_back(halved(a), halved(b));
  }
  Track result;
  for (int level = static_cast<int>(levels.size()) - 1; level >= 0; --level) {
    result.flow = {2 * result.flow.x, 2 * result.flow.y};
    const auto& [a, b] = levels[static_cast<std::size_t>(level)];
    const auto first = [&](int position) { return (position >> level) / side * side; };
    search(a, b, first(point.x), first(point.y), result);
  }
  return result;
}

/// Tracks of the blocks that contain points, by their places among the blocks.
using BlockTracks = std::map<std::pair<int, int>, Track>;

/// Flow of a point between the blocks of 2x2 pixels around it.
inline Flow flow_between(const BlockTracks& blocks, const Point& point) {
  const auto [x, y] = point;
  const Flow own = blocks.at({x / 2, y / 2}).flow;
  Flow flow = own;
  for (const Point& beside :
       {Point{x % 2 == 0 ? x - 2 : x + 2, y}, Point{x, y % 2 == 0 ? y - 2 : y + 2}}) {
    const auto other = blocks.find({beside.x / 2, beside.y / 2});
    const bool is_near =
        beside.x >= 0 && beside.y >= 0 && beside.x / 128 == x / 128 && beside.y / 128 == y / 128;
    if (!is_near || other == blocks.end() || !other->second.found) continue;
    const Flow& to = other->second.flow;
    flow = {flow.x + std::clamp(to.x - own.x, -0.5F, 0.5F) / 4,
            flow.y + std::clamp(to.y - own.y, -0.5F, 0.5F) / 4};
  }
  return flow;
}

/// Tracks points in blocks of 1x1 or 2x2 pixels.
inline std::vector<Track> tracks(const Image<std::uint8_t>& from, const Image<std::uint8_t>& to,
                                 const std::vector<Point>& points, int block_side) {
  BlockTracks blocks;
  for (const auto& point : points)
    if (const auto place = std::pair(point.x / block_side, point.y / block_side);
        !blocks.contains(place))
      blocks[place] = track_block(from, to, point, block_side);
  std::vector<Track> result;
  for (const auto& point : points) {
    Track track = blocks.at({point.x / block_side, point.y / block_side});
    if (block_side == 2) track.flow = flow_between(blocks, point);
    result.push_back(track);
  }
  return result;
}

}  // namespace eventcamera::reference
