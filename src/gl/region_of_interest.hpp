// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "src/gl/grey_frame.hpp"

namespace eventcamera::gl {

/// Limits flow to the surroundings of changed pixels, like RegionOfInterestFlow.
class RegionOfInterest {
 public:
  RegionOfInterest(const Context& gl, const LumaFormat& format);

  /// Sets the flow between two frames to 0 outside the region around all pixels that changed by
  /// more than `threshold`.
  void limit(const GreyFrame& before, const GreyFrame& now, int threshold, const Buffer& flow);

 private:
  LumaFormat format_;
  Kernel changed_box_;
  Kernel stop_outside_;
  Buffer box_;
};

}  // namespace eventcamera::gl
