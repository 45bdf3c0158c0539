// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/gl/event_sort.hpp"

#include <algorithm>
#include <bit>

#include "src/gl/objects.hpp"
#include "src/gl/shaders.hpp"

namespace eventcamera::gl {
namespace {

constexpr int groups = 256;  ///< enough to occupy large GPUs

/// Bytes of a number, up to the highest one that is not 0.
int bytes_of(std::uint64_t number) {
  return groups_of(8, static_cast<int>(std::bit_width(number)));
}

}  // namespace

EventSort::EventSort(const Context& gl, const LumaFormat& format)
    : width_(format.width),
      place_passes_(bytes_of(pixel_count(format) - 1)),
      kernel_(gl, "sort", shaders::sort),
      counts_(gl),
      lists_{Buffer(gl), Buffer(gl)} {
  counts_.reserve(groups * 256 * sizeof(std::uint32_t));
}

Buffer& EventSort::unsorted(const Buffer& sorted) {
  for (auto& list : lists_) list.reserve(sorted.size());
  return lists_[0];
}

void EventSort::run(const Buffer& sorted, std::uint32_t duration) const {
  // Events past the end have the largest time.
  const int passes = place_passes_ + std::min(4, bytes_of(std::uint64_t{duration} + 1));
  for (int pass = 0; pass < passes; ++pass) {
    const auto& to = pass + 1 == passes ? sorted : lists_[(pass + 1) % 2];
    const bool is_time = pass >= place_passes_;
    const int shift = 8 * (is_time ? pass - place_passes_ : pass);
    for (const int moves : {0, 1})
      kernel_.run({groups}, {&lists_[pass % 2], &counts_, &to}, {width_, is_time, shift, moves});
  }
}

}  // namespace eventcamera::gl
