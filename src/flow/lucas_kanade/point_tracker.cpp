// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/lucas_kanade/point_tracker.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace eventcamera {
namespace {

constexpr int cell_side = 2;
/// Cells whose flow differs by more than this do not share in a point's, pixels.
constexpr float similar = 1;

constexpr int per_round = 256;

float distance(const Flow& a, const Flow& b) {
  return std::hypot(a.x - b.x, a.y - b.y);
}

/// Calls body(first, last) for parts of 0 ... count.
template <class Body>
void for_each_part(ThreadPool& threads, std::size_t count, const Body& body) {
  threads.for_each(static_cast<int>((count + per_round - 1) / per_round), [&](int round, int) {
    const std::size_t first = static_cast<std::size_t>(round) * per_round;
    body(first, std::min(first + per_round, count));
  });
}

/// The neighbour next nearest to a position that lies off the middle of a cell.
int other(int position) {
  return position / 2 + (position % 2 == 0 ? -1 : 1);
}

/// Adds up flows by their weights.
class Mean {
 public:
  void add(const Flow& flow, float weight) {
    x_ += weight * flow.x;
    y_ += weight * flow.y;
    weights_ += weight;
  }

  Flow flow() const { return {x_ / weights_, y_ / weights_}; }

 private:
  float x_ = 0;
  float y_ = 0;
  float weights_ = 0;
};

}  // namespace

void PointTracker::push(const PlaneView<std::uint8_t>& picture, ThreadPool& threads) {
  std::swap(last_, next_);
  next_.build(picture, threads);
  has_slopes_ = false;
  const auto& levels = next_.levels();
  if (grids_.size() == levels.size()) return;
  for (const auto& level : levels) {
    const int width = (level.picture.width() + cell_side - 1) / cell_side;
    const int height = (level.picture.height() + cell_side - 1) / cell_side;
    grids_.push_back(
        {width,
         height,
         std::vector<Cell>(static_cast<std::size_t>(width) * static_cast<std::size_t>(height)),
         {}});
  }
}

std::span<const Track> PointTracker::track(std::span<const Point> points, ThreadPool& threads) {
  tracks_.resize(points.size());
  if (points.empty()) return tracks_;
  if (!std::exchange(has_slopes_, true)) last_.build_slopes(threads);
  want_cells(points);
  for (std::size_t level = grids_.size(); level-- > 0;) search_cells(level, threads);

  agreed_.resize(points.size());
  for_each_part(threads, points.size(), [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i)
      agreed_[i] = interpolate(points[i], tracks_[i]) ? 1 : 0;
  });
  alone_.clear();
  for (std::size_t i = 0; i < points.size(); ++i)
    if (agreed_[i] == 0) alone_.push_back(i);
  search_alone(points, threads);
  return tracks_;
}

void PointTracker::want_cells(std::span<const Point> points) {
  if (++call_ == 0) ++call_;  // 0: never
  for (auto& grid : grids_) grid.wanted.clear();
  const auto want = [this](CellGrid& grid, const Point& cell) {
    if (std::exchange(grid.at(cell).call, call_) != call_) grid.wanted.push_back(cell);
  };
  for (const auto& point : points) want(grids_[0], {point.x / cell_side, point.y / cell_side});
  for (std::size_t level = 1; level < grids_.size(); ++level)
    for (const auto& cell : grids_[level - 1].wanted) want(grids_[level], {cell.x / 2, cell.y / 2});
}

const PointTracker::Cell* PointTracker::wanted_cell(const CellGrid& grid, int x, int y) const {
  if (x < 0 || x >= grid.width || y < 0 || y >= grid.height) return nullptr;
  const Cell& cell = grid.at({x, y});
  return cell.call == call_ ? &cell : nullptr;
}

Flow PointTracker::guess(const CellGrid& above, const Point& cell) const {
  // A cell's middle lies a quarter of a larger cell off that one's middle.
  constexpr float near = 0.75F;
  constexpr float far = 0.25F;
  Mean mean;
  const auto add = [&](int x, int y, float weight) {
    if (const auto* neighbour = wanted_cell(above, x, y)) mean.add(neighbour->flow, weight);
  };
  const Point parent{cell.x / 2, cell.y / 2};
  add(parent.x, parent.y, near * near);
  add(other(cell.x), parent.y, far * near);
  add(parent.x, other(cell.y), near * far);
  add(other(cell.x), other(cell.y), far * far);
  const Flow flow = mean.flow();
  return {2 * flow.x, 2 * flow.y};
}

void PointTracker::search_cells(std::size_t level, ThreadPool& threads) {
  auto& grid = grids_[level];
  const auto& picture = last_.levels()[level].picture;
  searches_.resize(grid.wanted.size());
  for_each_part(threads, grid.wanted.size(), [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i) {
      const auto& cell = grid.wanted[i];
      const int x = std::min(cell.x * cell_side + cell_side / 2, picture.width() - 1);
      const int y = std::min(cell.y * cell_side + cell_side / 2, picture.height() - 1);
      const Flow start = level + 1 < grids_.size() ? guess(grids_[level + 1], cell) : Flow{0, 0};
      searches_[i] = {static_cast<float>(x), static_cast<float>(y), start, false};
    }
    search_level(last_.levels()[level], next_.levels()[level],
                 std::span(searches_).subspan(first, last - first));
    for (std::size_t i = first; i < last; ++i) {
      Cell& cell = grid.at(grid.wanted[i]);
      cell.flow = searches_[i].flow;
      cell.found = searches_[i].found;
    }
  });
}

bool PointTracker::interpolate(const Point& point, Track& track) const {
  const auto& grid = grids_[0];
  const Point home{point.x / cell_side, point.y / cell_side};
  const Cell& own = *wanted_cell(grid, home.x, home.y);
  if (!own.found) return false;
  for (int y = home.y - 1; y <= home.y + 1; ++y)
    for (int x = home.x - 1; x <= home.x + 1; ++x)
      if (const auto* cell = wanted_cell(grid, x, y))
        if (!cell->found || distance(cell->flow, own.flow) > disagreement_) return false;
  // The second pixel of a cell is its middle; the first lies half way to the cell before.
  Mean mean;
  for (int y = point.y % 2 == 0 ? home.y - 1 : home.y; y <= home.y; ++y)
    for (int x = point.x % 2 == 0 ? home.x - 1 : home.x; x <= home.x; ++x)
      if (const auto* cell = wanted_cell(grid, x, y))
        if (distance(cell->flow, own.flow) <= similar) mean.add(cell->flow, 1);
  track = {mean.flow(), true};
  return true;
}

void PointTracker::search_alone(std::span<const Point> points, ThreadPool& threads) {
  searches_.resize(alone_.size());
  for_each_part(threads, alone_.size(), [&](std::size_t first, std::size_t last) {
    const auto part = std::span(searches_).subspan(first, last - first);
    for (auto& search : part) search.flow = {0, 0};
    for (std::size_t level = grids_.size(); level-- > 0;) {
      const float scale = 1.0F / static_cast<float>(1 << level);
      for (std::size_t i = first; i < last; ++i) {
        const auto& point = points[alone_[i]];
        auto& search = searches_[i];
        search.x = static_cast<float>(point.x) * scale;
        search.y = static_cast<float>(point.y) * scale;
        search.flow = {2 * search.flow.x, 2 * search.flow.y};
      }
      search_level(last_.levels()[level], next_.levels()[level], part);
    }
    for (std::size_t i = first; i < last; ++i)
      tracks_[alone_[i]] = {searches_[i].flow, searches_[i].found};
  });
}

}  // namespace eventcamera
