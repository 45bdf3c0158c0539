// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/lucas_kanade/point_tracker.hpp"

#include <algorithm>
#include <bit>
#include <functional>
#include <numeric>
#include <utility>

namespace eventcamera {
namespace {

/// ORs pairs of bits: bit i of the result is bit 2i | bit 2i + 1.
std::uint64_t join_pairs(std::uint64_t bits) {
  bits = (bits | bits >> 1) & 0x5555555555555555U;
  bits = (bits | bits >> 1) & 0x3333333333333333U;
  bits = (bits | bits >> 2) & 0x0f0f0f0f0f0f0f0fU;
  bits = (bits | bits >> 4) & 0x00ff00ff00ff00ffU;
  bits = (bits | bits >> 8) & 0x0000ffff0000ffffU;
  return (bits | bits >> 16) & 0x00000000ffffffffU;
}

}  // namespace

void PointTracker::Blocks::clear() {
  for (int y = 0; y < region_side; ++y) {
    if (rows_[y] == 0) continue;
    rows_[y] = 0;
    std::fill_n(&track(0, y), region_side, Track{});
  }
}

Track PointTracker::Blocks::interpolated(int x, int y) const {
  const int column = x / 2;
  const int row = y / 2;
  const auto& own = track(column, row);
  Flow flow = own.flow;
  const auto add_share_of = [&](int beside, int below) {
    // Without branches: past the border, this is the block itself.
    const auto& other =
        track(std::clamp(beside, 0, region_side - 1), std::clamp(below, 0, region_side - 1));
    const auto part = [&](float from, float to) {
      constexpr float max_difference = 0.5F;
      return other.found ? std::clamp(to - from, -max_difference, max_difference) / 4 : 0.0F;
    };
    flow = {flow.x + part(own.flow.x, other.flow.x), flow.y + part(own.flow.y, other.flow.y)};
  };
  add_share_of(x % 2 == 0 ? column - 1 : column + 1, row);
  add_share_of(column, y % 2 == 0 ? row - 1 : row + 1);
  return {flow, own.found};
}

void PointTracker::Blocks::add_coarser(const Blocks& finer) {
  for (std::size_t y = 0; y < rows_.size() / 2; ++y)
    rows_[y] |= join_pairs(finer.rows_[2 * y] | finer.rows_[2 * y + 1]);
}

int PointTracker::Blocks::first_row() const {
  const auto is_used = [](std::uint64_t row) { return row != 0; };
  return static_cast<int>(std::find_if(rows_.begin(), rows_.end(), is_used) - rows_.begin());
}

int PointTracker::Blocks::last_row() const {
  const auto is_used = [](std::uint64_t row) { return row != 0; };
  return static_cast<int>(rows_.rend() - std::find_if(rows_.rbegin(), rows_.rend(), is_used)) - 1;
}

std::uint64_t PointTracker::Blocks::columns() const {
  return std::accumulate(rows_.begin(), rows_.end(), std::uint64_t{0}, std::bit_or());
}

void PointTracker::push(const ImageView<std::uint8_t>& image, ThreadPool& threads,
                        std::span<const std::uint8_t> is_black) {
  std::swap(last_, next_);
  next_.build(image, threads, is_black);
}

std::span<const Track> PointTracker::track(std::span<const Point> points, ThreadPool& threads) {
  tracks_.resize(points.size());
  if (points.empty()) return tracks_;
  const auto& image = last_.levels()[0];
  find_rows(points, image.height());
  const int side = block_side_ * region_side;
  while (static_cast<int>(regions_.size()) < threads.threads()) regions_.emplace_back(side);
  const int across = (image.width() + side - 1) / side;
  const int down = (image.height() + side - 1) / side;
  threads.for_each(across * down, [&](int i, int thread) {
    track_region(points, i % across * side, i / across * side, regions_[thread]);
  });
  return tracks_;
}

void PointTracker::find_rows(std::span<const Point> points, int height) {
  rows_.clear();
  for (std::size_t i = 0; i < points.size(); ++i)
    while (static_cast<int>(rows_.size()) <= points[i].y) rows_.push_back(i);
  rows_.resize(static_cast<std::size_t>(height) + 1, points.size());
}

void PointTracker::track_region(std::span<const Point> points, int left, int top, Region& region) {
  auto& finest = region.levels[0];
  finest.clear();
  const int side = block_side_ * region_side;
  std::array<std::span<const Point>, std::size_t{max_block_side} * region_side> rows;
  const int bottom = std::min(top + side, static_cast<int>(rows_.size()) - 1);
  if (rows_[top] == rows_[bottom]) return;
  bool any = false;
  for (int y = top; y < bottom; ++y) {
    const auto first = rows_[y];
    const auto row = points.subspan(first, rows_[static_cast<std::size_t>(y) + 1] - first);
    if (row.empty()) continue;
    const auto at = [](const Point& p, int x) { return p.x < x; };
    const auto begin = std::lower_bound(row.begin(), row.end(), left, at);
    const auto end = std::lower_bound(begin, row.end(), left + side, at);
    rows[y - top] = {begin, end};
    any |= begin != end;
    for (auto it = begin; it != end; ++it)
      finest.add((it->x - left) / block_side_, (y - top) / block_side_);
  }
  if (!any) return;
  const auto level_count = last_.levels().size();
  for (std::size_t level = 1; level < level_count; ++level) {
    region.levels[level].clear();
    region.levels[level].add_coarser(region.levels[level - 1]);
  }
  for (std::size_t level = level_count; level-- > 0;) search(level, left, top, region);
  for (int y = top; y < bottom; ++y) {
    for (const auto& point : rows[y - top])
      tracks_[static_cast<std::size_t>(&point - points.data())] =
          block_side_ == 1 ? finest.track(point.x - left, y - top)
                           : finest.interpolated(point.x - left, y - top);
  }
}

void PointTracker::search(std::size_t level, int left, int top, Region& region) const {
  const auto& blocks = region.levels[level];
  const int side = region_side >> level;
  left >>= level;
  top >>= level;
  const int first_row = blocks.first_row();
  const int last_row = blocks.last_row();
  const int apart = blocks_apart();
  const int tile_side = apart * Tile::side;
  const auto columns = blocks.columns();
  const int first_column = std::countr_zero(columns) / tile_side * tile_side;
  const int end_column =
      std::min(side, (63 - std::countl_zero(columns)) / tile_side * tile_side + tile_side);
  region.gradients.compute(last_.levels()[level], {left + block_side_ * first_column - Tile::before,
                                                   top + block_side_ * first_row - Tile::before,
                                                   left + block_side_ * end_column + Tile::after,
                                                   top + block_side_ * last_row + 1 + Tile::after});
  for (int y = first_row / tile_side * tile_side; y <= last_row; y += tile_side)
    for (int x = first_column; x < end_column; x += tile_side)
      for (int below = 0; below < apart; ++below)
        for (int beside = 0; beside < apart; ++beside)
          search_tile_at(level, left, top, x + beside, y + below, region);
}

void PointTracker::search_tile_at(std::size_t level, int left, int top, int x, int y,
                                  Region& region) const {
  auto& blocks = region.levels[level];
  const auto* coarser = level + 1 < last_.levels().size() ? &region.levels[level + 1] : nullptr;
  const int apart = blocks_apart();
  const unsigned row_of_tile = apart == 1 ? 0x00ff : 0x5555;
  std::array<Search, Tile::block_count> searches;
  std::size_t count = 0;
  for (int row = 0; row < Tile::side; ++row) {
    const int block_y = y + apart * row;
    for (auto bits = blocks.row(block_y) >> x & row_of_tile; bits != 0; bits &= bits - 1) {
      const int column = std::countr_zero(bits) / apart;
      const int block_x = x + apart * column;
      const Flow flow = coarser != nullptr ? coarser->track(block_x / 2, block_y / 2).flow : Flow{};
      searches[count++] = {column, row, {2 * flow.x, 2 * flow.y}, false};
    }
  }
  if (count == 0) return;
  const auto found = std::span(searches).first(count);
  search_tile(last_.levels()[level], region.gradients, next_.levels()[level],
              {left + block_side_ * x, top + block_side_ * y}, found);
  for (const auto& search : found)
    blocks.track(x + apart * search.x, y + apart * search.y) = {search.flow, search.found};
}

}  // namespace eventcamera
