// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/simulator/class_images.hpp"

#include <algorithm>
#include <limits>
#include <span>
#include <string>

#include "gst/base/event_buffer.hpp"
#include "gst/base/video_frame.hpp"
#include "gst/simulator/video_simulator.hpp"

using eventcamera::Event;
using eventcamera::Label;
using eventcamera::Nanoseconds;

namespace {

/// A part of the events, and their labels.
struct Part {
  std::span<const Event> events;
  std::span<Label> labels;

  /// Splits off the events before microsecond `t`.
  Part before(Nanoseconds t) {
    const auto is_before = [](const Event& event, Nanoseconds time) { return event.t < time; };
    const auto end = std::lower_bound(events.begin(), events.end(), t, is_before);
    const auto count = static_cast<std::size_t>(end - events.begin());
    const Part part{events.first(count), labels.first(count)};
    *this = {events.subspan(count), labels.subspan(count)};
    return part;
  }

  /// Sets the classes from an image that has all of the pixels.
  template <class Pixel>
  void set(const VideoFrame& image) const {
    for (std::size_t i = 0; i < events.size(); ++i) {
      const std::byte* row = image.data() + events[i].y() * image.stride();
      labels[i].object_class = reinterpret_cast<const Pixel*>(row)[events[i].x];
    }
  }
};

std::string size_of(const GstVideoInfo& video) {
  return std::to_string(GST_VIDEO_INFO_WIDTH(&video)) + "x" +
         std::to_string(GST_VIDEO_INFO_HEIGHT(&video));
}

/// Format of an image, which must have the size of the video.
GstVideoInfo format_of(const CompanionPad::Item& image, const GstVideoInfo& video) {
  GstVideoInfo format;
  const bool is_known = gst_video_info_from_caps(&format, image.caps.get()) != FALSE;
  if (!is_known || GST_VIDEO_INFO_WIDTH(&format) != GST_VIDEO_INFO_WIDTH(&video) ||
      GST_VIDEO_INFO_HEIGHT(&format) != GST_VIDEO_INFO_HEIGHT(&video))
    throw VideoSimulatorError({GST_CORE_ERROR_NEGOTIATION,
                               "The class images have " + (is_known ? size_of(format) : "unknown") +
                                   " pixels, and the video " + size_of(video) +
                                   ". Scale them with videoscale method=nearest-neighbour."},
                              "caps of label_sink");
  return format;
}

void set_class(const Part& part, const CompanionPad::Item& image, const GstVideoInfo& video) {
  const GstVideoInfo format = format_of(image, video);
  const VideoFrame mapped(format, image.buffer.get(), GST_MAP_READ);
  if (!mapped)
    throw VideoSimulatorError(
        {GST_RESOURCE_ERROR_FAILED,
         "Cannot read a class image: " + mapped.fault() + ". Check the element upstream."},
        mapped.fault());
  if (GST_VIDEO_INFO_FORMAT(&format) == GST_VIDEO_FORMAT_GRAY8)
    part.set<guint8>(mapped);
  else
    part.set<guint16>(mapped);
}

}  // namespace

GstFlowReturn ClassImages::set_classes(GstBuffer* events, const GstSegment& segment,
                                       const GstVideoInfo& video, Nanoseconds start,
                                       Nanoseconds end) {
  const auto running_start = running_time_of(segment, static_cast<GstClockTime>(start));
  const auto running_end = running_time_of(segment, static_cast<GstClockTime>(end));
  if (!is_linked() || !running_start || !running_end) return GST_FLOW_OK;
  const auto images = items(*running_start, *running_end);
  if (!images) return GST_FLOW_FLUSHING;
  const MappedEvents mapped(events);
  if (!mapped) return GST_FLOW_OK;
  constexpr Nanoseconds microsecond = GST_USECOND;
  const auto microsecond_of = [&](const Item& image) {
    const auto delay =
        static_cast<Nanoseconds>(static_cast<double>(image.time - *running_start) * segment.rate);
    return (start % microsecond + delay) / microsecond;
  };
  Part rest{mapped.events(), labels_of(events)};
  for (std::size_t i = 0; i < images->size(); ++i) {
    const auto& image = (*images)[i];
    if (i == 0) rest.before(microsecond_of(image));  // they have no class
    const auto until = i + 1 < images->size() ? microsecond_of((*images)[i + 1])
                                              : std::numeric_limits<Nanoseconds>::max();
    if (const Part part = rest.before(until); !part.events.empty()) set_class(part, image, video);
  }
  return GST_FLOW_OK;
}
