// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstbasetransform.h>
#include <gst/video/video.h>

#include <optional>

#include "gst/base/errors.hpp"
#include "gst/base/owned.hpp"

/// Timestamps frames without a PTS, and warns about them: with the running time of their arrival if
/// the source is live, else according to the framerate in the caps.
class FrameClock {
 public:
  explicit FrameClock(GstDebugCategory* category) : warn_of_no_pts_(category) {}

  /// Sets the PTS of a frame without one. False if it cannot be determined.
  bool stamp(GstBaseTransform* element, const GstVideoInfo& video, OwnedBuffer& frame);

  /// For a new segment.
  void start_over() { next_.reset(); }

 private:
  std::optional<GstClockTime> time_of_arrival(GstBaseTransform* element);

  std::optional<GstClockTime> next_;  ///< end of the last frame
  std::optional<bool> live_;          ///< result of the latency query, once made
  WarnOnce warn_of_no_pts_;
};
