// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/video/video.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "gst/base/errors.hpp"
#include "gst/recording/writable_events.hpp"
#include "src/formats/aedat/aedat4_encoder.hpp"
#include "src/formats/waiting_items.hpp"

/// An AEDAT 4 file that is being written: knows its streams, and makes its bytes.
class AedatFile {
 public:
  using Bytes = std::vector<guint8>;
  using Microseconds = eventcamera::Microseconds;

  AedatFile(GstElement* element, GstDebugCategory* category)
      : element_(element),
        category_(category),
        writable_(element, category, GST_STREAM_ERROR_MUX),
        warn_(category) {}

  /// Sets the sensor of the events. False, after an error message, if the file has another sensor.
  bool handle_sensor(eventcamera::SensorSize size);
  void set_video(const GstVideoInfo& video) { video_ = video; }
  /// Sets the name of the camera.
  void set_source(const gchar* name) { source_ = name; }
  /// Queues the triggers or IMU samples of an event for the next buffer. False for other events.
  bool handle_items(GstEvent* event);
  /// True if too many items wait to wait any longer.
  bool is_full() const {
    const auto is_full = [](const auto& waiting) { return waiting && waiting->is_full(); };
    return is_full(triggers_) || is_full(imu_samples_);
  }

  bool has_sensor() const { return size_ != eventcamera::SensorSize{}; }
  bool has_video() const { return video_.has_value(); }
  bool has_begun() const { return encoder_ != nullptr; }

  /// Returns the header. `settings` has the compression, and whether there are frames and a table.
  /// May throw.
  Bytes begin(eventcamera::Aedat4Settings settings);
  /// Encodes the items that wait. May throw.
  Bytes write_items();
  /// Encodes the items that wait and a buffer of time `t`: events, a frame, or neither if it is
  /// empty. May throw.
  Bytes write(GstBuffer* buffer, Microseconds t, bool has_events);
  /// Ends incomplete packets. May throw.
  Bytes flush();
  /// Returns the end of the file. May throw.
  Bytes finish();
  /// Bytes of the header to overwrite after finish().
  std::optional<eventcamera::FilePatch> patch() { return encoder_->patch(); }

  /// Warns about skipped input.
  void warn_skipped(const char* what, const std::string& cause);

  /// Starts a new file of the same streams.
  void start_over();
  /// Forgets the streams, too.
  void reset();

  /// Counts of written items; any thread may ask.
  GstStructure* stats() { return writable_.stats(); }

  /// For a new segment of the events.
  void begin_segment(const GstSegment& segment, bool in_stream_time) {
    writable_.begin_segment(segment, in_stream_time);
  }

  /// Time in the file of a timestamp of the events.
  Microseconds time_of(GstClockTime pts) const { return writable_.time_of(pts); }

 private:
  /// Items that wait for the next buffer. Set once they are announced, so that the header has a
  /// stream for them.
  template <class Item>
  using Waiting = std::optional<eventcamera::WaitingItems<Item>>;

  template <class Item>
  bool queue(std::optional<std::vector<Item>>&& items, Waiting<Item>& waiting);
  template <class Item>
  std::size_t encode(Waiting<Item>& waiting, const char* name, Bytes& out);
  void write_events(GstBuffer* buffer, Bytes& out);
  void write_frame(GstBuffer* buffer, Microseconds t, Bytes& out);

  GstElement* element_;
  GstDebugCategory* category_;
  WritableEvents writable_;
  WarnOnce warn_;

  eventcamera::SensorSize size_;  ///< of the event stream
  std::optional<GstVideoInfo> video_;
  std::string source_;
  Waiting<eventcamera::Trigger> triggers_;
  Waiting<eventcamera::ImuSample> imu_samples_;

  std::unique_ptr<eventcamera::Aedat4Encoder> encoder_;  ///< null until the header is written
  Microseconds flushed_ = 0;                             ///< time of the last flushed packet
};
