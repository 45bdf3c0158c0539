// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/simulate/simulator.hpp"

namespace eventcamera {

/// Sparse frame interpolation (paper, section III-B): only the pixels that changed by more than the
/// smaller threshold are tracked, with Lucas-Kanade from I(i-1) to I(i); a track that is lost or
/// leaves the picture is dropped. In the interpolated frame I(a) the brightness of a tracked pixel
/// stands at p + a f, rounded (where several meet, that of the last in raster order); a place that
/// a tracked pixel has left shows I(i), what it uncovered; the rest is I(i-1). I(1) = I(i). Then
/// each difference of neighbours is thresholded, at the time of its later frame.
/// Neither side of `format` may exceed max_side.
std::unique_ptr<Simulator> make_sparse_simulator(const LumaFormat& format);

}  // namespace eventcamera
