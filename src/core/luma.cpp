// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/core/luma.hpp"

namespace eventcamera {

void unpack_luma(const std::uint8_t* data, std::ptrdiff_t stride, Image<std::uint8_t>& out) {
  for (int y = 0; y < out.height(); ++y) {
    const std::uint8_t* in = data + y * stride;
    std::uint8_t* row = out.row(y);
    for (int x = 0; x < out.width(); ++x) row[x] = in[std::ptrdiff_t{2} * x];
  }
}

}  // namespace eventcamera
