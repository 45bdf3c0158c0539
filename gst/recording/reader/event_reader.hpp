// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstflowcombiner.h>

#include <algorithm>
#include <exception>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "gst/base/errors.hpp"
#include "gst/base/guarded.hpp"
#include "gst/base/owned.hpp"
#include "gst/base/properties.hpp"
#include "gst/base/seek_request.hpp"
#include "gst/recording/eventreader.hpp"
#include "gst/recording/reader/pad_bytes.hpp"
#include "gst/recording/reader/reader_pad.hpp"
#include "src/formats/recording_reader.hpp"

GST_DEBUG_CATEGORY_EXTERN(event_reader_debug);

/// Returned by step() if no output is available.
inline constexpr GstFlowReturn nothing_ready = GST_FLOW_CUSTOM_SUCCESS;

inline GstClockTime nanoseconds(eventcamera::Microseconds t) {
  return static_cast<GstClockTime>(std::max<eventcamera::Microseconds>(t, 0)) * GST_USECOND;
}

/// Bounds of a segment in whole microseconds, rounded outwards.
inline eventcamera::Microseconds position_of(const GstSegment& segment) {
  return static_cast<eventcamera::Microseconds>(segment.position / GST_USECOND);
}
inline std::optional<eventcamera::Microseconds> stop_of(const GstSegment& segment) {
  if (!GST_CLOCK_TIME_IS_VALID(segment.stop)) return std::nullopt;
  return static_cast<eventcamera::Microseconds>((segment.stop + GST_USECOND - 1) / GST_USECOND);
}

/// User-settable values of every reader, read at the start of a file.
struct ReaderSettings {
  GstClockTime buffer_duration = 10 * GST_MSECOND;
};

/// A seek that upstream was asked for.
struct Restart {
  GstSegment segment = {};
  std::optional<eventcamera::SeekPoint> seek_point;  ///< unset: the start of the file
  guint32 seqnum = GST_SEQNUM_INVALID;
  guint32 superseded = GST_SEQNUM_INVALID;  ///< the seek that was pending before this one
};

/// Implementation of the element: connects an eventcamera::RecordingReader to pads, events, queries
/// and messages.
class EventReader {
 public:
  EventReader(GstElement* element, const EventReaderFormat& format);
  ~EventReader();
  EventReader(const EventReader&) = delete;
  EventReader& operator=(const EventReader&) = delete;

  Guarded<ReaderSettings>& settings() { return settings_; }
  Guarded<FormatSettings>& format_settings() { return format_settings_; }
  GstStructure* stats();

  /// Forgets the file.
  void reset();

  gboolean activate(GstPadMode mode, bool active);
  GstFlowReturn chain(GstBuffer* buffer);
  gboolean sink_event(GstEvent* event);
  gboolean src_event(GstPad* pad, GstEvent* event);
  gboolean src_query(GstPad* pad, GstQuery* query);

 private:
  /// State shared between threads; make no calls while holding the lock.
  struct Shared {
    Shared() { gst_segment_init(&segment, GST_FORMAT_TIME); }

    GstSegment segment = {};  ///< relative to the origin; its position is that of the output
    GstClockTime duration = GST_CLOCK_TIME_NONE;
    bool is_duration_exact = false;
    eventcamera::RecordingReader::Counts counts;
    std::optional<Restart> restart;  ///< push mode: pending seek
    guint64 pushed_bytes = 0;        ///< offset in the file
    guint32 last_seek = GST_SEQNUM_INVALID;
    bool is_pulling = false;
    bool is_timed = false;  ///< times come from upstream
    std::shared_ptr<eventcamera::RecordingReader> recording;
  };

  static void loop(gpointer self);

  template <class Work>
  GstFlowReturn guard(const Work& work);
  Report report_of(const std::exception& error) const;

  void open_recording();
  void close_recording();
  bool carries_words() const;
  bool is_timed() { return shared_.lock()->is_timed; }

  GstFlowReturn pull();
  GstFlowReturn handle_buffer(GstBuffer* buffer);
  GstFlowReturn handle_interval_end(eventcamera::Microseconds end);
  gboolean handle_caps(GstEvent* event);
  gboolean handle_segment(GstEvent* event);
  void handle_gap(GstEvent* event);
  void finish_input();
  GstFlowReturn drain();

  GstFlowReturn step();
  GstFlowReturn push_pending();
  GstFlowReturn push(const eventcamera::RecordingReader::Start& start);
  GstFlowReturn push(const eventcamera::RecordingReader::Chunk& chunk);
  GstFlowReturn push(const eventcamera::RecordingReader::TimedFrame& item);
  GstFlowReturn push(const eventcamera::TriggerItem& item);
  GstFlowReturn push(const eventcamera::ImuItem& item);
  template <class Sample>
  GstFlowReturn push_to_first(std::span<const Sample> samples);
  GstFlowReturn combined(ReaderPad& pad, GstFlowReturn result);

  ReaderPad& pad_of(std::size_t stream);
  GstFlowReturn begin_output();
  void start_streams();
  bool find_size(std::size_t stream);
  bool send_caps(std::size_t stream);
  GstFlowReturn handle_refused_size(std::size_t stream);
  void send_segment(ReaderPad& pad);
  void interrupt_output();
  void post_with_seqnum(GstMessage* message);
  void post_segment_start();
  void end_output(bool failed);
  gboolean forward(GstEvent* event);
  void push_to_pads(GstEvent* event);

  void update_progress();
  void log_dropped(guint64 outside, guint64 late, guint64 stray, GstClockTime position);
  void update_duration();
  GstClockTime duration();
  void post_skipped();
  void warn_if_empty();
  void warn_of_dropped();

  bool can_seek();
  GstClockTime limit_of(const SeekRequest& request);
  bool seek(GstEvent* event);
  bool seek_pulling(const SeekRequest& request);
  bool seek_pushed(Restart restart, gdouble rate);

  GstElement* element_;
  GstPad* sink_;
  const EventReaderFormat& format_;

  Guarded<Shared> shared_;
  Guarded<ReaderSettings> settings_;
  Guarded<FormatSettings> format_settings_;

  // Accessed under the sink pad's stream lock only, or while there is no streaming thread.
  OwnedCaps caps_;                 ///< input caps
  std::optional<PadBytes> bytes_;  ///< pull mode only
  std::shared_ptr<eventcamera::RecordingReader> recording_;
  bool is_consuming_ = false;         ///< bytes were passed to the recording
  GstFlowReturn flow_ = GST_FLOW_OK;  ///< anything else refuses pushed bytes
  guint64 corrupt_places_ = 0;        ///< already signalled by DISCONT and a warning
  WarnOnce warn_of_corruption_{event_reader_debug};
  WarnOnce warn_of_assumption_{event_reader_debug};
  std::string posted_skipped_;  ///< topics in the last message
  RepeatLevel dropped_level_;

  std::vector<std::unique_ptr<ReaderPad>> pads_;
  std::map<std::size_t, ReaderPad*> pad_of_stream_;
  GstFlowCombiner* combiner_ = gst_flow_combiner_new();
  bool has_no_more_pads_ = false;
  bool output_due_ = true;            ///< caps, segments or held events must be sent before data
  GstEvent* stream_start_ = nullptr;  ///< upstream's
  guint group_ = GST_GROUP_ID_INVALID;
  guint32 seqnum_ = GST_SEQNUM_INVALID;
  std::vector<GstEvent*> held_;  ///< serialized events waiting for caps and segments
};

/// The reader of an element.
EventReader& event_reader_of(GstObject* element);

/// Waits while decodebin adds the element, up to a second. connect_pad() in upstream's
/// gstdecodebin2.c and gstparsebin.c locks the state of a new element and filters its errors
/// (add_error_filter) until its state change to PAUSED has returned, but the streaming thread in
/// pull mode runs before that: an error posted then is lost, and decodebin waits for pads forever.
void wait_until_added(GstElement* element);

/// Report for source pads that are not linked.
Report not_linked();

/// Runs `work`; reports any exception. If the cause is a failed pull, returns its flow instead.
template <class Work>
GstFlowReturn EventReader::guard(const Work& work) {
  return catch_exceptions(
      element_, [this](const std::exception& error) { return report_of(error); },
      [&]() -> GstFlowReturn {
        try {
          return work();
        } catch (const std::exception&) {
          wait_until_added(element_);
          if (!bytes_ || !bytes_->failed()) throw;
          return bytes_->flow();
        }
      });
}
