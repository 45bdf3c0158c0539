// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/files/aedat_file.hpp"

#include <span>
#include <stdexcept>

#include "gst/base/event_buffer.hpp"
#include "gst/base/video_frame.hpp"
#include "gst/recording/frame_buffer.hpp"
#include "gst/recording/sensor_events.hpp"

using namespace eventcamera;

/// Maximum time that events wait to be written as a packet.
static constexpr Microseconds max_wait = 100'000;

void AedatFile::warn_skipped(const char* what, const std::string& cause) {
  warn_(element_, {GST_STREAM_ERROR_MUX, std::string("Dropped ") + what + "."}, cause);
}

/* streams */

bool AedatFile::handle_sensor(SensorSize size) {
  if (encoder_ && !writable_.accepts(size)) return false;
  size_ = size;
  return true;
}

template <class Item>
bool AedatFile::queue(std::optional<std::vector<Item>>&& items, Waiting<Item>& waiting) {
  if (!items) return false;
  if (!waiting) waiting.emplace();
  waiting->push(*items);
  return true;
}

bool AedatFile::handle_items(GstEvent* event) {
  return queue(triggers_of(event), triggers_) || queue(imu_samples_of(event), imu_samples_);
}

/* bytes */

AedatFile::Bytes AedatFile::begin(Aedat4Settings settings) {
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
  encoder_ = std::make_unique<Aedat4Encoder>(settings);
  Bytes header;
  encoder_->flush(header);
  return header;
}

/// Encodes the items of a stream that wait. Returns the number of those written. May throw.
template <class Item>
std::size_t AedatFile::encode(Waiting<Item>& waiting, const char* name, Bytes& out) {
  const std::span<const Item> items =
      waiting ? waiting->pop_before(after_all_items) : std::span<Item>();
  const auto count = encoder_->encode(items, out);
  if (!items.empty())
    GST_CAT_LOG_OBJECT(category_, element_, "wrote %" G_GSIZE_FORMAT " of %" G_GSIZE_FORMAT " %s",
                       count, items.size(), name);
  return count;
}

AedatFile::Bytes AedatFile::write_items() {
  Bytes out;
  const auto triggers = encode(triggers_, "triggers", out);
  const auto imu_samples = encode(imu_samples_, "IMU samples", out);
  const auto written = writable_.written().lock();
  written->triggers += triggers;
  written->imu_samples += imu_samples;
  return out;
}

/// Encodes the events of a buffer. May throw.
void AedatFile::write_events(GstBuffer* buffer, Bytes& out) {
  const MappedEvents mapped(buffer);
  if (!mapped)
    return warn_skipped("a buffer with a partial event",
                        std::to_string(gst_buffer_get_size(buffer)) + " bytes");
  GST_CAT_LOG_OBJECT(category_, element_, "%" G_GSIZE_FORMAT " events at %" GST_TIME_FORMAT,
                     mapped.events().size(), GST_TIME_ARGS(GST_BUFFER_PTS(buffer)));
  encoder_->encode(writable_.pick(mapped.events(), time_of(GST_BUFFER_PTS(buffer))), out);
}

/// Encodes a frame. May throw.
void AedatFile::write_frame(GstBuffer* buffer, Microseconds t, Bytes& out) {
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

AedatFile::Bytes AedatFile::write(GstBuffer* buffer, Microseconds t, bool has_events) {
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

AedatFile::Bytes AedatFile::flush() {
  Bytes out = write_items();
  encoder_->flush(out);
  return out;
}

AedatFile::Bytes AedatFile::finish() {
  writable_.end_file();
  Bytes bytes = write_items();
  encoder_->finish(bytes);
  return bytes;
}

/* the next file */

void AedatFile::start_over() {
  encoder_.reset();
  triggers_.reset();
  imu_samples_.reset();
  flushed_ = 0;
  warn_.reset();
}

void AedatFile::reset() {
  if (encoder_) writable_.end_file();
  start_over();
  size_ = {};
  video_.reset();
  source_.clear();
}
