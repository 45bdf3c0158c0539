// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/flow/dense_flow.hpp"
#include "src/simulate/simulator.hpp"
#include "src/simulate/warp.hpp"

// Width and height of the formats must not exceed max_side.

namespace eventcamera {

/// Frame differencing (paper, section III): ON where I(i) - I(i-1) > C+, OFF where I(i-1) - I(i) >
/// C-, all at the time of I(i). No frames are interpolated.
std::unique_ptr<Simulator> make_frame_simulator(const LumaFormat& format);

/// Dense frame interpolation (paper, section III-A): frames between I(i-1) and I(i) are sampled
/// bilinearly along the flow F from I(i-1) to I(i), with replicated borders; I(1) = I(i).
/// Differences of successive frames are thresholded; events take the time of the later frame.
class DenseSimulator : public Simulator {
 public:
  void set_flow(FlowMethod method) { method_ = method; }
  void set_interpolation(Interpolation interpolation) { interpolation_ = interpolation; }

 protected:
  using Simulator::Simulator;
  FlowMethod method_ = FlowMethod::dis_lq;
  Interpolation interpolation_ = Interpolation::forward;
};

std::unique_ptr<DenseSimulator> make_dense_simulator(const LumaFormat& format);

/// Sparse frame interpolation (paper, section III-B): Lucas-Kanade tracks the pixels that changed
/// by more than the smaller threshold from I(i-1) to I(i); tracks that are lost or leave the frame
/// are dropped. The interpolated frame I(a) is I(i-1), except that each tracked pixel p with flow f
/// is drawn at p + a f, rounded (the last in raster order wins), and the pixel it left shows the
/// uncovered background, I(i). I(1) = I(i). Differences of successive frames are thresholded;
/// events take the time of the later frame.
std::unique_ptr<Simulator> make_sparse_simulator(const LumaFormat& format);

/// Difference frame interpolation (paper, section III-C). The difference frame D(i) = I(i) - I(i-1)
/// keeps the pixels that exceed the thresholds. Lucas-Kanade tracks them from D(i-1) to D(i), each
/// polarity separately; in the interpolated difference frame at a, each kept pixel p with flow f
/// fires at p + a f, rounded (several on one pixel fire once, with the polarity of the largest
/// difference). The last difference frame is D(i) itself.
///
/// A track is dropped if it is lost, leaves the frame, or ends more than a pixel away from all kept
/// pixels of its polarity in D(i): a pixel that has stopped moving does not fire.
///
/// The first interval has only one difference frame, so all its events come from D(1).
std::unique_ptr<Simulator> make_diff_simulator(const LumaFormat& format);

}  // namespace eventcamera
