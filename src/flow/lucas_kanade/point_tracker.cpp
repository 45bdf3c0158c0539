// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/lucas_kanade/point_tracker.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "src/flow/lucas_kanade/texture.hpp"

namespace eventcamera {
namespace {

/// Position of a point of a block on a pyramid level, along one axis.
class Place {
 public:
  Place(int position, std::size_t level) : position_(position), level_(static_cast<int>(level)) {}

  /// In 1/8 of a pixel.
  int fraction() const { return (position_ & mask(level_)) << (top_level - level_); }
  int tile() const { return position_ >> level_ >> bits_of_tile; }
  int within_tile() const { return position_ >> level_ & mask(bits_of_tile); }
  /// Tile and fraction combined; has the same range on every level.
  int group() const { return tile() << level_ | (position_ & mask(level_)); }

 private:
  static constexpr int top_level = Pyramid::max_levels - 1;
  static constexpr int bits_of_tile = 4;
  static_assert(1 << bits_of_tile == Tile::side && 1 << top_level == Tile::fractions);

  static int mask(int bits) { return (1 << bits) - 1; }

  int position_;
  int level_;
};

}  // namespace

void PointTracker::push(const ImageView<std::uint8_t>& picture, ThreadPool& threads) {
  std::swap(last_, next_);
  next_.build(picture, threads);
}

std::span<const Track> PointTracker::track(std::span<const Point> points, ThreadPool& threads) {
  tracks_.resize(points.size());
  if (points.empty()) return tracks_;
  const auto& picture = last_.levels()[0];
  find_rows(points, picture.height());
  constexpr std::size_t most = std::size_t{block_side} * block_side;
  constexpr int around = Tile::before + Tile::after;
  while (static_cast<int>(blocks_.size()) < threads.threads())
    blocks_.push_back({std::vector<std::uint32_t>(most), std::vector<std::uint32_t>(most),
                       ScharrGradients(block_side + around, block_side + around)});
  const int across = (picture.width() + block_side - 1) / block_side;
  const int down = (picture.height() + block_side - 1) / block_side;
  threads.for_each(across * down, [&](int i, int thread) {
    follow(points, i % across * block_side, i / across * block_side,
           blocks_[static_cast<std::size_t>(thread)]);
  });
  return tracks_;
}

void PointTracker::find_rows(std::span<const Point> points, int height) {
  rows_.clear();
  for (std::size_t i = 0; i < points.size(); ++i)
    while (static_cast<int>(rows_.size()) <= points[i].y) rows_.push_back(i);
  rows_.resize(static_cast<std::size_t>(height) + 1, points.size());
}

void PointTracker::follow(std::span<const Point> points, int left, int top, Block& block) {
  block.points.clear();
  const int bottom = std::min(top + block_side, static_cast<int>(rows_.size()) - 1);
  for (int y = top; y < bottom; ++y) {
    const auto row =
        points.subspan(rows_[static_cast<std::size_t>(y)],
                       rows_[static_cast<std::size_t>(y) + 1] - rows_[static_cast<std::size_t>(y)]);
    const auto first = std::lower_bound(row.begin(), row.end(), left,
                                        [](const Point& p, int x) { return p.x < x; });
    for (auto it = first; it != row.end() && it->x < left + block_side; ++it) {
      const auto index = static_cast<std::uint32_t>(&*it - points.data());
      block.points.push_back(index);
      tracks_[index] = {};
    }
  }
  if (block.points.empty()) return;
  constexpr std::size_t many = block_side;  // with fewer points, the test costs more than it saves
  if (block.points.size() >= many) drop_flat(points, left, top, block);
  if (block.points.empty()) return;
  block.ordered.resize(block.points.size());
  const int first_row = points[block.points.front()].y;
  const int last_row = points[block.points.back()].y;
  for (std::size_t level = last_.levels().size(); level-- > 0;) {
    block.gradients.compute(
        last_.levels()[level],
        {(left >> level) - Tile::before, (first_row >> level) - Tile::before,
         ((left + block_side) >> level) + Tile::after, (last_row >> level) + 1 + Tile::after});
    search(points, level, left, top, block);
  }
}

void PointTracker::drop_flat(std::span<const Point> points, int left, int top, Block& block) {
  constexpr std::size_t tiles_across = block_side / Tile::side;
  const auto& picture = last_.levels()[0];
  const int first_tile = points[block.points.front()].y / Tile::side * Tile::side;
  const int last_tile = points[block.points.back()].y / Tile::side * Tile::side;
  block.gradients.compute(
      picture, {left - Tile::before, first_tile - Tile::before, left + block_side + Tile::after,
                last_tile + Tile::side + Tile::after});
  std::array<std::optional<TilePixels>, tiles_across * tiles_across> tiles;
  std::erase_if(block.points, [&](std::uint32_t index) {
    const auto [x, y] = points[index];
    const auto row = static_cast<std::size_t>((y - top) / Tile::side);
    const auto column = static_cast<std::size_t>((x - left) / Tile::side);
    auto& textured = tiles[row * tiles_across + column];
    if (!textured)
      textured = textured_pixels(block.gradients,
                                 {x / Tile::side * Tile::side, y / Tile::side * Tile::side, 0, 0});
    const auto pixels = (*textured)[static_cast<std::size_t>(y % Tile::side)];
    return (pixels >> x % Tile::side & 1) == 0;
  });
}

void PointTracker::search(std::span<const Point> points, std::size_t level, int left, int top,
                          Block& block) {
  const auto group = [&](const Point& point) {
    constexpr int groups_across = 1 << (Pyramid::max_levels - 1);
    return static_cast<std::size_t>(Place(point.y - top, level).group() * groups_across +
                                    Place(point.x - left, level).group());
  };
  std::array<std::uint32_t, tiles_a_block> ends{};
  for (const auto index : block.points) ++ends[group(points[index])];
  std::uint32_t sum = 0;
  for (auto& end : ends) sum += std::exchange(end, sum);
  for (const auto index : block.points) block.ordered[ends[group(points[index])]++] = index;

  std::uint32_t first = 0;
  for (const auto end : ends) {
    const auto in_tile = std::span<const std::uint32_t>(block.ordered).subspan(first, end - first);
    first = end;
    if (in_tile.empty()) continue;
    const Place x(points[in_tile[0]].x - left, level);
    const Place y(points[in_tile[0]].y - top, level);
    const Tile tile{(left >> level) + x.tile() * Tile::side, (top >> level) + y.tile() * Tile::side,
                    x.fraction(), y.fraction()};
    std::array<Search, std::size_t{Tile::side} * Tile::side> searches;
    for (std::size_t i = 0; i < in_tile.size(); ++i) {
      const auto& point = points[in_tile[i]];
      const auto& flow = tracks_[in_tile[i]].flow;
      searches[i] = {Place(point.x - left, level).within_tile(),
                     Place(point.y - top, level).within_tile(),
                     {2 * flow.x, 2 * flow.y},
                     false};
    }
    search_tile(last_.levels()[level], block.gradients, next_.levels()[level], tile,
                std::span(searches).first(in_tile.size()));
    for (std::size_t i = 0; i < in_tile.size(); ++i)
      tracks_[in_tile[i]] = {searches[i].flow, searches[i].found};
  }
}

}  // namespace eventcamera
