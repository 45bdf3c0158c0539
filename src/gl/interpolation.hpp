// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "src/gl/event_list.hpp"
#include "src/gl/grey_frame.hpp"
#include "src/simulate/warp.hpp"

namespace eventcamera::gl {

/// Marks the pixels that fire in the frames interpolated between two frames, like
/// eventcamera::InterpolationKernel; the same flow gives the same events.
class InterpolationKernel {
 public:
  InterpolationKernel(const Context& gl, const LumaFormat& format);

  /// Writes the marks of all steps of an interval. `flow` is laid out as by FarnebackFlow.
  void run(const GreyFrame& last, const GreyFrame& now, const Buffer& flow,
           Interpolation interpolation, const Thresholds& thresholds, const EventList& out) const;

 private:
  LumaFormat format_;
  Kernel kernel_;
};

}  // namespace eventcamera::gl
