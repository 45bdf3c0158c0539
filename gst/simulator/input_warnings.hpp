// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstbasetransform.h>
#include <gst/video/video.h>

#include <string>

#include "gst/base/errors.hpp"

/// Warnings about video that makes wrong events, each posted once.
class InputWarnings {
 public:
  explicit InputWarnings(GstDebugCategory* category) : warn_of_interlacing_(category) {}

  /// Warns about interlaced video, whose two fields are captured at different times.
  void check_interlacing(GstBaseTransform* element, const GstVideoInfo& video, GstBuffer* frame) {
    const auto mode = GST_VIDEO_INFO_INTERLACE_MODE(&video);
    if (mode == GST_VIDEO_INTERLACE_MODE_PROGRESSIVE ||
        (mode == GST_VIDEO_INTERLACE_MODE_MIXED &&
         !GST_BUFFER_FLAG_IS_SET(frame, GST_VIDEO_BUFFER_FLAG_INTERLACED)))
      return;
    warn_of_interlacing_(
        element,
        {GST_STREAM_ERROR_FORMAT,
         "The video is interlaced: moving edges will fire in every other row. Insert a deinterlace "
         "element upstream."},
        std::string("interlace-mode=") + gst_video_interlace_mode_to_string(mode));
  }

 private:
  WarnOnce warn_of_interlacing_;
};
