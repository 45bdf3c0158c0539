// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/video/video.h>

#include "gst/base/video_frame.hpp"
#include "src/core/luma.hpp"
#include "src/core/rgb_luma.hpp"
#include "src/core/thread_pool.hpp"

/// The luma of a video of EVENT_SIMULATOR_INPUT_FORMATS: read in place where it is a plane, copied
/// where it is interleaved with chroma or has its bytes swapped, and computed from RGB.
class FrameLuma {
 public:
  /// Allocates what it copies to. May throw.
  explicit FrameLuma(const GstVideoInfo& video);

  static eventcamera::LumaFormat format_of(const GstVideoInfo& video);

  /// Valid while the frame is mapped, and until the next call.
  eventcamera::LumaView of(const VideoFrame& frame, eventcamera::ThreadPool& threads);

 private:
  enum class Layout { plane, interleaved, swapped, rgb, rgb_words };

  static Layout layout_of(const GstVideoInfo& video);
  eventcamera::RgbView rgb_of(const VideoFrame& frame) const;
  eventcamera::RgbWordsView rgb_words_of(const VideoFrame& frame) const;

  GstVideoInfo video_;
  Layout layout_;
  eventcamera::LumaFormat format_;
  eventcamera::LumaWeights weights_;
  eventcamera::Image<guint8> bytes_;
  eventcamera::Image<guint16> words_;
};
