// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/region_of_interest_flow.hpp"

#include <algorithm>
#include <utility>

namespace eventcamera {
namespace {

/// Region along one axis: [from, to) and its surroundings, rounded up, within the frame.
struct Range {
  int first;
  int last;

  Range(int from, int to, int size) {
    constexpr int surroundings = RegionOfInterestFlow::surroundings;
    constexpr int side_step = RegionOfInterestFlow::side_step;
    const int wanted = to - from + 2 * surroundings;
    const int length = std::min((wanted + side_step - 1) / side_step * side_step, size);
    first = std::clamp(from - (length - (to - from)) / 2, 0, size - length);
    last = first + length;
  }
};

ImageView<std::uint8_t> crop(const ImageView<std::uint8_t>& image, const Box& part) {
  return {image.row(part.top) + part.left, image.stride, part.width(), part.height()};
}

}  // namespace

RegionOfInterestFlow::RegionOfInterestFlow(FlowMethod method, int width, int height)
    : method_(method), width_(width), height_(height), flow_(width, height) {}

ImageView<Flow> RegionOfInterestFlow::find(const ImageView<std::uint8_t>& from,
                                           const ImageView<std::uint8_t>& to, const Box& changed,
                                           ThreadPool& threads) {
  Box part;
  if (!changed.empty()) {
    const Range columns(changed.left, changed.right, width_);
    const Range rows(changed.top, changed.bottom, height_);
    part = {columns.first, rows.first, columns.last, rows.last};
  }
  // A region of more than half the frame is extended to the whole frame, so that the next call
  // reuses the work on `to`.
  if (2 * static_cast<std::int64_t>(part.width()) * part.height() >
      static_cast<std::int64_t>(width_) * height_) {
    if (!whole_) whole_ = make_dense_flow(method_);
    if (!std::exchange(whole_has_last_, true)) whole_->push(from, threads);
    whole_->push(to, threads);
    return whole_->flow(threads);
  }
  whole_has_last_ = false;
  clear();
  if (!part.empty()) {
    if (!part_) part_ = make_dense_flow(method_);
    const auto found = part_->find(crop(from, part), crop(to, part), threads);
    for (int y = 0; y < part.height(); ++y)
      std::copy_n(found.row(y), part.width(), flow_.row(part.top + y) + part.left);
  }
  filled_ = part;
  return flow_.view();
}

void RegionOfInterestFlow::clear() {
  for (int y = filled_.top; y < filled_.bottom; ++y)
    std::fill_n(flow_.row(y) + filled_.left, filled_.width(), Flow{});
  filled_ = {};
}

}  // namespace eventcamera
