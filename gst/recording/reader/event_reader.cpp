// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/recording/reader/event_reader.hpp"

#include <new>
#include <string>
#include <utility>

#include "gst/base/event_caps.hpp"
#include "gst/base/pads.hpp"

#define GST_CAT_DEFAULT event_reader_debug

using eventcamera::Microseconds;
using eventcamera::RecordingReader;
using eventcamera::UnsupportedFormat;

/// Chooses pull mode if upstream supports random access, else push mode.
static gboolean choose_mode(GstPad* sink, GstObject* /*parent*/) {
  GstQuery* const query = gst_query_new_scheduling();
  const bool pulls = gst_pad_peer_query(sink, query) != FALSE &&
                     gst_query_has_scheduling_mode_with_flags(
                         query, GST_PAD_MODE_PULL, GST_SCHEDULING_FLAG_SEEKABLE) != FALSE;
  gst_query_unref(query);
  return gst_pad_activate_mode(sink, pulls ? GST_PAD_MODE_PULL : GST_PAD_MODE_PUSH, TRUE);
}

EventReader::EventReader(GstElement* element, const EventReaderFormat& format)
    : element_(element), sink_(add_pad(element, "sink")), format_(format) {
  gst_pad_set_activate_function(sink_, choose_mode);
  gst_pad_set_activatemode_function(
      sink_, +[](GstPad*, GstObject* parent, GstPadMode mode, gboolean active) {
        return event_reader_of(parent).activate(mode, active != FALSE);
      });
  gst_pad_set_chain_function(
      sink_, +[](GstPad*, GstObject* parent, GstBuffer* buffer) {
        return event_reader_of(parent).chain(buffer);
      });
  gst_pad_set_event_function(
      sink_, +[](GstPad*, GstObject* parent, GstEvent* event) {
        return event_reader_of(parent).sink_event(event);
      });
}

EventReader::~EventReader() {
  for (GstEvent* event : held_) gst_event_unref(event);
  gst_clear_event(&stream_start_);
  gst_flow_combiner_free(combiner_);
}

void EventReader::reset() {
  for (GstEvent* event : std::exchange(held_, {})) gst_event_unref(event);
  gst_clear_event(&stream_start_);
  close_recording();
  bytes_.reset();
  caps_.reset();
  flow_ = GST_FLOW_OK;
  warn_of_corruption_.reset();
  warn_of_assumption_.reset();
  posted_skipped_.clear();
  dropped_level_.reset();
  for (auto& pad : pads_) {
    pad->reset();
    if (!format_.has_many_streams) continue;
    gst_flow_combiner_remove_pad(combiner_, pad->get());
    if (pad->is_added()) gst_element_remove_pad(element_, pad->get());
  }
  if (format_.has_many_streams) {
    pads_.clear();
    has_no_more_pads_ = false;
  }
  gst_flow_combiner_reset(combiner_);
  group_ = GST_GROUP_ID_INVALID;
  seqnum_ = GST_SEQNUM_INVALID;
  const auto shared = shared_.lock();
  const bool is_pulling = shared->is_pulling;
  *shared = {};
  shared->is_pulling = is_pulling;
}

static void unref_caps(GstCaps* caps) {
  if (caps != nullptr) gst_caps_unref(caps);
}

/// Creates the recording, to read a file from its start or a stream of words. May throw.
void EventReader::open_recording() {
  const std::shared_ptr<GstCaps> caps(caps_ ? gst_caps_copy(caps_.get()) : nullptr, unref_caps);
  auto make = [make_decoder = format_.make_decoder, caps, settings = format_settings_.copy()] {
    return make_decoder(caps.get(), settings);
  };
  close_recording();
  const auto length = static_cast<Microseconds>(settings_.copy().buffer_duration / GST_USECOND);
  recording_ = std::make_shared<RecordingReader>(
      make, length, is_timed() ? RecordingReader::Clock::stream : RecordingReader::Clock::file);
  if (bytes_) recording_->open(*bytes_);
  shared_.lock()->recording = recording_;
  GST_DEBUG_OBJECT(element_, "opened in %s mode, with %s of %" GST_PTR_FORMAT,
                   bytes_ ? "pull" : "push", is_timed() ? "the times of upstream" : "its own times",
                   caps_.get());
}

void EventReader::close_recording() {
  recording_.reset();
  pad_of_stream_.clear();
  is_consuming_ = false;
  corrupt_places_ = 0;
  output_due_ = true;
  shared_.lock()->recording.reset();
}

Report EventReader::report_of(const std::exception& error) const {
  if (is_a<UnsupportedFormat>(error))
    return {GST_STREAM_ERROR_WRONG_TYPE,
            std::string("Cannot read this file: ") + error.what() + "."};
  if (is_a<std::bad_alloc>(error))
    return {GST_RESOURCE_ERROR_NO_SPACE_LEFT,
            "There is not enough memory for the events. Lower buffer-duration."};
  return {format_.has_many_streams ? GST_STREAM_ERROR_DEMUX : GST_STREAM_ERROR_DECODE,
          "Cannot read this file. Check that it is complete and that its extension matches its "
          "format."};
}

void wait_until_added(GstElement* element) {
  constexpr int max_milliseconds = 1000;
  for (int i = 0; i < max_milliseconds && gst_element_is_locked_state(element); ++i) g_usleep(1000);
}

/// decodebin plugs eventrender unless its caps ask for events: the message says how.
Report not_linked() {
  return {GST_STREAM_ERROR_FAILED,
          "Nothing is linked downstream. decodebin draws events as video; for the events "
          "themselves, set decodebin " ASK_FOR_EVENTS "."};
}
