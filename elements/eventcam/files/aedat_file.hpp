// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/video/video.h>

#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "gst/base/video_frame.hpp"
#include "gst/recording/frame_buffer.hpp"
#include "gst/recording/sensor_events.hpp"
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
  bool handle_sensor(eventcamera::SensorSize size) {
    if (encoder_ && !writable_.accepts(size)) return false;
    size_ = size;
    return true;
  }

  void set_video(const GstVideoInfo& video) { video_ = video; }
  /// Sets the name of the camera.
  void set_source(const gchar* name) { source_ = name; }
  /// Queues the triggers or IMU samples of an event for the next buffer. False for other events.
  bool handle_items(GstEvent* event) {
    return queue(triggers_of(event), triggers_) || queue(imu_samples_of(event), imu_samples_);
  }

  /// True if too many items wait to wait any longer.
  bool is_full() const {
    const auto is_full = [](const auto& waiting) { return waiting && waiting->is_full(); };
    return is_full(triggers_) || is_full(imu_samples_);
  }

  bool has_sensor() const { return size_ != eventcamera::SensorSize{}; }
  bool has_video() const { return video_.has_value(); }
  bool has_begun() const { return encoder_ != nullptr; }

  /// Returns the header. `settings` has the compression, and whether there are frames and a table.
  Bytes begin(eventcamera::Aedat4Settings settings) {
    settings.size = size_;
    if (!has_sensor() && video_)
      settings.size = {GST_VIDEO_INFO_WIDTH(&*video_), GST_VIDEO_INFO_HEIGHT(&*video_)};
    settings.source = source_;
    settings.triggers = triggers_.has_value();
    settings.imu_samples = imu_samples_.has_value();
    writable_.begin_file(size_);
    GST_CAT_DEBUG_OBJECT(
        category_, element_, "beginning a file of %dx%d pixels%s%s%s, %s a table of packets",
        settings.size.width, settings.size.height, settings.frames ? ", frames" : "",
        settings.triggers ? ", triggers" : "", settings.imu_samples ? ", IMU samples" : "",
        settings.table ? "with" : "without");
    encoder_ = std::make_unique<eventcamera::Aedat4Encoder>(settings);
    Bytes header;
    encoder_->flush(header);
    return header;
  }

  /// Encodes the items that wait.
  Bytes write_items() {
    Bytes out;
    const auto triggers = encode(triggers_, "triggers", out);
    const auto imu_samples = encode(imu_samples_, "IMU samples", out);
    const auto written = writable_.written().lock();
    written->triggers += triggers;
    written->imu_samples += imu_samples;
    return out;
  }

  /// Encodes the items that wait and a buffer of time `t`: events, a frame, or neither if it is
  /// empty.
  Bytes write(GstBuffer* buffer, Microseconds t, bool has_events) {
    Bytes out = write_items();
    const bool is_silent = gst_buffer_get_size(buffer) == 0;
    if (!is_silent && has_events)
      write_events(buffer, out);
    else if (!is_silent)
      write_frame(buffer, t, out);
    if (t - flushed_ >= max_wait) {
      flushed_ = t;
      encoder_->flush(out);
    }
    return out;
  }

  /// Ends incomplete packets.
  Bytes flush() {
    Bytes out = write_items();
    encoder_->flush(out);
    return out;
  }

  /// Returns the end of the file.
  Bytes finish() {
    writable_.end_file();
    Bytes bytes = write_items();
    encoder_->finish(bytes);
    return bytes;
  }

  /// Bytes of the header to overwrite after finish().
  std::optional<eventcamera::FilePatch> patch() { return encoder_->patch(); }

  /// Warns about skipped input.
  void warn_skipped(const char* what, const std::string& cause) {
    warn_(element_, {GST_STREAM_ERROR_MUX, std::string("Dropped ") + what + "."}, cause);
  }

  /// Starts a new file of the same streams.
  void start_over() {
    encoder_.reset();
    triggers_.reset();
    imu_samples_.reset();
    flushed_ = 0;
    warn_.reset();
  }

  /// Forgets the streams, too.
  void reset() {
    if (encoder_) writable_.end_file();
    start_over();
    size_ = {};
    video_.reset();
    source_.clear();
  }

  /// Counts of written items; any thread may ask.
  GstStructure* stats() { return writable_.stats(); }

  /// For a new segment of the events.
  void begin_segment(const GstSegment& segment, bool in_stream_time) {
    writable_.begin_segment(segment, in_stream_time);
  }

  /// Time in the file of a timestamp of the events.
  Microseconds time_of(GstClockTime pts) const { return writable_.time_of(pts); }

 private:
  /// Maximum time that events wait to be written as a packet.
  static constexpr Microseconds max_wait = 100'000;

  /// Items that wait for the next buffer. Set once they are announced, so that the header has a
  /// stream for them.
  template <class Item>
  using Waiting = std::optional<eventcamera::WaitingItems<Item>>;

  template <class Item>
  bool queue(std::optional<std::vector<Item>>&& items, Waiting<Item>& waiting) {
    if (!items) return false;
    if (!waiting) waiting.emplace();
    waiting->push(*items);
    return true;
  }

  /// Encodes the waiting items of a stream, and returns how many were written.
  template <class Item>
  std::size_t encode(Waiting<Item>& waiting, const char* name, Bytes& out) {
    const std::span<const Item> items =
        waiting ? waiting->pop_before(eventcamera::after_all_items) : std::span<Item>();
    const auto count = encoder_->encode(items, out);
    if (!items.empty())
      GST_CAT_LOG_OBJECT(category_, element_, "wrote %" G_GSIZE_FORMAT " of %" G_GSIZE_FORMAT " %s",
                         count, items.size(), name);
    return count;
  }

  /// Encodes the events of a buffer.
  void write_events(GstBuffer* buffer, Bytes& out) {
    const MappedEvents mapped(buffer);
    if (!mapped)
      return warn_skipped("a buffer with a partial event",
                          std::to_string(gst_buffer_get_size(buffer)) + " bytes");
    GST_CAT_LOG_OBJECT(category_, element_, "%" G_GSIZE_FORMAT " events at %" GST_TIME_FORMAT,
                       mapped.events().size(), GST_TIME_ARGS(GST_BUFFER_PTS(buffer)));
    encoder_->encode(writable_.pick(mapped.events(), time_of(GST_BUFFER_PTS(buffer))), out);
  }

  /// Encodes a frame.
  void write_frame(GstBuffer* buffer, Microseconds t, Bytes& out) {
    GST_CAT_LOG_OBJECT(category_, element_, "frame at %" G_GINT64_FORMAT " us", gint64{t});
    const auto reject = [&](const char* cause) {
      warn_skipped("a frame that does not fit into the file",
                   std::string(cause) + ", at " + std::to_string(t) + " us");
    };
    if (!video_) return reject("no caps");
    const VideoFrame video(*video_, buffer, GST_MAP_READ);
    if (!video) return reject(video.fault().c_str());
    const auto frame = recorded_frame(video.get(), t);
    try {
      encoder_->encode(frame, out);
      ++writable_.written().lock()->frames;
    } catch (const std::invalid_argument& error) {
      reject(error.what());
    }
  }

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
