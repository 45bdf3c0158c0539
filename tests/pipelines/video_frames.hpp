// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/app/gstappsink.h>
#include <gst/gst.h>

#include <memory>
#include <stdexcept>
#include <string>

#include "src/core/image.hpp"

/// Recorded video, read with GStreamer.
namespace video_frames {

/// Runs a pipeline and visits the first `count` samples of its appsink, named sink. Throws the
/// error of the pipeline, if any.
template <class Visit>
void for_each_sample(const std::string& launch, int count, const Visit& visit) {
  gst_init(nullptr, nullptr);
  const auto complain = [&launch](GError* error) {
    const std::string text = launch + ": " + error->message;
    g_error_free(error);
    throw std::runtime_error(text);
  };
  const auto unref = [](auto* object) { gst_object_unref(object); };
  const auto stop = [](GstElement* element) {
    gst_element_set_state(element, GST_STATE_NULL);
    gst_object_unref(element);
  };

  GError* error = nullptr;
  const std::unique_ptr<GstElement, decltype(stop)> pipeline(
      gst_parse_launch(launch.c_str(), &error), stop);
  if (error != nullptr) complain(error);
  const std::unique_ptr<GstElement, decltype(unref)> sink(
      gst_bin_get_by_name(GST_BIN(pipeline.get()), "sink"), unref);
  const std::unique_ptr<GstBus, decltype(unref)> bus(gst_element_get_bus(pipeline.get()), unref);
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  for (int i = 0; i < count; ++i) {
    GstSample* sample = gst_app_sink_pull_sample(GST_APP_SINK(sink.get()));
    if (sample == nullptr) break;
    visit(sample);
    gst_sample_unref(sample);
  }
  GstMessage* message = gst_bus_pop_filtered(
      bus.get(), static_cast<GstMessageType>(GST_MESSAGE_ERROR | GST_MESSAGE_WARNING));
  if (message == nullptr) return;
  if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_ERROR)
    gst_message_parse_error(message, &error, nullptr);
  else
    gst_message_parse_warning(message, &error, nullptr);
  gst_message_unref(message);
  complain(error);
}

/// Visits the first `count` frames of a file, in grey, scaled to a width (a multiple of 4) and
/// height.
template <class Visit>
void for_each_frame(const std::string& path, int count, int width, int height, const Visit& visit) {
  for_each_sample(
      "filesrc location=\"" + path + "\" ! decodebin ! videoconvert ! videoscale ! " +
          "video/x-raw,format=GRAY8,pixel-aspect-ratio=1/1,width=" + std::to_string(width) +
          ",height=" + std::to_string(height) + " ! appsink name=sink sync=false max-buffers=4",
      count, [&](GstSample* sample) {
        GstMapInfo map;
        gst_buffer_map(gst_sample_get_buffer(sample), &map, GST_MAP_READ);
        visit(eventcamera::ImageView<std::uint8_t>{map.data, width, width, height});
        gst_buffer_unmap(gst_sample_get_buffer(sample), &map);
      });
}

}  // namespace video_frames
