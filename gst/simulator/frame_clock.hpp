// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstbasetransform.h>
#include <gst/video/video.h>

#include <optional>

#include "gst/base/owned.hpp"

/// Timestamps frames without a PTS: with the running time of their arrival if the source is live,
/// else according to the framerate in the caps.
class FrameClock {
 public:
  /// Origin of the PTS of a frame.
  enum class Source { upstream, framerate, arrival, nowhere };

  /// Sets the PTS of a frame without one, if it can be determined.
  Source stamp(GstBaseTransform* element, const GstVideoInfo& video, OwnedBuffer& frame);

  /// For a new segment.
  void start_over() { next_.reset(); }

 private:
  std::optional<GstClockTime> time_of_arrival(GstBaseTransform* element);

  std::optional<GstClockTime> next_;  ///< end of the last frame
  std::optional<bool> live_;          ///< result of the latency query, once made
};
