// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/gl/difference.hpp"

#include "src/gl/shaders.hpp"

namespace eventcamera::gl {

DifferenceKernel::DifferenceKernel(const Context& gl, const LumaFormat& format)
    : format_(format), kernel_(gl, "difference", shaders::difference) {}

void DifferenceKernel::run(const GreyFrame& before, const GreyFrame& now,
                           const Thresholds& thresholds, int step, const EventList& out) const {
  const int words = GreyFrame::words_across(format_.width);
  kernel_.run({groups_of(64, words), format_.height},
              {&before.buffer(), &now.buffer(), &out.marks()},
              {format_.width, words, out.marks_across(), (step - 1) * out.marks_a_step(),
               thresholds.positive, thresholds.negative});
}

}  // namespace eventcamera::gl
