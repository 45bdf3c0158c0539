// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/gl/point_tracker.hpp"

#include <algorithm>
#include <bit>
#include <iterator>

#include "src/gl/shaders.hpp"

namespace eventcamera::gl {
namespace {

// As in src/flow/lucas_kanade/pyramid.
constexpr std::size_t max_levels = 4;
constexpr int min_side = 15;

/// Groups of the kernels that process one pixel per invocation.
Groups groups_of(const LumaFormat& format) {
  return {gl::groups_of(64, format.width), format.height};
}

}  // namespace

Pyramid::Pyramid(const Context& gl, const LumaFormat& format) {
  int width = format.width;
  int height = format.height;
  do {
    levels_.emplace_back(gl, width, height);
    width = (width + 1) / 2;
    height = (height + 1) / 2;
  } while (levels_.size() < max_levels && std::min(width, height) > min_side);
}

PointTracker::PointTracker(const Context& gl, const LumaFormat& format)
    : format_(format),
      halve_(gl, "halve", shaders::halve),
      slope_(gl, "slope", shaders::slope),
      points_(gl, "points", shaders::points),
      search_(gl, "search", shaders::search),
      motion_(gl, "motion", shaders::motion),
      slopes_(gl) {
  slopes_.reserve(pixel_count(format) * 4);
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
  auto target = to.levels().rbegin();
  int number = static_cast<int>(from.levels().size());
  for (auto level = from.levels().rbegin(); level != from.levels().rend(); ++level, ++target) {
    const auto& [format, picture] = *level;
    slope_.run(groups_of(format), {&picture.buffer(), &slopes_}, {format.width, format.height});
    search_.run(groups_of(format_),
                {&picture.buffer(), &slopes_, &target->picture.buffer(), &points},
                {format_.width, --number, format.width, format.height});
  }
}

}  // namespace eventcamera::gl
