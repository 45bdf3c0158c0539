// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/simulator/frame_luma.hpp"

using eventcamera::AlphaView;
using eventcamera::ColourView;
using eventcamera::Image;
using eventcamera::LumaFormat;
using eventcamera::LumaView;
using eventcamera::LumaWeights;
using eventcamera::RgbView;
using eventcamera::RgbWordsView;
using eventcamera::ThreadPool;

LumaWeights luma_weights_of(const GstVideoInfo& video) {
  const auto matrix = [&] {
    switch (video.colorimetry.primaries) {
      case GST_VIDEO_COLOR_PRIMARIES_SMPTE170M:
      case GST_VIDEO_COLOR_PRIMARIES_BT470BG:
        return GST_VIDEO_COLOR_MATRIX_BT601;
      case GST_VIDEO_COLOR_PRIMARIES_BT470M:
        return GST_VIDEO_COLOR_MATRIX_FCC;
      case GST_VIDEO_COLOR_PRIMARIES_SMPTE240M:
        return GST_VIDEO_COLOR_MATRIX_SMPTE240M;
      case GST_VIDEO_COLOR_PRIMARIES_BT2020:
        return GST_VIDEO_COLOR_MATRIX_BT2020;
      default:
        return GST_VIDEO_COLOR_MATRIX_BT709;
    }
  }();
  gdouble kr = 0;
  gdouble kb = 0;
  gst_video_color_matrix_get_Kr_Kb(matrix, &kr, &kb);
  return LumaWeights::of(kr, kb);
}

bool has_narrow_luma(const GstVideoInfo& video) {
  return !GST_VIDEO_INFO_IS_RGB(&video) && video.colorimetry.range == GST_VIDEO_COLOR_RANGE_16_235;
}

namespace {

/// True for RGB16 and similar formats with one word per pixel.
bool has_rgb_words(const GstVideoInfo& video) {
  return GST_VIDEO_INFO_IS_RGB(&video) && GST_VIDEO_INFO_COMP_DEPTH(&video, 0) < 8;
}

}  // namespace

LumaFormat FrameLuma::format_of(const GstVideoInfo& video) {
  // P010 and similar formats use the upper bits of the word, so white is the same as in 16 bits.
  const auto bits = has_rgb_words(video) ? 8
                                         : GST_VIDEO_INFO_COMP_DEPTH(&video, 0) +
                                               GST_VIDEO_FORMAT_INFO_SHIFT(video.finfo, 0);
  return {GST_VIDEO_INFO_WIDTH(&video), GST_VIDEO_INFO_HEIGHT(&video), static_cast<int>(bits)};
}

FrameLuma::Layout FrameLuma::layout_of(const GstVideoInfo& video) {
  if (has_rgb_words(video)) return Layout::rgb_words;
  if (GST_VIDEO_INFO_IS_RGB(&video)) return Layout::rgb;
  const bool has_bytes = GST_VIDEO_INFO_COMP_DEPTH(&video, 0) == 8;
  if (has_bytes && GST_VIDEO_INFO_COMP_PSTRIDE(&video, 0) > 1) return Layout::interleaved;
  if (!has_bytes && !GST_VIDEO_FORMAT_INFO_IS_LE(video.finfo)) return Layout::swapped;
  return Layout::plane;
}

FrameLuma::FrameLuma(const GstVideoInfo& video)
    : video_(video),
      layout_(layout_of(video)),
      has_alpha_(GST_VIDEO_INFO_HAS_ALPHA(&video)),
      format_(format_of(video)),
      is_narrow_(has_narrow_luma(video)),
      weights_(luma_weights_of(video)) {
  if (layout_ == Layout::plane && !has_alpha_) return;
  if (format_.bits == 8)
    bytes_ = Image<guint8>(format_.width, format_.height);
  else
    words_ = Image<guint16>(format_.width, format_.height);
}

RgbView FrameLuma::rgb_of(const VideoFrame& frame) const {
  const int sample = format_.bits == 8 ? 1 : 2;
  const auto colour = [&](guint component) -> ColourView {
    const auto plane = GST_VIDEO_FORMAT_INFO_PLANE(video_.finfo, component);
    return {GST_VIDEO_FRAME_PLANE_DATA(frame.get(), plane),
            GST_VIDEO_FRAME_PLANE_STRIDE(frame.get(), plane),
            static_cast<int>(GST_VIDEO_FORMAT_INFO_POFFSET(video_.finfo, component)) / sample};
  };
  return {GST_VIDEO_INFO_COMP_PSTRIDE(&video_, GST_VIDEO_COMP_R) / sample, colour(GST_VIDEO_COMP_R),
          colour(GST_VIDEO_COMP_G), colour(GST_VIDEO_COMP_B)};
}

RgbWordsView FrameLuma::rgb_words_of(const VideoFrame& frame) const {
  const auto format = GST_VIDEO_INFO_FORMAT(&video_);
  return {frame.data(), frame.stride(),
          static_cast<int>(GST_VIDEO_INFO_COMP_DEPTH(&video_, GST_VIDEO_COMP_G)),
          format == GST_VIDEO_FORMAT_BGR16 || format == GST_VIDEO_FORMAT_BGR15};
}

AlphaView FrameLuma::alpha_of(const VideoFrame& frame) const {
  const int sample = format_.bits == 8 ? 1 : 2;
  return {GST_VIDEO_FRAME_COMP_DATA(frame.get(), GST_VIDEO_COMP_A),
          GST_VIDEO_FRAME_COMP_STRIDE(frame.get(), GST_VIDEO_COMP_A),
          GST_VIDEO_INFO_COMP_PSTRIDE(&video_, GST_VIDEO_COMP_A) / sample};
}

/// Calls fill(image) with the buffer for copied luma. Returns its view.
template <class Fill>
LumaView FrameLuma::filled(const Fill& fill) {
  const auto view = [&](auto& image) {
    fill(image);
    return LumaView{format_, image.row(0), image.stride(), is_narrow_};
  };
  return format_.bits == 8 ? view(bytes_) : view(words_);
}

LumaView FrameLuma::of(const VideoFrame& frame, ThreadPool& threads) {
  const LumaView opaque = opaque_luma_of(frame, threads);
  if (!has_alpha_) return opaque;
  return filled([&](auto& out) { composite_on_black(opaque, alpha_of(frame), threads, out); });
}

LumaView FrameLuma::opaque_luma_of(const VideoFrame& frame, ThreadPool& threads) {
  switch (layout_) {
    case Layout::plane:
      return {format_, frame.first_component(), frame.stride(), is_narrow_};
    case Layout::interleaved:
      eventcamera::gather_luma(reinterpret_cast<const guint8*>(frame.first_component()),
                               frame.stride(), GST_VIDEO_INFO_COMP_PSTRIDE(&video_, 0), bytes_);
      break;
    case Layout::swapped:
      eventcamera::swap_luma(frame.first_component(), frame.stride(), words_);
      break;
    case Layout::rgb_words:
      luma_of_rgb(rgb_words_of(frame), weights_, threads, bytes_);
      break;
    case Layout::rgb:
      return filled([&](auto& out) { luma_of_rgb(rgb_of(frame), weights_, threads, out); });
  }
  return filled([](auto&) {});
}
