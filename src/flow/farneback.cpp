// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/farneback.hpp"

#include <algorithm>
#include <cassert>
#include <utility>

namespace eventcamera {
namespace {

constexpr int halvings = 3;
constexpr int iterations = 3;
constexpr int shortest_side = 32;  ///< of a shrunk picture

/// A band of polynomials needs some more rows of the picture on both sides, a band of flow some
/// more rows of equations: they are worked out twice. So the bands are not few, and not thin.
constexpr int rows_per_expansion = 32;
constexpr int rows_per_update = 32;

int parts(int length, int part) {
  return (length + part - 1) / part;
}

/// So many bands of flow: the fewer threads, the fewer rows are worked out twice.
int update_bands(int height, int threads) {
  return std::clamp(height / rows_per_update, 1, threads == 1 ? 1 : 2 * threads);
}

PlaneView<Flow> view(const Plane<Flow>& plane, int width) {
  return {plane.row(0), plane.stride(), width, plane.height()};
}

}  // namespace

FarnebackFlow::Level::Level(int width, int height, int level)
    : pyramid(width, height, level),
      last(pyramid.width(), pyramid.height()),
      next(pyramid.width(), pyramid.height()),
      update(pyramid.width(), pyramid.height()),
      flow(pyramid.width() + Resampling::spare, pyramid.height()),
      better(pyramid.width() + Resampling::spare, pyramid.height()) {}

void FarnebackFlow::start(int width, int height) {
  width_ = width;
  height_ = height;
  levels_.clear();
  for (int level = 0; level <= halvings; ++level) {
    if (level > 0 && std::min(width, height) < shortest_side << level) break;
    levels_.emplace_back(width, height, level);
    if (level == 0) continue;
    Level& finer = levels_[levels_.size() - 2];
    finer.columns = Resampling(levels_.back().pyramid.width(), finer.pyramid.width());
    finer.rows = Resampling(levels_.back().pyramid.height(), finer.pyramid.height());
  }
}

void FarnebackFlow::push(const PlaneView<std::uint8_t>& picture, ThreadPool& threads) {
  if (picture.width != width_ || picture.height != height_) start(picture.width, picture.height);
  scratch_.resize(static_cast<std::size_t>(threads.threads()));
  int bands = 0;
  for (auto& level : levels_) {
    std::swap(level.last, level.next);
    bands += parts(level.pyramid.height(), rows_per_expansion);
  }
  threads.for_each(bands, [&](int band, int thread) {
    for (auto& level : levels_) {
      const int here = parts(level.pyramid.height(), rows_per_expansion);
      if (band < here) return expand(picture, level, band, scratch_[thread]);
      band -= here;
    }
  });
}

void FarnebackFlow::expand(const PlaneView<std::uint8_t>& picture, Level& level, int band,
                           Scratch& scratch) {
  constexpr int reach = PolynomialExpansion::reach;
  const int first = band * rows_per_expansion;
  const int last = std::min(first + rows_per_expansion, level.pyramid.height());
  const int end = level.pyramid.height() - 1;
  for (auto& row : scratch.rows)
    row.resize(static_cast<std::size_t>(level.pyramid.width()) + Resampling::spare);
  const auto slot = [&](int y) -> std::vector<float>& {
    return scratch.rows[static_cast<std::size_t>(y) % scratch.rows.size()];
  };
  int known = std::max(0, first - reach);
  for (int y = first; y < last; ++y) {
    for (; known <= std::min(y + reach, end); ++known)
      level.pyramid.row(picture, known, scratch.pyramid, slot(known).data());
    PolynomialExpansion::Window window;
    for (int k = -reach; k <= reach; ++k)
      window[static_cast<std::size_t>(reach + k)] = slot(std::clamp(y + k, 0, end)).data();
    level.next.fit(y, window, scratch.expansion);
  }
}

PlaneView<Flow> FarnebackFlow::flow(ThreadPool& threads) {
  assert(!levels_.empty());
  scratch_.resize(static_cast<std::size_t>(threads.threads()));
  for (std::size_t level = levels_.size(); level-- > 0;) {
    find_first(level, threads);
    for (int i = 0; i < iterations; ++i) iterate(levels_[level], threads);
  }
  return view(levels_.front().flow, width_);
}

/// Where a level begins: at the flow of the coarser one, or at no motion.
void FarnebackFlow::find_first(std::size_t level, ThreadPool& threads) {
  Level& here = levels_[level];
  if (level + 1 == levels_.size()) {
    for (int y = 0; y < here.flow.height(); ++y)
      std::fill_n(here.flow.row(y), here.flow.width(), Flow{0, 0});
    return;
  }
  const Level& coarser = levels_[level + 1];
  const int height = here.flow.height();
  threads.for_each(parts(height, rows_per_update), [&](int band, int thread) {
    auto& between = scratch_[thread].flow_row;
    between.resize(2 * static_cast<std::size_t>(coarser.flow.width()));
    const int last = std::min((band + 1) * rows_per_update, height);
    for (int y = band * rows_per_update; y < last; ++y) {
      const int upper = here.rows.first()[y];
      const int lower = std::min(upper + 1, coarser.flow.height() - 1);
      resample_pairs(&coarser.flow.row(upper)->x, &coarser.flow.row(lower)->x,
                     here.rows.weight()[y], coarser.pyramid.width(), here.columns, 2,
                     between.data(), &here.flow.row(y)->x);
    }
  });
}

void FarnebackFlow::iterate(Level& level, ThreadPool& threads) {
  const int height = level.flow.height();
  const int bands = update_bands(height, threads.threads());
  threads.for_each(bands, [&](int band, int thread) {
    level.update.run(level.last, level.next, view(level.flow, level.pyramid.width()),
                     height * band / bands, height * (band + 1) / bands, scratch_[thread].update,
                     level.better);
  });
  std::swap(level.flow, level.better);
}

}  // namespace eventcamera
