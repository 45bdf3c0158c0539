// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/simulate/simulator.hpp"

namespace eventcamera {

/// Difference frame interpolation (paper, section III-C). The difference frame D(i) = I(i) - I(i-1)
/// keeps the pixels that exceed the thresholds. Lucas-Kanade tracks them from D(i-1) to D(i), each
/// polarity separately; in the interpolated difference frame at a, each kept pixel p with flow f
/// fires at p + a f, rounded (several on one pixel fire once, with the polarity of the largest
/// difference). The last difference frame is D(i) itself.
///
/// A track is dropped if it is lost, leaves the frame, or ends more than a pixel away from all kept
/// pixels of its polarity in D(i): a pixel that has stopped moving does not fire.
///
/// The first interval has only one difference frame, so all its events come from D(1). Width and
/// height of `format` must not exceed max_side.
std::unique_ptr<Simulator> make_diff_simulator(const LumaFormat& format);

}  // namespace eventcamera
