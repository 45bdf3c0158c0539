// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/farneback/farneback.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <utility>

#include "src/flow/scratch.hpp"

namespace eventcamera {
namespace {

/// Minimum side of a pyramid level.
constexpr int min_side = 32;

/// Rows at the edge of a band are blurred twice, for both bands, so bands must not be thin.
constexpr int rows_per_expansion = 32;

int expansion_bands(int height) {
  return (height + rows_per_expansion - 1) / rows_per_expansion;
}

/// Tiles of a level, as high as the image. Each passes through all iterations block by block, while
/// the polynomials of the last blocks are in the cache. Because each iteration needs more columns
/// around the tile, tiles are as wide as the number of threads allows. They end at multiples of 16
/// pixels.
struct Tiles {
  Tiles(int level_width, int threads) : width(level_width) {
    constexpr int min_columns = 80;
    constexpr int max_columns = 960;
    count = std::clamp(width / min_columns, 1, std::max(threads, width / max_columns));
  }
  int left(int tile) const {
    return tile == count ? width : width * tile / count / row_padding * row_padding;
  }
  int width;
  int count;
};

}  // namespace

FarnebackFlow::Level::Level(int width, int height, int level)
    : iterations(FarnebackFlow::iterations[level]),
      pyramid(width, height, level),
      last(pyramid.width(), pyramid.height()),
      next(pyramid.width(), pyramid.height()),
      update(pyramid.width(), pyramid.height()),
      flow(pyramid.width(), pyramid.height()) {}

int FarnebackFlow::level_count(int width, int height) {
  constexpr int max_levels = iterations.size();
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

void FarnebackFlow::push(const ImageView<std::uint8_t>& image, ThreadPool& threads) {
  if (image.width != width_ || image.height != height_) start(image.width, image.height);
  scratch_.resize(threads.threads());
  int bands = 0;
  for (auto& level : levels_) {
    std::swap(level.last, level.next);
    bands += expansion_bands(level.pyramid.height());
  }
  threads.for_each(bands, [&](int band, int thread) {
    for (auto& level : levels_) {
      const int here = expansion_bands(level.pyramid.height());
      if (band < here) return expand(image, level, band, scratch_[thread]);
      band -= here;
    }
  });
}

void FarnebackFlow::expand(const ImageView<std::uint8_t>& image, Level& level, int band,
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
      level.pyramid.row(image, known, scratch.pyramid, row(known));
    PolynomialExpansion::Window window;
    for (std::size_t k = 0; k < window.size(); ++k)
      window[k] = row(std::clamp(y - reach + static_cast<int>(k), 0, end));
    level.next.fit(y, window, scratch.expansion);
  }
}

ImageView<Flow> FarnebackFlow::flow(ThreadPool& threads) {
  assert(!levels_.empty());
  scratch_.resize(threads.threads());
  const Level* coarser = nullptr;
  for (std::size_t i = levels_.size(); i-- > 0;) {
    Level& level = levels_[i];
    const Tiles tiles(level.flow.width(), threads.threads());
    threads.for_each(tiles.count, [&](int tile, int thread) {
      find_columns(coarser, level, tiles.left(tile), tiles.left(tile + 1), scratch_[thread]);
    });
    coarser = &level;
  }
  return levels_.front().flow.view();
}

/// Computes columns [first, last) of a level's flow: every other row by FlowUpdate, the rows
/// between as their mean.
void FarnebackFlow::find_columns(const Level* coarser, Level& level, int first, int last,
                                 Scratch& scratch) {
  constexpr int block_rows = FlowUpdate::window_rows;
  constexpr int row_step = FlowUpdate::row_step;
  const int width = level.flow.width();
  const int height = level.flow.height();
  const int row_count = FlowUpdate::rows(height);
  const auto stride = static_cast<std::size_t>(level.flow.stride()) / sizeof(Flow);
  const int iteration_count = level.iterations;
  const auto first_of = [&](int iteration) {
    return std::max(0, first - FlowUpdate::margin * (iteration_count - iteration));
  };
  const auto last_of = [&](int iteration) {
    return std::min(width, last + FlowUpdate::margin * (iteration_count - iteration));
  };
  // Each iteration runs one block behind the previous one.
  constexpr int kept_rows = 2 * block_rows;
  std::array<FlowRows, FarnebackFlow::iterations.back() + 1> rows;
  for (int i = 0; i < iteration_count; ++i)
    rows[i] = {scratch_of(scratch.flows[i], stride * std::size_t{kept_rows}),
               static_cast<std::ptrdiff_t>(stride), kept_rows};
  rows[iteration_count] = {level.flow.row(0), static_cast<std::ptrdiff_t>(stride * row_step),
                           row_count};
  int started = 0;
  int ended = 1;
  for (int block = 0; block < FlowUpdate::blocks(height) + iteration_count - 1; ++block) {
    for (; started < std::min(row_count, block * block_rows + FlowUpdate::row_reach + 1); ++started)
      start_row(coarser, level, started * row_step, first_of(0), last_of(0), scratch,
                rows[0].row(started));
    for (int i = 1; i <= iteration_count; ++i)
      level.update.run(level.last, level.next, rows[i - 1], first_of(i), last_of(i),
                       block - (i - 1), scratch.updates[i - 1], rows[i]);
    for (; ended < std::min(row_count, (block - (iteration_count - 1)) * block_rows + 1); ++ended)
      blend_rows(rows[iteration_count].row(ended - 1) + first,
                 rows[iteration_count].row(ended) + first, 0.5F, last - first,
                 level.flow.row(ended * row_step - 1) + first);
  }
  if (height % row_step == 0)
    std::copy(level.flow.row(height - 2) + first, level.flow.row(height - 2) + last,
              level.flow.row(height - 1) + first);
}

/// Initializes columns [first, last) of row y from the coarser level, or with 0.
void FarnebackFlow::start_row(const Level* coarser, const Level& level, int y, int first, int last,
                              Scratch& scratch, Flow* out) {
  if (coarser == nullptr) {
    std::fill(out + first, out + last, Flow{0, 0});
    return;
  }
  const int width = coarser->flow.width();
  Flow* row = scratch_of(scratch.coarser_row, static_cast<std::size_t>(width) + row_padding);
  const int upper = level.rows.first()[y];
  const int lower = std::min(upper + 1, coarser->flow.height() - 1);
  const int left = level.columns.first()[first];
  const int right = std::min(level.columns.first()[last - 1] + 2, width);
  blend_rows(coarser->flow.row(upper) + left, coarser->flow.row(lower) + left,
             level.rows.weight()[y], right - left, row + left);
  row[width] = row[width - 1];
  resample_columns(row, level.columns, first, last, 2, out);
}

}  // namespace eventcamera
