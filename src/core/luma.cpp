// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/core/luma.hpp"

#include <cassert>

namespace eventcamera {
namespace {

/// The step is a template argument, so that compilers vectorize the loop.
template <int step>
void gather(const std::uint8_t* data, std::ptrdiff_t stride, Image<std::uint8_t>& out) {
  for (int y = 0; y < out.height(); ++y) {
    const std::uint8_t* in = data + y * stride;
    std::uint8_t* row = out.row(y);
    for (int x = 0; x < out.width(); ++x) row[x] = in[std::ptrdiff_t{step} * x];
  }
}

}  // namespace

void gather_luma(const std::uint8_t* data, std::ptrdiff_t stride, int step,
                 Image<std::uint8_t>& out) {
  assert(step >= 2 && step <= 4);
  if (step == 2)
    gather<2>(data, stride, out);
  else if (step == 3)
    gather<3>(data, stride, out);
  else
    gather<4>(data, stride, out);
}

void swap_luma(const void* data, std::ptrdiff_t stride, Image<std::uint16_t>& out) {
  const ImageView<std::uint16_t> in{static_cast<const std::uint16_t*>(data), stride, out.width(),
                                    out.height()};
  for (int y = 0; y < out.height(); ++y) {
    const std::uint16_t* words = in.row(y);
    std::uint16_t* row = out.row(y);
    for (int x = 0; x < out.width(); ++x)
      row[x] = static_cast<std::uint16_t>(words[x] << 8 | words[x] >> 8);
  }
}

}  // namespace eventcamera
