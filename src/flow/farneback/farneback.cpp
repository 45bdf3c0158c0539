// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/farneback/farneback.hpp"

#include <algorithm>
#include <cassert>
#include <utility>

#include "src/flow/scratch.hpp"

namespace eventcamera {
namespace {

constexpr int max_levels = 4;
constexpr int min_side = 32;  ///< of a pyramid level

/// Neighbouring bands of polynomials share image rows, which are computed twice, so bands must not
/// be thin.
constexpr int rows_per_expansion = 32;

int expansion_bands(int height) {
  return (height + rows_per_expansion - 1) / rows_per_expansion;
}

/// A band of flow goes through all iterations while its polynomials are in the cache, and each
/// iteration needs more rows around it. So bands are thick, but numerous enough for all threads.
int flow_bands(int height, int threads) {
  constexpr int min_rows = 60;
  constexpr int max_rows = 160;
  return std::clamp(height / min_rows, 1, std::max(2 * threads, height / max_rows));
}

}  // namespace

FarnebackFlow::Level::Level(int width, int height, int level)
    : pyramid(width, height, level),
      last(pyramid.width(), pyramid.height()),
      next(pyramid.width(), pyramid.height()),
      update(pyramid.width(), pyramid.height()),
      flow(pyramid.width(), pyramid.height()) {}

int FarnebackFlow::level_count(int width, int height) {
  int count = 1;
  while (count < max_levels && std::min(width, height) >= min_side << count) ++count;
  return count;
}

void FarnebackFlow::start(int width, int height) {
  width_ = width;
  height_ = height;
  levels_.clear();
  for (int level = 0; level < level_count(width, height); ++level) {
    levels_.emplace_back(width, height, level);
    if (level == 0) continue;
    Level& finer = levels_[levels_.size() - 2];
    finer.columns = Resampling(levels_.back().pyramid.width(), finer.pyramid.width());
    finer.rows = Resampling(levels_.back().pyramid.height(), finer.pyramid.height());
  }
}

void FarnebackFlow::push(const ImageView<std::uint8_t>& picture, ThreadPool& threads) {
  if (picture.width != width_ || picture.height != height_) start(picture.width, picture.height);
  scratch_.resize(static_cast<std::size_t>(threads.threads()));
  int bands = 0;
  for (auto& level : levels_) {
    std::swap(level.last, level.next);
    bands += expansion_bands(level.pyramid.height());
  }
  threads.for_each(bands, [&](int band, int thread) {
    for (auto& level : levels_) {
      const int here = expansion_bands(level.pyramid.height());
      if (band < here) return expand(picture, level, band, scratch_[thread]);
      band -= here;
    }
  });
}

void FarnebackFlow::expand(const ImageView<std::uint8_t>& picture, Level& level, int band,
                           Scratch& scratch) {
  constexpr int reach = PolynomialExpansion::reach;
  const int first = band * rows_per_expansion;
  const int last = std::min(first + rows_per_expansion, level.pyramid.height());
  const int end = level.pyramid.height() - 1;
  const auto padded_width = static_cast<std::size_t>(level.pyramid.width()) + row_padding;
  const auto row = [&](int y) {
    return scratch_of(scratch.rows[static_cast<std::size_t>(y) % scratch.rows.size()],
                      padded_width);
  };
  int known = std::max(0, first - reach);
  for (int y = first; y < last; ++y) {
    for (; known <= std::min(y + reach, end); ++known)
      level.pyramid.row(picture, known, scratch.pyramid, row(known));
    PolynomialExpansion::Window window;
    for (std::size_t k = 0; k < window.size(); ++k)
      window[k] = row(std::clamp(y - reach + static_cast<int>(k), 0, end));
    level.next.fit(y, window, scratch.expansion);
  }
}

ImageView<Flow> FarnebackFlow::flow(ThreadPool& threads) {
  assert(!levels_.empty());
  scratch_.resize(static_cast<std::size_t>(threads.threads()));
  const Level* coarser = nullptr;
  for (std::size_t i = levels_.size(); i-- > 0;) {
    Level& level = levels_[i];
    const int height = level.flow.height();
    const int bands = flow_bands(height, threads.threads());
    threads.for_each(bands, [&](int band, int thread) {
      find_rows(coarser, level, height * band / bands, height * (band + 1) / bands,
                scratch_[thread]);
    });
    coarser = &level;
  }
  return levels_.front().flow.view();
}

/// Computes rows [first, last) of a level's flow.
void FarnebackFlow::find_rows(const Level* coarser, Level& level, int first, int last,
                              Scratch& scratch) {
  const int height = level.flow.height();
  const auto stride = static_cast<std::size_t>(level.flow.stride()) / sizeof(Flow);
  const auto first_of = [&](int iteration) {
    return std::max(0, first - FlowUpdate::reach * (iterations - iteration));
  };
  const auto last_of = [&](int iteration) {
    return std::min(height, last + FlowUpdate::reach * (iterations - iteration));
  };
  const auto rows_of = [&](int iteration) -> FlowRows {
    if (iteration == iterations) return {level.flow.row(0), static_cast<std::ptrdiff_t>(stride), 0};
    auto& flow = scratch.flows[static_cast<std::size_t>(iteration) % 2];
    Flow* rows = scratch_of(flow, stride * static_cast<std::size_t>(last_of(0) - first_of(0)));
    return {rows, static_cast<std::ptrdiff_t>(stride), first_of(iteration)};
  };
  start_rows(coarser, level, last_of(0), scratch, rows_of(0));
  for (int i = 1; i <= iterations; ++i)
    level.update.run(level.last, level.next, rows_of(i - 1), first_of(i), last_of(i),
                     scratch.update, rows_of(i));
}

/// Initializes the rows of `out` before `last` from the flow of the coarser level, or with 0.
void FarnebackFlow::start_rows(const Level* coarser, const Level& level, int last, Scratch& scratch,
                               const FlowRows& out) {
  if (coarser == nullptr) {
    std::fill_n(out.row(out.first), (last - out.first) * out.stride, Flow{0, 0});
    return;
  }
  const int width = coarser->flow.width();
  Flow* row = scratch_of(scratch.coarser_row, static_cast<std::size_t>(width) + row_padding);
  for (int y = out.first; y < last; ++y) {
    const int upper = level.rows.first()[y];
    const int lower = std::min(upper + 1, coarser->flow.height() - 1);
    blend_rows(coarser->flow.row(upper), coarser->flow.row(lower), level.rows.weight()[y], width,
               row);
    row[width] = row[width - 1];
    resample_row(row, level.columns, 2, out.row(y));
  }
}

}  // namespace eventcamera
