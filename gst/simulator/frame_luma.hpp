// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/video/video.h>

#include "gst/base/video_frame.hpp"
#include "src/core/luma.hpp"
#include "src/core/thread_pool.hpp"

/// Luma weights of the colours of RGB video. Its colorimetry has no YUV matrix, so the matrix is
/// derived from the primaries.
eventcamera::LumaWeights luma_weights_of(const GstVideoInfo& video);

/// True if the luma of the video has limited range: black is 16, and white 235, of 255.
bool has_narrow_luma(const GstVideoInfo& video);

/// Luma of video of EVENT_SIMULATOR_INPUT_FORMATS: read in place if it is a plane, copied if it is
/// interleaved with chroma or byte-swapped, or computed from RGB. Transparent video is composited
/// on black.
class FrameLuma {
 public:
  /// Allocates the buffer for copied luma, if any.
  explicit FrameLuma(const GstVideoInfo& video);

  static eventcamera::LumaFormat format_of(const GstVideoInfo& video);

  /// Returns the luma of a frame, valid while it is mapped and until the next call.
  eventcamera::LumaView of(const VideoFrame& frame, eventcamera::ThreadPool& threads);

 private:
  enum class Layout { plane, interleaved, swapped, rgb, rgb_words };

  static Layout layout_of(const GstVideoInfo& video);
  template <class Fill>
  eventcamera::LumaView filled(const Fill& fill);
  eventcamera::LumaView opaque_luma_of(const VideoFrame& frame, eventcamera::ThreadPool& threads);
  eventcamera::AlphaView alpha_of(const VideoFrame& frame) const;
  eventcamera::RgbView rgb_of(const VideoFrame& frame) const;
  eventcamera::RgbWordsView rgb_words_of(const VideoFrame& frame) const;

  GstVideoInfo video_;
  Layout layout_;
  bool has_alpha_;
  eventcamera::LumaFormat format_;
  bool is_narrow_;
  eventcamera::LumaWeights weights_;
  eventcamera::Image<guint8> bytes_;
  eventcamera::Image<guint16> words_;
};
