// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/simulate/simulator.hpp"

namespace eventcamera {

/// Difference frame interpolation (paper, section III-C). The difference frame
/// D(i) = I(i) - I(i-1) keeps its ON and its OFF part where they exceed the thresholds.
/// Lucas-Kanade follows the kept pixels from D(i-1) to D(i), each polarity on its own; in the
/// interpolated difference frame at a, each kept pixel fires at p + a f, rounded (where several
/// meet, they fire once, with the polarity of the largest difference). The last difference frame
/// is D(i) itself.
///
/// A track is dropped that is lost, leaves the picture, or ends where D(i) keeps nothing of its
/// polarity within a pixel: what has stopped does not fire.
///
/// The first interval has one difference frame only, so its events are all of D(1).
/// Neither side of `format` may exceed max_side.
std::unique_ptr<Simulator> make_diff_simulator(const LumaFormat& format);

}  // namespace eventcamera
