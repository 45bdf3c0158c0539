// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/gl/point_tracker.hpp"

#include <algorithm>
#include <bit>
#include <iterator>
#include <vector>

#include "src/gl/shaders.hpp"

namespace eventcamera::gl {
namespace {

// As in src/flow/lucas_kanade/pyramid.
constexpr std::size_t max_levels = 4;
constexpr int min_side = 15;

/// Enough to occupy large GPUs; each takes blocks until none are left.
constexpr int max_search_groups = 2048;

/// Groups of the kernels that process one pixel per invocation.
Groups groups_of(const LumaFormat& format) {
  return {gl::groups_of(64, format.width), format.height};
}

/// The size of the next coarser level.
LumaFormat half_of(const LumaFormat& format) {
  return {(format.width + 1) / 2, (format.height + 1) / 2, format.bits};
}

}  // namespace

Pyramid::Pyramid(const Context& gl, const LumaFormat& format) {
  LumaFormat level = format;
  do {
    levels_.emplace_back(gl, level.width, level.height);
    level = half_of(level);
  } while (levels_.size() < max_levels && std::min(level.width, level.height) > min_side);
}

PointTracker::PointTracker(const Context& gl, const LumaFormat& format, int block_side)
    : format_(format),
      block_side_(block_side),
      halve_(gl, "halve", shaders::halve),
      slope_(gl, "slope", shaders::slope),
      points_(gl, "points", shaders::points),
      gather_(gl, "gather", shaders::gather),
      descend_(gl, "descend", shaders::descend),
      list_(gl, "list", shaders::list),
      search_(gl, "search", shaders::search),
      spread_(gl, "spread", shaders::spread),
      motion_(gl, "motion", shaders::motion),
      slopes_(gl) {
  slopes_.reserve((2 * pixel_count(format) + 1) * 4);
  // Points that are blocks themselves are searched for where they are stored.
  LumaFormat level = format;
  const std::size_t coarser_levels = block_side == 1 ? max_levels - 1 : max_levels;
  for (std::size_t i = 0; i < coarser_levels; ++i) {
    level = half_of(level);
    blocks_.emplace_back(gl).reserve(pixel_count(level) * 8);
  }
}

void PointTracker::build(const Pyramid& pyramid) const {
  const auto& levels = pyramid.levels();
  for (auto half = std::next(levels.begin()); half != levels.end(); ++half) {
    const auto& [format, picture] = *std::prev(half);
    halve_.run(
        {gl::groups_of(64, GreyFrame::words_across(half->format.width)), half->format.height},
        {&picture.buffer(), &half->picture.buffer()},
        {format.width, format.height, half->format.width});
  }
}

void PointTracker::find_points(const Pyramid& pyramid, const Buffer& points) const {
  points_.run(groups_of(format_), {&pyramid.picture().buffer(), &points}, {format_.width});
}

void PointTracker::to_motion(const Buffer& points, int steps, const GreyFrame& frame,
                             bool must_arrive) const {
  motion_.run(groups_of(format_), {&frame.buffer(), &points},
              {format_.width, format_.height, steps,
               std::bit_cast<int>(65536.0F / static_cast<float>(steps)), must_arrive ? 1 : 0});
}

void PointTracker::track(const Pyramid& from, const Pyramid& to, const Buffer& points) const {
  // The blocks of each level, from the finest on.
  std::vector<const Buffer*> blocks;
  if (block_side_ == 1) blocks.push_back(&points);
  const Buffer* finer = &points;
  LumaFormat finer_format = format_;
  for (auto coarser = blocks_.begin(); blocks.size() < from.levels().size(); ++coarser) {
    gather_.run(groups_of(half_of(finer_format)), {finer, &*coarser},
                {finer_format.width, finer_format.height});
    finer = blocks.emplace_back(&*coarser);
    finer_format = half_of(finer_format);
  }
  const Buffer* coarser = nullptr;
  auto target = to.levels().rbegin();
  for (auto level = from.levels().rbegin(); level != from.levels().rend(); ++level, ++target) {
    const auto& [format, picture] = *level;
    const auto of_blocks = block_side_ == 1 ? format : half_of(format);
    const Buffer& here = *blocks.back();
    blocks.pop_back();
    if (coarser != nullptr) descend_.run(groups_of(of_blocks), {coarser, &here}, {of_blocks.width});
    slope_.run(groups_of(format), {&picture.buffer(), &slopes_}, {format.width, format.height});
    list_.run(groups_of(of_blocks), {&here, &slopes_},
              {of_blocks.width, format.width * format.height});
    search_.run({std::min(max_search_groups, gl::groups_of(4, of_blocks.width * of_blocks.height))},
                {&picture.buffer(), &slopes_, &target->picture.buffer(), &here},
                {format.width, format.height, block_side_, blocks.empty() ? 1 : 0});
    coarser = &here;
  }
  if (block_side_ == 2)
    spread_.run(groups_of(format_), {coarser, &points}, {format_.width, format_.height});
}

}  // namespace eventcamera::gl
