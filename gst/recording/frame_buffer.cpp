// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/recording/frame_buffer.hpp"

#include <algorithm>

using namespace eventcamera;

/// The formats of RECORDED_VIDEO_CAPS.
struct Format {
  PixelFormat pixels;
  GstVideoFormat video;
};
static constexpr Format formats[] = {{PixelFormat::grey8, GST_VIDEO_FORMAT_GRAY8},
                                     {PixelFormat::grey16, GST_VIDEO_FORMAT_GRAY16_LE},
                                     {PixelFormat::bgr, GST_VIDEO_FORMAT_BGR},
                                     {PixelFormat::bgra, GST_VIDEO_FORMAT_BGRA}};

static const char* const frame_meta = "GstEventCameraFrame";

struct TimeField {
  const char* name;
  Microseconds Frame::*time;
};
static constexpr TimeField time_fields[] = {{"begin", &Frame::begin},
                                            {"end", &Frame::end},
                                            {"exposure-begin", &Frame::exposure_begin},
                                            {"exposure-end", &Frame::exposure_end}};

static void register_frame_meta() {
  static const gchar* tags[] = {GST_META_TAG_VIDEO_STR, GST_META_TAG_VIDEO_SIZE_STR, nullptr};
  [[maybe_unused]] static const GstMetaInfo* const info =
      gst_meta_register_custom(frame_meta, tags, nullptr, nullptr, nullptr);
}

static void add_frame_meta(GstBuffer* buffer, const Frame& frame) {
  register_frame_meta();
  GstStructure* const fields =
      gst_custom_meta_get_structure(gst_buffer_add_custom_meta(buffer, frame_meta));
  for (const auto& [name, time] : time_fields)
    gst_structure_set(fields, name, G_TYPE_INT64, gint64{frame.*time - frame.t}, nullptr);
  gst_structure_set(fields, "x", G_TYPE_INT, frame.x, "y", G_TYPE_INT, frame.y, nullptr);
}

/// Fields that are missing or make no sense change nothing.
static void read_frame_meta(GstBuffer* buffer, Frame& frame) {
  register_frame_meta();
  constexpr gint64 max_distance = 3'600'000'000;
  GstCustomMeta* const meta = gst_buffer_get_custom_meta(buffer, frame_meta);
  if (meta == nullptr) return;
  const GstStructure* const fields = gst_custom_meta_get_structure(meta);
  for (const auto& [name, time] : time_fields) {
    gint64 after = 0;
    if (gst_structure_get_int64(fields, name, &after) && after >= -max_distance &&
        after <= max_distance)
      frame.*time = frame.t + after;
  }
  int x = 0;
  int y = 0;
  if (gst_structure_get_int(fields, "x", &x) && gst_structure_get_int(fields, "y", &y) && x >= 0 &&
      x < max_side && y >= 0 && y < max_side) {
    frame.x = x;
    frame.y = y;
  }
}

bool frame_video_info(const Frame& frame, GstVideoInfo* info) {
  return frame.width <= max_side && frame.height <= max_side &&
         gst_video_info_set_format(
             info, std::ranges::find(formats, frame.format, &Format::pixels)->video,
             static_cast<guint>(frame.width), static_cast<guint>(frame.height));
}

GstBuffer* frame_buffer(const Frame& frame, const GstVideoInfo* info) {
  const gsize size = GST_VIDEO_INFO_SIZE(info);
  // GStreamer's own allocator would abort the process if memory is short.
  auto* const memory = static_cast<guint8*>(g_try_malloc0(size));
  if (memory == nullptr) throw std::bad_alloc();
  const auto row = frame.width * bytes_per_pixel(frame.format);
  for (int y = 0; y < frame.height; ++y)
    std::copy_n(frame.pixels + y * frame.stride, row,
                memory + std::ptrdiff_t{y} * GST_VIDEO_INFO_PLANE_STRIDE(info, 0));
  GstBuffer* const buffer = gst_buffer_new_wrapped(memory, size);
  add_frame_meta(buffer, frame);
  return buffer;
}

Frame recorded_frame(const GstVideoFrame* video, Microseconds t) {
  Frame frame;
  frame.t = frame.begin = frame.end = frame.exposure_begin = frame.exposure_end = t;
  read_frame_meta(video->buffer, frame);
  frame.format = std::ranges::find(formats, GST_VIDEO_FRAME_FORMAT(video), &Format::video)->pixels;
  frame.width = GST_VIDEO_FRAME_WIDTH(video);
  frame.height = GST_VIDEO_FRAME_HEIGHT(video);
  frame.pixels = static_cast<const guint8*>(GST_VIDEO_FRAME_PLANE_DATA(video, 0));
  frame.stride = GST_VIDEO_FRAME_PLANE_STRIDE(video, 0);
  return frame;
}
