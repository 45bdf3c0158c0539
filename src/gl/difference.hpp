// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "src/gl/event_list.hpp"
#include "src/gl/grey_frame.hpp"
#include "src/simulate/simulator.hpp"

namespace eventcamera::gl {

/// Marks the pixels that fire between two frames, like fire_differences().
class DifferenceKernel {
 public:
  DifferenceKernel(const Context& gl, const LumaFormat& format);

  /// Writes the marks of `step`, 1 or later.
  void run(const GreyFrame& before, const GreyFrame& now, const Thresholds& thresholds, int step,
           const EventList& out) const;

 private:
  LumaFormat format_;
  Kernel kernel_;
};

}  // namespace eventcamera::gl
