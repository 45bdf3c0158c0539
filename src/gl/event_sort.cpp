// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/gl/event_sort.hpp"

#include <algorithm>
#include <bit>
#include <utility>

#include "src/gl/grey_frame.hpp"
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
      other_(gl) {
  counts_.reserve(groups * 256 * sizeof(std::uint32_t));
}

int EventSort::passes(std::uint32_t duration) const {
  // Events past the end have the largest time.
  return place_passes_ + std::min(4, bytes_of(std::uint64_t{duration} + 1));
}

Buffer& EventSort::unsorted(Buffer& sorted, std::uint32_t duration) {
  other_.reserve(sorted.size());
  return passes(duration) % 2 == 0 ? sorted : other_;
}

void EventSort::run(const Buffer& sorted, std::uint32_t duration) const {
  const int count = passes(duration);
  const Buffer* from = count % 2 == 0 ? &sorted : &other_;
  const Buffer* to = count % 2 == 0 ? &other_ : &sorted;
  for (int pass = 0; pass < count; ++pass) {
    const bool is_time = pass >= place_passes_;
    const int shift = 8 * (is_time ? pass - place_passes_ : pass);
    for (const int moves : {0, 1})
      kernel_.run({groups}, {from, &counts_, to}, {width_, is_time, shift, moves});
    std::swap(from, to);
  }
}

}  // namespace eventcamera::gl
