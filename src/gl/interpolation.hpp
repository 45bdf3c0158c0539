// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "src/gl/event_list.hpp"
#include "src/gl/grey_frame.hpp"
#include "src/simulate/warp.hpp"

namespace eventcamera::gl {

/// Marks the pixels that fire in the frames interpolated between two, as
/// eventcamera::InterpolationKernel; given the same flow, the events are the same.
class InterpolationKernel {
 public:
  InterpolationKernel(const Context& gl, const LumaFormat& format);

  /// Marks all steps of an interval. `flow` is that of FarnebackFlow.
  void run(const GreyFrame& last, const GreyFrame& now, const Buffer& flow,
           Interpolation interpolation, const Thresholds& thresholds, const EventList& out) const;

 private:
  LumaFormat format_;
  Kernel kernel_;
};

}  // namespace eventcamera::gl
