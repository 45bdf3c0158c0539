// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <span>
#include <string>
#include <vector>

#include "gst/base/event_buffer.hpp"
#include "gst/base/guarded.hpp"

struct Written {
  guint64 events = 0;
  guint64 labels = 0;
  guint64 triggers = 0;
  guint64 frames = 0;
  guint64 imu_samples = 0;
};

/// Filter for elements that write event files. Passes events that a file can hold, sorted by time
/// and within the sensor, and counts the others. Posts a warning about these once valid events
/// follow, and again at the end of the file if there are more by then.
class WritableEvents {
 public:
  /// `code` is the error code of the warnings.
  WritableEvents(GstElement* element, GstDebugCategory* category, GstStreamError code)
      : element_(element), category_(category), code_(code) {}

  /// Starts a new file, whose first event may have any time.
  void begin_file(eventcamera::SensorSize sensor);

  /// True if events of this sensor can be added to the file; reports an error if not.
  bool accepts(eventcamera::SensorSize sensor) const;

  /// Passes the writable events of a buffer to `write_block`, in blocks that fit into the cache.
  /// False, after an error message, if it is not a valid buffer of events. Throws what
  /// `write_block` throws.
  template <class Write>
  bool write(GstBuffer* buffer, const Write& write_block) {
    constexpr std::size_t block = 1 << 14;
    const MappedEvents mapped(buffer);
    if (!mapped || GST_BUFFER_PTS(buffer) > G_MAXINT64) {
      report_buffer(buffer);
      return false;
    }
    GST_CAT_LOG_OBJECT(category_, element_, "%" G_GSIZE_FORMAT " events at %" GST_TIME_FORMAT,
                       mapped.events().size(), GST_TIME_ARGS(GST_BUFFER_PTS(buffer)));
    const auto labels = labels_of(buffer);
    for (std::size_t done = 0; done < mapped.events().size(); done += block) {
      const auto size = std::min(mapped.events().size() - done, block);
      const auto few = mapped.events().subspan(done, size);
      write_block(pick(few, time_of(GST_BUFFER_PTS(buffer)),
                       labels.empty() ? labels : labels.subspan(done, size)));
    }
    return true;
  }

  /// Starts a segment of the input. Its events must not be earlier than those written before:
  /// another recording, such as from concat, is not dropped event by event. With `in_stream_time`,
  /// a file counts from the time that players of the video call 0.
  void begin_segment(const GstSegment& segment, bool in_stream_time);

  /// Time in the file of a timestamp of the segment.
  eventcamera::Microseconds time_of(GstClockTime pts) const;

  /// Returns the writable ones of `events`, whose times are relative to `start`. Valid until the
  /// next call. `labels` has one for each event, or none. Throws std::invalid_argument if times
  /// start over in a new segment.
  std::span<const eventcamera::AbsoluteEvent> pick(std::span<const eventcamera::Event> events,
                                                   eventcamera::Microseconds start,
                                                   std::span<const eventcamera::Label> labels = {});

  /// Drops further events that are earlier than `t`, the time of another written item.
  void advance_to(eventcamera::Microseconds t) { latest_ = std::max(latest_, t); }

  /// Labels of the events that pick() returned, or that `write_block` gets: one for each, or none.
  std::span<const eventcamera::Label> labels() const { return picked_labels_; }

  void end_file();

  /// Counts since begin_file(), of which this class increments only the events. Any thread may read
  /// them.
  Guarded<Written>& written() { return written_; }

  GstStructure* stats();
  static constexpr auto stats_blurb =
      "Counts of what was written to the file: events, their labels, triggers, frames and "
      "imu-samples";

  /// Report for an exception from writing: `otherwise`, unless memory is short or the format cannot
  /// hold the stream.
  static Report failure(const std::exception& error, const Report& otherwise);

 private:
  struct Dropped {
    guint64 count = 0;
    guint64 reported = 0;
  };

  void report_buffer(GstBuffer* buffer) const;
  void warn_of_earlier();
  void warn_of_outside();
  void warn(Dropped& dropped, const std::string& what, const std::string& cause);

  GstElement* element_;
  GstDebugCategory* category_;
  GstStreamError code_;
  eventcamera::SensorSize sensor_;
  eventcamera::Microseconds latest_ = 0;  ///< latest time written
  bool segment_begun_ = false;            ///< since the last event
  GstClockTimeDiff offset_ = 0;           ///< of times in the file, ns
  std::vector<eventcamera::AbsoluteEvent> picked_;
  std::vector<eventcamera::Label> picked_labels_;
  Dropped earlier_;
  Dropped outside_;
  Guarded<Written> written_;
};

/// Adds `header` to caps as streamheader, which late joiners, such as clients of tcpserversink,
/// receive first. Flags the buffer as a header.
OwnedCaps with_stream_header(OwnedCaps caps, GstBuffer* header);
