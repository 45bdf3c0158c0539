// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <string>
#include <utility>

#include "gst/base/element.hpp"
#include "gst/base/event_buffer.hpp"
#include "src/tensor/event_tensor.hpp"
#include "src/tensor/window_queue.hpp"

/// Maximum gap between buffers that windows by time continue through; no interval is longer.
inline constexpr GstClockTime max_tensor_gap = GstClockTime{G_MAXUINT32} * GST_USECOND;

/// Times beyond this are not used: the ends of windows would not fit into 64 bits.
inline constexpr GstClockTime max_tensor_time = GstClockTime{1} << 62;

/// User-settable values of eventtensor.
struct TensorProperties {
  eventcamera::Representation representation = eventcamera::Representation::voxel_grid;
  guint bins = 5;
  eventcamera::Decay decay = eventcamera::Decay::exponential;
  GstClockTime time_constant = 50 * GST_MSECOND;
  eventcamera::Normalization normalization = eventcamera::Normalization::none;
  eventcamera::ElementType type = eventcamera::ElementType::float32;
  guint event_count = 0;
  GstClockTime accumulation_time = 0;
  guint frame_count = 1;
  gdouble overlap = 0;

  eventcamera::TensorSettings of_tensors() const {
    return {.representation = representation,
            .bins = static_cast<int>(bins),
            .decay = decay,
            .time_constant = static_cast<eventcamera::Microseconds>(
                std::max(time_constant / 1000, GstClockTime{1})),
            .normalization = normalization,
            .type = type};
  }

  eventcamera::WindowSettings of_windows() const {
    const auto duration = accumulation_time > 0 ? std::max(accumulation_time, event_resolution) : 0;
    return {.events = event_count,
            .duration = static_cast<eventcamera::Nanoseconds>(duration),
            .intervals = frame_count,
            .overlap = overlap};
  }
};

inline GType tensor_data_type() {
  using eventcamera::ElementType;
  return enum_type<ElementType>("GstEventTensorDataType",
                                {{ElementType::float32, "32-bit floating point", "float32"},
                                 {ElementType::float16, "16-bit floating point", "float16"},
                                 {ElementType::uint8, "Unsigned bytes", "uint8"}});
}

/// Format of the tensors of a sensor's events.
struct TensorFormat {
  TensorFormat(const GstEventCameraInfo& input, const TensorProperties& properties)
      : sensor(input), tensors(properties.of_tensors()), windows(properties.of_windows()) {}

  eventcamera::TensorShape shape() const { return {sensor.width, sensor.height, tensors}; }
  OwnedCaps caps() const;
  /// Time from the start of a window to its end, as far as it is known.
  GstClockTime latency() const;

  GstEventCameraInfo sensor;
  eventcamera::TensorSettings tensors;
  eventcamera::WindowSettings windows;

 private:
  std::pair<gint, gint> framerate() const;
};

/// Text: the fields in which `wanted` differs from fixed caps, and the properties to set.
std::string mismatch_text(GstCaps* wanted, GstCaps* made);

/// Describes the bytes of a buffer in a GstTensorMeta, with its dimensions in C order: 1, channels,
/// rows, columns. Without effect before GStreamer 1.26.
void add_tensor_meta(GstBuffer* buffer, const eventcamera::TensorShape& shape,
                     const eventcamera::TensorSettings& settings);
