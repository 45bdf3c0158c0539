// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/region_of_interest_flow.hpp"

#include <algorithm>

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
  if (changed.empty()) {
    whole_has_last_ = false;
    clear();
    return flow_.view();
  }
  const Range columns(changed.left, changed.right, width_);
  const Range rows(changed.top, changed.bottom, height_);
  const Box part{columns.first, rows.first, columns.last, rows.last};
  // A region of more than half the frame is extended to the whole frame, so that the next call
  // reuses the work on `to`.
  if (2 * static_cast<std::int64_t>(part.width()) * part.height() >
      static_cast<std::int64_t>(width_) * height_)
    return find_in_whole(from, to, threads);
  whole_has_last_ = false;
  find_in_part(from, to, part, threads);
  return flow_.view();
}

ImageView<Flow> RegionOfInterestFlow::find_in_whole(const ImageView<std::uint8_t>& from,
                                                    const ImageView<std::uint8_t>& to,
                                                    ThreadPool& threads) {
  if (!whole_) whole_ = make_dense_flow(method_);
  if (!whole_has_last_) whole_->push(from, threads);
  whole_->push(to, threads);
  whole_has_last_ = true;
  return whole_->flow(threads);
}

void RegionOfInterestFlow::find_in_part(const ImageView<std::uint8_t>& from,
                                        const ImageView<std::uint8_t>& to, const Box& part,
                                        ThreadPool& threads) {
  if (!part_) part_ = make_dense_flow(method_);
  const auto found = part_->find(crop(from, part), crop(to, part), threads);
  clear();
  for (int y = 0; y < part.height(); ++y)
    std::copy_n(found.row(y), part.width(), flow_.row(part.top + y) + part.left);
  filled_ = part;
}

void RegionOfInterestFlow::clear() {
  for (int y = filled_.top; y < filled_.bottom; ++y)
    std::fill_n(flow_.row(y) + filled_.left, filled_.width(), Flow{});
  filled_ = {};
}

}  // namespace eventcamera
