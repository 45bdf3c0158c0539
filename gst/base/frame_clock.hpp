// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstbasetransform.h>
#include <gst/video/video.h>

#include <optional>

#include "gst/base/owned.hpp"

/// Gives a PTS to frames that come without one: the running time at which they arrive where the
/// source is live, otherwise times of the caps' framerate.
class FrameClock {
 public:
  /// Where the PTS of a frame is from.
  enum class Source { upstream, framerate, arrival, nowhere };

  /// Sets the PTS of a frame that has none, unless nothing tells it.
  Source stamp(GstBaseTransform* element, const GstVideoInfo& video, OwnedBuffer& frame);

  /// Another segment begins.
  void start_over() { next_.reset(); }

 private:
  std::optional<GstClockTime> time_of_arrival(GstBaseTransform* element);

  std::optional<GstClockTime> next_;  ///< end of the last frame
  std::optional<bool> live_;          ///< whether upstream is, once asked
};
