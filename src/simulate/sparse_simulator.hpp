// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/simulate/simulator.hpp"

namespace eventcamera {

/// Sparse frame interpolation (paper, section III-B): only pixels that changed by more than the
/// smaller threshold are tracked, with Lucas-Kanade from I(i-1) to I(i); a track that is lost or
/// leaves the frame is dropped. The interpolated frame I(a) is I(i-1), except that each tracked
/// pixel p with flow f is drawn at p + a f, rounded (the last in raster order wins), and the pixel
/// it left shows the uncovered background, I(i). I(1) = I(i). Differences of successive frames are
/// thresholded; events take the time of the later frame. Width and height of `format` must not
/// exceed max_side.
std::unique_ptr<Simulator> make_sparse_simulator(const LumaFormat& format);

}  // namespace eventcamera
