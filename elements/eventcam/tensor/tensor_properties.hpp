// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <algorithm>

#include "gst/base/event_buffer.hpp"
#include "gst/base/properties.hpp"
#include "gst/base/types.hpp"
#include "gst/eventcamera/eventcamera.h"
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

inline GType tensor_representation_type() {
  using eventcamera::Representation;
  static const GEnumValue values[] = {
      {static_cast<gint>(Representation::voxel_grid),
       "Polarities, shared out to the two nearest of several instants", "voxel-grid"},
      {static_cast<gint>(Representation::histogram), "Numbers of OFF and of ON events",
       "histogram"},
      {static_cast<gint>(Representation::time_surface),
       "Decayed age of the last OFF and the last ON event", "time-surface"},
      {static_cast<gint>(Representation::event_frame), "ON minus OFF events", "event-frame"},
      {0, nullptr, nullptr}};
  return enum_type("GstEventTensorRepresentation", values);
}

inline GType tensor_decay_type() {
  using eventcamera::Decay;
  static const GEnumValue values[] = {
      {static_cast<gint>(Decay::exponential), "exp(-age / time-constant)", "exponential"},
      {static_cast<gint>(Decay::linear), "1 - age / time-constant, at least 0", "linear"},
      {0, nullptr, nullptr}};
  return enum_type("GstEventTensorDecay", values);
}

inline GType tensor_normalization_type() {
  using eventcamera::Normalization;
  static const GEnumValue values[] = {
      {static_cast<gint>(Normalization::none), "As counted", "none"},
      {static_cast<gint>(Normalization::mean_std),
       "Nonzero values get the mean 0 and the standard deviation 1, as for E2VID", "mean-std"},
      {static_cast<gint>(Normalization::max), "The largest magnitude becomes 1", "max"},
      {0, nullptr, nullptr}};
  return enum_type("GstEventTensorNormalization", values);
}

inline const GEnumValue* tensor_data_types() {
  using eventcamera::ElementType;
  static const GEnumValue values[] = {
      {static_cast<gint>(ElementType::float32), "32-bit floating point", "float32"},
      {static_cast<gint>(ElementType::float16), "16-bit floating point", "float16"},
      {static_cast<gint>(ElementType::uint8), "Unsigned bytes", "uint8"},
      {0, nullptr, nullptr}};
  return values;
}

/// Adds the properties of eventtensor. Settings are TensorProperties.
template <auto settings_of>
void add_tensor_properties(Properties<settings_of>& properties) {
  const auto number_of = [](auto value) { return static_cast<gint>(value); };
  constexpr guint max_frame_count = 10'000;
  constexpr TensorProperties defaults;
  properties.add(&TensorProperties::representation,
                 g_param_spec_enum("representation", "Representation", "Content of a tensor",
                                   tensor_representation_type(), number_of(defaults.representation),
                                   mutable_ready_flags));
  properties.add(&TensorProperties::bins,
                 g_param_spec_uint("bins", "Bins", "Channels of a voxel grid", 1,
                                   GST_EVENT_CAMERA_MAX_BINS, defaults.bins, mutable_ready_flags));
  properties.add(
      &TensorProperties::decay,
      g_param_spec_enum("decay", "Decay", "How the values of a time surface decrease",
                        tensor_decay_type(), number_of(defaults.decay), mutable_ready_flags));
  properties.add(
      &TensorProperties::time_constant,
      g_param_spec_uint64("time-constant", "Time constant",
                          "Time constant of the decay of a time surface (ns)", GST_USECOND,
                          max_tensor_time, defaults.time_constant, mutable_ready_flags));
  properties.add(
      &TensorProperties::normalization,
      g_param_spec_enum("normalization", "Normalization", "How the values of a tensor are scaled",
                        tensor_normalization_type(), number_of(defaults.normalization),
                        mutable_ready_flags));
  properties.add(&TensorProperties::type,
                 g_param_spec_enum("data-type", "Data type", "Type of the numbers in a tensor",
                                   enum_type("GstEventTensorDataType", tensor_data_types()),
                                   number_of(defaults.type), mutable_ready_flags));
  properties.add(&TensorProperties::event_count,
                 g_param_spec_uint("event-count", "Event count",
                                   "Number of events in a window (0 = not limited by count)", 0,
                                   static_cast<guint>(eventcamera::WindowQueue::max_events),
                                   defaults.event_count, mutable_ready_flags));
  properties.add(&TensorProperties::accumulation_time,
                 g_param_spec_uint64(
                     "accumulation-time", "Accumulation time",
                     "Length of a window without event-count (ns, at least 1000; 0 = frame-count "
                     "buffers)",
                     0, max_tensor_gap, defaults.accumulation_time, mutable_ready_flags));
  properties.add(&TensorProperties::frame_count,
                 g_param_spec_uint("frame-count", "Frame count",
                                   "Number of buffers in a window without event-count and "
                                   "accumulation-time, such as intervals between frames",
                                   1, max_frame_count, defaults.frame_count, mutable_ready_flags));
  properties.add(
      &TensorProperties::overlap,
      g_param_spec_double("overlap", "Overlap", "Share of a window that the next one repeats", 0,
                          0.99, defaults.overlap, mutable_ready_flags));
}
