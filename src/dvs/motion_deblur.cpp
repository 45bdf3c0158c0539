// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/motion_deblur.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#define HWY_TARGET_INCLUDE "src/dvs/motion_deblur.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

using Path = MotionDeblur::Path;
using Floats = hn::CappedTag<float, MotionDeblur::block>;

/// Mean of pixels from (x, y) on along a path.
HWY_INLINE hn::Vec<Floats> mean_along(const Image<float>& image, const Path& path, int x, int y) {
  const Floats floats;
  const float* centre = image.row(y) + x;
  auto sum = hn::LoadU(floats, centre);
  if (path.length == 1) return sum;
  const float half = path.length / 2;
  const std::ptrdiff_t row = image.stride() / static_cast<std::ptrdiff_t>(sizeof(float));
  const bool is_wide = std::abs(path.dx) == 1;
  const std::ptrdiff_t along = is_wide ? (path.dx > 0 ? 1 : -1) : (path.dy > 0 ? row : -row);
  const std::ptrdiff_t across = is_wide ? row : 1;
  const float slope = is_wide ? path.dy : path.dx;
  // Both samples at distance j lie between `near` and its neighbour across.
  for (int j = 1; static_cast<float>(j) < half + 0.5F; ++j) {
    const float moved = static_cast<float>(j) * slope;
    const float whole = std::floor(moved);
    const auto near = j * along + static_cast<std::ptrdiff_t>(whole) * across;
    const auto pair = [&](std::ptrdiff_t at) HWY_ATTR {
      return hn::LoadU(floats, centre + at) + hn::LoadU(floats, centre - at);
    };
    const auto first = pair(near);
    const auto rise = pair(near + across) - first;
    const auto samples = first + hn::Set(floats, moved - whole) * rise;
    const float weight = std::min(1.0F, half + 0.5F - static_cast<float>(j));
    sum = sum + hn::Set(floats, weight) * samples;
  }
  return sum * hn::Set(floats, 1 / path.length);
}

/// Writes `to` = frame / mean(light) for a row.
void divide_row(const float* frame, const Image<float>& light, const Path* paths, int y,
                float* to) {
  const Floats floats;
  // Bounds iterations that do not converge because paths cross.
  const auto limit = hn::Set(floats, 4);
  const int lanes = static_cast<int>(hn::Lanes(floats));
  for (int x = 0; x < light.width(); x += lanes) {
    const auto mean = mean_along(light, paths[x / MotionDeblur::block], x, y);
    hn::StoreU(hn::Min(hn::LoadU(floats, frame + x) / mean, limit), floats, to + x);
  }
}

/// Multiplies `light` by mean(ratio)^2 in a row.
void multiply_row(const Image<float>& ratio, const Path* paths, int y, float* light) {
  const Floats floats;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  for (int x = 0; x < ratio.width(); x += lanes) {
    const auto mean = mean_along(ratio, paths[x / MotionDeblur::block], x, y);
    hn::StoreU(hn::LoadU(floats, light + x) * (mean * mean), floats, light + x);
  }
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(divide_row);
HWY_EXPORT(multiply_row);

namespace {

/// Samples are up to max_length / 2 pixels from a block, and a block may end past the row.
constexpr int margin = MotionDeblur::max_length / 2 + 2 + MotionDeblur::block;

/// Added to grey levels so that no light is 0: rounding may have removed up to half a level.
constexpr float offset = 0.5F;

void replicate_sides(Image<float>& image, int y) {
  float* row = image.row(y);
  std::fill_n(row - margin, margin, row[0]);
  std::fill_n(row + image.width(), margin, row[image.width() - 1]);
}

/// Call after replicate_sides() of all rows.
void replicate_ends(Image<float>& image) {
  const auto copy = [&](int from, int to) {
    std::copy_n(image.row(from) - margin, image.width() + 2 * margin, image.row(to) - margin);
  };
  for (int i = 1; i <= margin; ++i) {
    copy(0, -i);
    copy(image.height() - 1, image.height() - 1 + i);
  }
}

MotionDeblur::Path path_of(const Flow& flow, double share) {
  if (!std::isfinite(flow.x) || !std::isfinite(flow.y)) return {0, 0, 1};
  const float longer = std::max(std::abs(flow.x), std::abs(flow.y));
  const float length = static_cast<float>(longer * share);
  if (length <= 1) return {0, 0, 1};
  return {flow.x / longer, flow.y / longer,
          std::min(length, static_cast<float>(MotionDeblur::max_length))};
}

/// The flow that ends at (x, y): a fixed point of f = flow(x - f).
Flow flow_to(const ImageView<Flow>& flow, int x, int y) {
  const auto moved_back = [](int from, float by, int size) {
    return static_cast<int>(
        std::lround(std::clamp(static_cast<float>(from) - by, 0.0F, static_cast<float>(size - 1))));
  };
  Flow found = flow.row(y)[x];
  for (int i = 0; i < 3 && std::isfinite(found.x) && std::isfinite(found.y); ++i)
    found = flow.row(moved_back(y, found.y, flow.height))[moved_back(x, found.x, flow.width)];
  return found;
}

}  // namespace

MotionDeblur::MotionDeblur(int width, int height)
    : paths_((width + block - 1) / block, height),
      moves_(height),
      frame_(width, height),
      light_(width, height, margin),
      ratio_(width, height, margin) {}

void MotionDeblur::set_motion(const ImageView<Flow>& flow, double share, bool at_end,
                              ThreadPool& threads) {
  for_each_row(threads, flow.height, [&](int y) {
    bool moves = false;
    for (int i = 0; i < paths_.width(); ++i) {
      const int x = std::min(i * block + block / 2, flow.width - 1);
      auto& path = paths_.at(i, y);
      path = path_of(at_end ? flow_to(flow, x, y) : flow.row(y)[x], share);
      moves |= path.length > 1;
    }
    moves_[y] = moves;
  });
}

template <class Pixel>
void MotionDeblur::sharpen(Image<Pixel>& frame, int bits, ThreadPool& threads) {
  const int width = frame.width();
  const int height = frame.height();
  const float scale = 255.0F / static_cast<float>((1 << bits) - 1);
  const auto moves = [&](int y) { return moves_[y] != 0; };
  for_each_row(threads, height, [&](int y) {
    for (int x = 0; x < width; ++x)
      frame_.row(y)[x] = static_cast<float>(frame.row(y)[x]) * scale + offset;
    std::copy_n(frame_.row(y), width, light_.row(y));
    std::fill_n(ratio_.row(y), width, 1.0F);
    replicate_sides(light_, y);
    replicate_sides(ratio_, y);
  });
  replicate_ends(light_);
  for (int i = 0; i < iterations; ++i) {
    for_each_row(threads, height, [&](int y) {
      if (!moves(y)) return;
      HWY_DYNAMIC_DISPATCH(divide_row)(frame_.row(y), light_, paths_.row(y), y, ratio_.row(y));
      replicate_sides(ratio_, y);
    });
    replicate_ends(ratio_);
    for_each_row(threads, height, [&](int y) {
      if (!moves(y)) return;
      HWY_DYNAMIC_DISPATCH(multiply_row)(ratio_, paths_.row(y), y, light_.row(y));
      replicate_sides(light_, y);
    });
    replicate_ends(light_);
  }
  for_each_row(threads, height, [&](int y) {
    if (!moves(y)) return;
    for (int x = 0; x < width; ++x) {
      const float grey = std::clamp(light_.row(y)[x] - offset, 0.0F, 255.0F);
      frame.row(y)[x] = static_cast<Pixel>(std::lrint(grey / scale));
    }
  });
}

template void MotionDeblur::sharpen(Image<std::uint8_t>&, int, ThreadPool&);
template void MotionDeblur::sharpen(Image<std::uint16_t>&, int, ThreadPool&);

}  // namespace eventcamera
#endif  // HWY_ONCE
