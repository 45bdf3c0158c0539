// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/dis/dis.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "src/flow/scratch.hpp"

namespace eventcamera {
namespace {

/// Flow of a level at a position, interpolated bilinearly.
Flow flow_at(const VariationalRefinement& level, float x, float y) {
  const auto place = [](float position, int size) {
    return std::clamp(position, 0.0F, static_cast<float>(size - 1));
  };
  const float from_x = place(x, level.width());
  const float from_y = place(y, level.height());
  const int left = static_cast<int>(from_x);
  const int top = static_cast<int>(from_y);
  const int right = std::min(left + 1, level.width() - 1);
  const int bottom = std::min(top + 1, level.height() - 1);
  const auto between = [](const Flow& a, const Flow& b, float weight) -> Flow {
    return {a.x + weight * (b.x - a.x), a.y + weight * (b.y - a.y)};
  };
  const float along = from_x - static_cast<float>(left);
  return between(between(level.at(left, top), level.at(right, top), along),
                 between(level.at(left, bottom), level.at(right, bottom), along),
                 from_y - static_cast<float>(top));
}

}  // namespace

int DisFlow::Quality::coarsest_scale(int width, int height) const {
  const auto [shorter, longer] = std::minmax({width, height});
  return std::min(static_cast<int>(std::lround(std::log2(longer / (4.0 * patch)))),
                  static_cast<int>(std::log2(shorter / patch)));
}

int DisFlow::Quality::finest_scale(int width, int height) const {
  return std::clamp(coarsest_scale(width, height) - scales + 1, 0, max_finest);
}

DisFlow::Level::Level(const AreaShrink& shrink_, const Quality& quality)
    : shrink(shrink_),
      last(shrink.width(), shrink.height()),
      next(shrink.width(), shrink.height()),
      gradients(shrink.width(), shrink.height()),
      grid(shrink.width(), shrink.height(), quality.patch, quality.stride),
      flows(grid.columns, grid.rows),
      found(grid.columns, grid.rows),
      refinement(shrink.width(), shrink.height()) {}

void DisFlow::start(int width, int height) {
  width_ = width;
  height_ = height;
  flow_ = Image<Flow>(width, height);
  width = std::max(width, min_side);
  height = std::max(height, min_side);
  if (width != width_ || height != height_) padded_ = Image<std::uint8_t>(width, height);
  const int coarsest = quality_.coarsest_scale(width, height);
  finest_scale_ = quality_.finest_scale(width, height);
  levels_.clear();
  columns_ = Resampling(width >> finest_scale_, width);
  rows_ = Resampling(height >> finest_scale_, height);
  for (int scale = finest_scale_; scale <= coarsest; ++scale) {
    const AreaShrink shrink(width, height, levels_.empty() ? width >> finest_scale_ : width / 2,
                            levels_.empty() ? height >> finest_scale_ : height / 2);
    levels_.emplace_back(shrink, quality_);
    width = shrink.width();
    height = shrink.height();
  }
}

ImageView<std::uint8_t> DisFlow::padded(const ImageView<std::uint8_t>& image) {
  if (std::min(image.width, image.height) >= min_side) return image;
  for (int y = 0; y < padded_.height(); ++y) {
    const std::uint8_t* row = image.row(std::min(y, image.height - 1));
    std::fill(std::copy_n(row, image.width, padded_.row(y)), padded_.row(y) + padded_.width(),
              row[image.width - 1]);
  }
  return padded_.view();
}

/// Runs body(rows, scratch) for the bands of an image of this height.
template <class Body>
void DisFlow::for_each_band(int height, ThreadPool& threads, const Body& body) {
  scratch_.resize(threads.threads());
  threads.for_each(band_count(height),
                   [&](int band, int thread) { body(BandRows(band, height), scratch_[thread]); });
}

void DisFlow::push(const ImageView<std::uint8_t>& image, ThreadPool& threads) {
  if (image.width != width_ || image.height != height_) start(image.width, image.height);
  auto from = padded(image);
  for (auto& level : levels_) {
    std::swap(level.last, level.next);
    for_each_band(level.shrink.height(), threads, [&](const BandRows& rows, Scratch& scratch) {
      for (int y = rows.first; y < rows.last; ++y)
        level.next.shrink_row(level.shrink, from, y, scratch.sums);
    });
    level.next.replicate_rows();
    from = level.next.grey().view();
  }
}

ImageView<Flow> DisFlow::flow(ThreadPool& threads) {
  assert(!levels_.empty());
  const Level* coarser = nullptr;
  for (std::size_t i = levels_.size(); i-- > 0;) {
    Level& level = levels_[i];
    const auto& last = level.last.grey();
    const auto& next = level.next.grey();
    for_each_band(last.height(), threads, [&](const BandRows& rows, Scratch& scratch) {
      for (int y = rows.first; y < rows.last; ++y) level.gradients.row(last, y, scratch.slopes);
    });
    threads.for_each(level.grid.rows, [&](int row, int) { search(coarser, level, row); });
    for (int round = 0; round < quality_.propagations; ++round) {
      std::swap(level.flows, level.found);
      threads.for_each(level.grid.rows, [&](int row, int) {
        search_row(level.grid, last, level.gradients, next, row, quality_.iterations, &level.found,
                   level.flows.row(row));
      });
    }
    for_each_band(last.height(), threads, [&](const BandRows& rows, Scratch& scratch) {
      spread_patches(level.grid, last, next, level.flows, rows.first, rows.last, scratch.sums,
                     level.refinement.start());
    });
    level.refinement.run(last, next, threads);
    coarser = &level;
  }
  constexpr int rows_per_round = 64;  // neighbouring rows share rows of the finest level
  threads.for_each((height_ + rows_per_round - 1) / rows_per_round, [&](int round, int thread) {
    const int first = round * rows_per_round;
    upsample(first, std::min(first + rows_per_round, height_), scratch_[thread]);
  });
  return flow_.view();
}

void DisFlow::search(const Level* coarser, Level& level, int row) const {
  const PatchGrid& grid = level.grid;
  Flow* flows = level.flows.row(row);
  std::fill_n(flows, grid.columns, Flow{});
  if (coarser != nullptr) {
    const auto ratio = [](int from, int to) {
      return static_cast<float>(from) / static_cast<float>(to);
    };
    const float ratio_x = ratio(coarser->refinement.width(), level.refinement.width());
    const float ratio_y = ratio(coarser->refinement.height(), level.refinement.height());
    const auto centre = [&](int i) {
      const int half = grid.side / 2;
      return static_cast<float>(i * grid.stride + half) + 0.5F;
    };
    for (int i = 0; i < grid.columns; ++i) {
      const Flow coarse =
          flow_at(coarser->refinement, centre(i) * ratio_x - 0.5F, centre(row) * ratio_y - 0.5F);
      flows[i] = {2 * coarse.x, 2 * coarse.y};
    }
  }
  search_row(grid, level.last.grey(), level.gradients, level.next.grey(), row, quality_.iterations,
             nullptr, flows);
}

void DisFlow::upsample(int first, int last, Scratch& scratch) {
  const auto& finest = levels_.front().refinement;
  std::array<int, 2> known = {-1, -1};
  const auto upsampled_row = [&](int y) {
    const auto slot = static_cast<std::size_t>(y) % 2;
    const auto padded_width = static_cast<std::size_t>(columns_.size()) + row_padding;
    Flow* upsampled = scratch_of(scratch.upsampled_rows[slot], padded_width);
    if (std::exchange(known[slot], y) == y) return upsampled;
    Flow* row = scratch_of(scratch.row,
                           static_cast<std::size_t>(finest.width()) + std::size_t{2} * row_padding);
    finest.row(y, row);
    row[finest.width()] = row[finest.width() - 1];
    resample_row(row, columns_, static_cast<float>(1 << finest_scale_), upsampled);
    return upsampled;
  };
  for (int y = first; y < last; ++y) {
    const int upper = rows_.first()[y];
    const int lower = std::min(upper + 1, finest.height() - 1);
    blend_rows(upsampled_row(upper), upsampled_row(lower), rows_.weight()[y], width_, flow_.row(y));
  }
}

}  // namespace eventcamera
