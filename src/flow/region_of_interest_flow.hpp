// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/core/image.hpp"
#include "src/flow/dense_flow.hpp"

namespace eventcamera {

/// Dense flow between successive frames, computed only around changed pixels and 0 elsewhere. Saves
/// most of the work if the camera does not move.
class RegionOfInterestFlow {
 public:
  /// Distance up to which a change affects the flow, in pixels: about half a window on a coarse
  /// scale.
  static constexpr int surroundings = 48;

  /// Region sides are rounded up to multiples of this, so that regions of similar size share the
  /// memory of a DenseFlow.
  static constexpr int side_step = 64;

  RegionOfInterestFlow(FlowMethod method, int width, int height);

  FlowMethod method() const { return method_; }

  /// Returns the flow between two frames; `from` must be the `to` of the previous call, and
  /// `changed` must hold all pixels that differ. Valid until the next call; the same for any number
  /// of threads.
  ImageView<Flow> find(const ImageView<std::uint8_t>& from, const ImageView<std::uint8_t>& to,
                       const Box& changed, ThreadPool& threads);

 private:
  void clear();

  FlowMethod method_;
  int width_;
  int height_;
  std::unique_ptr<DenseFlow> whole_;
  bool whole_has_last_ = false;
  std::unique_ptr<DenseFlow> part_;
  Image<Flow> flow_;  ///< 0 outside filled_
  Box filled_;
};

}  // namespace eventcamera
