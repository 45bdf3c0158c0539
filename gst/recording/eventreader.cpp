// SPDX-License-Identifier: LGPL-2.1-or-later

#include "gst/base/buffer_bytes.hpp"
#include "gst/base/element_type.hpp"
#include "gst/recording/file_extensions.hpp"
#include "gst/recording/frame_buffer.hpp"
#include "gst/recording/reader/reader_output.hpp"
#include "gst/recording/reader/reader_reports.hpp"
#include "src/formats/byte_source.hpp"
#include "src/formats/compressed_file.hpp"
#include "src/formats/corruption.hpp"
#include "src/formats/recording_reader.hpp"

using namespace eventcamera;

GST_DEBUG_CATEGORY(event_reader_debug);
#define GST_CAT_DEFAULT event_reader_debug

namespace {

/// Returned by step() if no output is available.
constexpr GstFlowReturn nothing_ready = GST_FLOW_CUSTOM_SUCCESS;

/// Chooses pull mode if upstream supports random access, else push mode.
gboolean choose_mode(GstPad* sink, GstObject* /*parent*/) {
  GstQuery* const query = gst_query_new_scheduling();
  const bool pulls = gst_pad_peer_query(sink, query) != FALSE &&
                     gst_query_has_scheduling_mode_with_flags(
                         query, GST_PAD_MODE_PULL, GST_SCHEDULING_FLAG_SEEKABLE) != FALSE;
  gst_query_unref(query);
  return gst_pad_activate_mode(sink, pulls ? GST_PAD_MODE_PULL : GST_PAD_MODE_PUSH, TRUE);
}

/// Waits while decodebin adds the element, up to a second. connect_pad() in upstream's
/// gstdecodebin2.c and gstparsebin.c locks the state of a new element and filters its errors
/// (add_error_filter) until its state change to PAUSED has returned, but the streaming thread in
/// pull mode runs before that: an error posted then is lost, and decodebin waits for pads forever.
void wait_until_added(GstElement* element) {
  constexpr int max_milliseconds = 1000;
  for (int i = 0; i < max_milliseconds && gst_element_is_locked_state(element); ++i) g_usleep(1000);
}

/// Report for source pads that are not linked. decodebin plugs eventrender unless its caps ask for
/// events: the message says how.
Report not_linked() {
  return {
      GST_STREAM_ERROR_FAILED,
      "Nothing is linked downstream. Insert eventrender before elements that take video. decodebin "
      "draws events as video; for the events themselves, set decodebin " ASK_FOR_EVENTS "."};
}

Report report_of(const std::exception& error, const EventReaderFormat& format) {
  if (is_a<UnsupportedFormat>(error))
    return {GST_STREAM_ERROR_WRONG_TYPE,
            std::string("Cannot read this file: ") + error.what() + "."};
  if (is_a<TemporaryFileError>(error))
    return {GST_RESOURCE_ERROR_NO_SPACE_LEFT,
            std::string("Cannot decompress this file to a ") + error.what() +
                ". Set the environment variable TMPDIR to a folder with enough space."};
  if (is_a<std::bad_alloc>(error))
    return {GST_RESOURCE_ERROR_NO_SPACE_LEFT,
            "There is not enough memory for the events. Lower buffer-duration."};
  return {format.has_many_streams ? GST_STREAM_ERROR_DEMUX : GST_STREAM_ERROR_DECODE,
          "Cannot read this file. Check that it is complete and that its extension matches its "
          "format."};
}

/// True for words without a header; files have their own times, whatever their segment.
bool are_words(const OwnedCaps& caps) {
  return caps &&
         gst_structure_has_name(gst_caps_get_structure(caps.get(), 0), GST_EVENT_CAMERA_MEDIA_TYPE);
}

void unref_caps(GstCaps* caps) {
  if (caps != nullptr) gst_caps_unref(caps);
}

/// Limits on a single pull, because upstream allocates a buffer of that size.
constexpr std::size_t piece_size = std::size_t{1} << 18;
constexpr std::size_t max_read = std::size_t{1} << 20;

/// Bytes of a file pulled from upstream.
class PadBytes final : public ByteSource {
 public:
  /// `sink` must outlive this object.
  explicit PadBytes(GstPad* sink) : sink_(sink), size_(upstream_bytes(sink)) {}

  std::uint64_t size() const override { return size_; }

  std::optional<std::size_t> read(std::uint64_t position,
                                  std::span<std::uint8_t> out) noexcept override {
    std::size_t filled = 0;
    while (filled < out.size()) {
      const auto wanted = std::min(out.size() - filled, max_read);
      const OwnedBuffer buffer(pull(position + filled, wanted));
      if (failed()) return std::nullopt;
      const gsize got =
          buffer ? gst_buffer_extract(buffer.get(), 0, out.data() + filled, wanted) : 0;
      if (got == 0) break;
      filled += got;
    }
    return filled;
  }

  std::optional<std::span<const std::uint8_t>> piece(std::uint64_t position) override {
    piece_.reset();
    OwnedBuffer buffer(pull(position, piece_size));
    if (failed()) return std::nullopt;
    if (!buffer) return std::span<const std::uint8_t>{};
    piece_.emplace(GST_PAD_PARENT(sink_), std::move(buffer));
    if (piece_->is_mapped()) return piece_->get();
    flow_ = GST_FLOW_ERROR;
    return std::nullopt;
  }

  bool failed() const noexcept override { return flow_ != GST_FLOW_OK; }

  /// Reason for a failed read; GST_FLOW_EOS if upstream was stopped before the end of the file.
  GstFlowReturn flow() const { return flow_; }

  void retry() { flow_ = GST_FLOW_OK; }

 private:
  /// Returns null at the end of the file and if reading fails, or ends because upstream got EOS.
  GstBuffer* pull(std::uint64_t position, std::size_t size) noexcept {
    GstBuffer* buffer = nullptr;
    const GstFlowReturn result =
        gst_pad_pull_range(sink_, position, static_cast<guint>(size), &buffer);
    if (result != GST_FLOW_EOS || position < upstream_bytes(sink_)) flow_ = result;
    return result == GST_FLOW_OK ? buffer : nullptr;
  }

  GstPad* sink_;
  std::uint64_t size_;
  GstFlowReturn flow_ = GST_FLOW_OK;
  std::optional<MappedBytes> piece_;
};

}  // namespace

/// User-settable values of every reader, read at the start of a file.
struct ReaderSettings {
  GstClockTime buffer_duration = 10 * GST_MSECOND;
};

class EventReader;
static EventReader& reader_of(gpointer element);

/// Implementation of the element: gets the bytes of a recording from its sink pad, and passes what
/// they contain to its output. Except where noted, functions run under the sink pad's stream lock,
/// or while there is no streaming thread.
class EventReader {
 public:
  EventReader(GstElement* element, const EventReaderFormat& format)
      : element_(element),
        sink_(add_pad(element, "sink")),
        format_(format),
        timeline_(sink_),
        reports_(element, format.has_many_streams),
        output_(
            element, sink_, format, format_settings, timeline_,
            +[](GstPad* pad, GstObject* parent, GstEvent* event) {
              return reader_of(parent).src_event(pad, event);
            },
            +[](GstPad* pad, GstObject* parent, GstQuery* query) {
              return reader_of(parent).src_query(pad, query);
            }) {
    gst_pad_set_activate_function(sink_, choose_mode);
    gst_pad_set_activatemode_function(
        sink_, +[](GstPad*, GstObject* parent, GstPadMode mode, gboolean active) {
          return reader_of(parent).activate(mode, active != FALSE);
        });
    gst_pad_set_chain_function(
        sink_, +[](GstPad*, GstObject* parent, GstBuffer* buffer) {
          return reader_of(parent).chain(buffer);
        });
    gst_pad_set_event_function(
        sink_, +[](GstPad*, GstObject* parent, GstEvent* event) {
          return reader_of(parent).sink_event(event);
        });
  }

  EventReader(const EventReader&) = delete;
  EventReader& operator=(const EventReader&) = delete;

  // From any thread.
  Guarded<ReaderSettings> settings;
  Guarded<FormatSettings> format_settings;
  GstStructure* stats() const { return reports_.stats(); }

  gboolean src_event(GstPad* pad, GstEvent* event) {
    if (GST_EVENT_TYPE(event) != GST_EVENT_SEEK || timeline_.is_timed())
      return gst_pad_event_default(pad, GST_OBJECT(element_), event);
    const bool done = seek(SeekRequest(event));
    gst_event_unref(event);
    return done;
  }

  gboolean src_query(GstPad* pad, GstQuery* query) {
    if (GST_QUERY_TYPE(query) == GST_QUERY_LATENCY)
      return answer_latency(sink_, query, settings.copy().buffer_duration) ||
             gst_pad_query_default(pad, GST_OBJECT(element_), query);
    if (timeline_.is_timed()) return gst_pad_query_default(pad, GST_OBJECT(element_), query);
    return timeline_.answer(pad, query);
  }

  /// Forgets the file.
  void reset() {
    close_recording();
    output_.reset();
    reports_.reset();
    timeline_.reset();
    decompressed_.reset();
    decompressor_.reset();
    bytes_.reset();
    caps_.reset();
    flow_ = GST_FLOW_OK;
  }

  gboolean activate(GstPadMode mode, bool active) {
    timeline_.set_pulling(mode == GST_PAD_MODE_PULL && active);
    if (mode != GST_PAD_MODE_PULL) return TRUE;
    return active ? gst_pad_start_task(sink_, loop, this, nullptr) : gst_pad_stop_task(sink_);
  }

  GstFlowReturn chain(GstBuffer* buffer) {
    const OwnedBuffer owner(buffer);
    if (timeline_.is_timed() && GST_BUFFER_IS_DISCONT(buffer)) {
      const GstFlowReturn drained = drain();
      if (recording_) recording_->interrupt();
      output_.interrupt_data();
      if (drained != GST_FLOW_OK) return drained;
    }
    if (flow_ != GST_FLOW_OK) return flow_;
    flow_ = guard([&] { return handle_buffer(buffer); });
    if (flow_ == GST_FLOW_NOT_LINKED)  // upstream may have others to feed
      post_message(element_, GST_MESSAGE_WARNING, not_linked(), "all source pads are not linked");
    return flow_;
  }

  gboolean sink_event(GstEvent* event) {
    switch (GST_EVENT_TYPE(event)) {
      case GST_EVENT_STREAM_START:
        drain();  // into the stream that ends here, before the new one
        if (recording_ && timeline_.is_timed()) recording_->interrupt();
        output_.start_stream(event);
        return TRUE;
      case GST_EVENT_CAPS:
        return handle_caps(event);
      case GST_EVENT_SEGMENT:
        return handle_segment(event);
      case GST_EVENT_GAP:
        handle_gap(event);
        return TRUE;
      case GST_EVENT_EOS:
        output_.set_seqnum(gst_event_get_seqnum(event));
        gst_event_unref(event);
        finish_input();
        is_consuming_ = false;
        output_.end(flow_ != GST_FLOW_OK && flow_ != GST_FLOW_EOS);
        return TRUE;
      case GST_EVENT_FLUSH_STOP:
        if (recording_ && timeline_.is_timed()) recording_->interrupt();
        is_consuming_ = false;
        flow_ = GST_FLOW_OK;
        output_.flush();
        return gst_pad_event_default(sink_, GST_OBJECT(element_), event);
      default:
        if (!is_serialized(event)) return gst_pad_event_default(sink_, GST_OBJECT(element_), event);
        output_.forward(event);
        return TRUE;
    }
  }

 private:
  /// Runs `work`; reports any exception. If the cause is a failed pull, returns its flow instead.
  template <class Work>
  GstFlowReturn guard(const Work& work) {
    return catch_exceptions(
        element_, [this](const std::exception& error) { return report_of(error, format_); },
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

  /// Creates the recording, to read a file from its start or a stream of words.
  void open_recording() {
    const std::shared_ptr<GstCaps> caps(caps_ ? gst_caps_copy(caps_.get()) : nullptr, unref_caps);
    auto make = [make_decoder = format_.make_decoder, caps, settings = format_settings.copy()] {
      return make_decoder(caps.get(), settings);
    };
    close_recording();
    const bool is_timed = timeline_.is_timed();
    const auto length = microseconds(settings.copy().buffer_duration);
    recording_ = std::make_shared<RecordingReader>(
        make, length, is_timed ? RecordingReader::Clock::stream : RecordingReader::Clock::file);
    if (decompressed_)
      recording_->open(*decompressed_);
    else if (bytes_)
      recording_->open(*bytes_);
    timeline_.set_recording(recording_);
    output_.set_recording(recording_);
    GST_DEBUG_OBJECT(element_, "opened in %s mode, with %s of %" GST_PTR_FORMAT,
                     bytes_ ? "pull" : "push", is_timed ? "the times of upstream" : "its own times",
                     caps_.get());
  }

  void close_recording() {
    timeline_.set_recording(nullptr);
    output_.set_recording(nullptr);
    recording_.reset();
    reports_.restart();
    is_consuming_ = false;
  }

  GstFlowReturn step() {
    const auto output = recording_->next();
    if (bytes_ && bytes_->failed()) return bytes_->flow();
    timeline_.advance_to(nanoseconds(recording_->position()));
    reports_.update(*recording_);
    if (reports_.has_new_corruption()) output_.interrupt_data();
    if (!output) return nothing_ready;
    if (std::holds_alternative<RecordingReader::Start>(*output)) {
      timeline_.update_duration(*recording_);
      GST_DEBUG_OBJECT(
          element_,
          "%" G_GSIZE_FORMAT " streams, origin %" GST_TIME_FORMAT ", duration %" GST_TIME_FORMAT,
          recording_->streams().size(), GST_TIME_ARGS(nanoseconds(recording_->origin())),
          GST_TIME_ARGS(timeline_.duration()));
      reports_.post_sorted(*recording_);
      reports_.post_unread_streams(*recording_);
    }
    return std::visit([this](const auto& item) { return output_.push(item); }, *output);
  }

  GstFlowReturn push_pending() {
    GstFlowReturn result = GST_FLOW_OK;
    while (result == GST_FLOW_OK) result = step();
    if (result != nothing_ready) return result;
    if (!recording_->is_past_stop()) return GST_FLOW_OK;
    result = output_.begin();
    return result == GST_FLOW_OK ? GST_FLOW_EOS : result;
  }

  /* pull mode */

  static void loop(gpointer data) {
    auto& self = *static_cast<EventReader*>(data);
    const GstFlowReturn result = self.guard([&] { return self.pull(); });
    if (result == GST_FLOW_OK) return;
    GST_DEBUG_OBJECT(self.element_, "pausing: %s", gst_flow_get_name(result));
    gst_pad_pause_task(self.sink_);
    if (result == GST_FLOW_FLUSHING) return;
    auto* const element = self.element_;
    const bool is_unbegun = result == GST_FLOW_EOS && !self.output_.has_pads();
    if (result != GST_FLOW_EOS || is_unbegun) wait_until_added(element);
    if (is_unbegun)
      post_message(element, GST_MESSAGE_ERROR,
                   {GST_STREAM_ERROR_FAILED, "Stopped before the recording began."},
                   "EOS while its start was read");
    if (result == GST_FLOW_NOT_LINKED)
      post_message(element, GST_MESSAGE_ERROR, not_linked(),
                   "streaming stopped, reason not-linked");
    else if (result != GST_FLOW_EOS && result != GST_FLOW_ERROR)
      GST_ELEMENT_FLOW_ERROR(element, result);
    self.output_.end(result != GST_FLOW_EOS);
  }

  /// Pushes the next output. Returns GST_FLOW_EOS at the end of the file or of the segment.
  GstFlowReturn pull() {
    if (!recording_) {
      OwnedCaps caps(gst_pad_peer_query_caps(sink_, nullptr));
      if (gst_caps_is_fixed(caps.get())) caps_ = std::move(caps);
      bytes_.emplace(sink_);
      decompressed_.reset();
      std::array<std::uint8_t, FileDecompressor::magic_size> start{};
      const auto count = bytes_->read(0, start);
      if (!count) return bytes_->flow();
      if (FileDecompressor::is_compressed(std::span(start).first(*count)))
        decompressed_.emplace(*bytes_);
      open_recording();
      const auto segment = timeline_.segment();
      recording_->seek(position_of(segment), stop_of(segment));
    }
    bytes_->retry();
    if (decompressed_) {
      if (!decompressed_->decompress()) return bytes_->flow();
      reports_.post_cut(decompressed_->corrupt_at());
    }
    GstFlowReturn result = step();
    if (result != nothing_ready) return result;
    result = output_.begin();
    if (recording_->at_end()) {
      reports_.post_end(*recording_, false);
      timeline_.update_duration(*recording_);
    }
    return result == GST_FLOW_OK ? GST_FLOW_EOS : result;
  }

  /* push mode: upstream sends the bytes of a file, or words with its own times */

  GstFlowReturn handle_buffer(GstBuffer* buffer) {
    const MappedBytes bytes(element_, OwnedBuffer(gst_buffer_ref(buffer)));
    if (!bytes.is_mapped()) return GST_FLOW_ERROR;
    if (!recording_) open_recording();
    is_consuming_ = true;
    std::optional<RecordingReader::Interval> interval;
    const bool has_end = GST_BUFFER_DURATION_IS_VALID(buffer);
    if (timeline_.is_timed() && GST_BUFFER_PTS_IS_VALID(buffer))
      interval = {microseconds(GST_BUFFER_PTS(buffer)),
                  has_end ? microseconds(GST_BUFFER_DURATION(buffer)) : 0};
    GstFlowReturn result = GST_FLOW_OK;
    if (decompressor_) {
      decompressor_->push(bytes.get());
      result = push_decompressed();
    } else {
      recording_->push(bytes.get(), interval);
      result = push_pending();
    }
    if (result == GST_FLOW_OK && interval && has_end) {
      recording_->advance_to(microseconds((GST_BUFFER_PTS(buffer) + GST_BUFFER_DURATION(buffer))));
      result = push_pending();
    }
    if (result != GST_FLOW_OK) {
      try {
        recording_->discard();
      } catch (const std::exception& error) {
        GST_DEBUG_OBJECT(element_, "dropped bytes cannot be read: %s", error.what());
      }
    }
    timeline_.add_bytes(bytes.get().size());
    return result;
  }

  GstFlowReturn push_decompressed() {
    GstFlowReturn result = GST_FLOW_OK;
    while (result == GST_FLOW_OK) {
      const auto bytes = decompressor_->next();
      if (bytes.empty()) break;
      recording_->push(bytes);
      result = push_pending();
    }
    timeline_.set_compressed(decompressor_->is_compressed());
    reports_.post_cut(decompressor_->corrupt_at());
    return result;
  }

  gboolean handle_caps(GstEvent* event) {
    GstCaps* const caps = caps_of(event);
    const bool is_new = !caps_ || !gst_caps_is_equal(caps_.get(), caps);
    if (is_new) {
      drain();
      close_recording();
      caps_.reset(gst_caps_ref(caps));
    }
    gst_event_unref(event);
    return TRUE;
  }

  /// Takes ownership of `event`.
  gboolean handle_segment(GstEvent* event) {
    drain();
    if (!plays_forwards(element_, event, "read")) return FALSE;
    const GstSegment segment = segment_of(event);
    const bool is_timed = segment.format == GST_FORMAT_TIME && are_words(caps_);
    const bool was_timed = timeline_.is_timed();
    const guint64 start = segment.start;
    timeline_.begin_bytes(is_timed, segment.format == GST_FORMAT_BYTES ? start : 0);
    decompressor_.reset();
    if (!is_timed && (segment.format != GST_FORMAT_BYTES || start == 0)) decompressor_.emplace();
    if (is_timed) {
      if (!was_timed) close_recording();
      output_.expect_segment();
      output_.forward(event);
      return TRUE;
    }
    const guint32 seqnum = gst_event_get_seqnum(event);
    gst_event_unref(event);
    return handle_bytes_segment(start, seqnum);
  }

  /// Begins a file, or completes a seek that upstream has done.
  gboolean handle_bytes_segment(guint64 start, guint32 seqnum) {
    const auto restart = timeline_.restart();
    const bool is_sought = restart && restart->byte() == start && seqnum != restart->superseded;
    if (restart && !is_sought && seqnum != restart->seqnum) {
      // The segment belongs to an earlier seek; the pending one will flush what follows.
      flow_ = GST_FLOW_FLUSHING;
      return TRUE;
    }
    timeline_.end_restart();
    output_.interrupt();
    // A seek point is useless for a recording that was closed meanwhile.
    if (!is_sought || (restart->seek_point && !recording_)) {
      close_recording();  // another file
      output_.set_seqnum(seqnum);
      timeline_.forget_file();
      return TRUE;
    }
    timeline_.set_segment(restart->segment);
    reports_.restart();
    output_.set_seqnum(restart->seqnum);
    output_.post_segment_start();
    return guard([&] {
             if (!recording_) open_recording();
             recording_->restart(restart->seek_point, position_of(restart->segment),
                                 stop_of(restart->segment));
             return GST_FLOW_OK;
           }) == GST_FLOW_OK;
  }

  /// Takes ownership of `event`.
  void handle_gap(GstEvent* event) {
    GstClockTime pts = GST_CLOCK_TIME_NONE;
    GstClockTime duration = GST_CLOCK_TIME_NONE;
    gst_event_parse_gap(event, &pts, &duration);
    const bool is_known =
        GST_CLOCK_TIME_IS_VALID(duration) && timeline_.is_timed() && flow_ == GST_FLOW_OK;
    if (is_known)
      flow_ = guard([&] {
        if (!recording_) open_recording();
        recording_->advance_to(microseconds(pts + duration));
        GstFlowReturn result = push_pending();
        if (recording_->has_events() || result != GST_FLOW_OK) return result;
        result = output_.begin();
        if (result == GST_FLOW_OK) output_.forward(gst_event_ref(event));
        return result;
      });
    gst_event_unref(event);
  }

  void finish_input() {
    if (flow_ != GST_FLOW_OK) return;
    flow_ = guard([&] {
      if (!recording_) open_recording();
      GstFlowReturn result = GST_FLOW_OK;
      if (decompressor_) {
        decompressor_->finish();
        result = push_decompressed();
        if (result != GST_FLOW_OK) return result;
      }
      recording_->finish();
      result = push_pending();
      if (result == GST_FLOW_OK) result = output_.begin();
      const bool is_timed = timeline_.is_timed();
      if (!is_timed) timeline_.update_duration(*recording_);
      reports_.post_end(*recording_, is_timed);
      return result;
    });
  }

  /// Pushes all pending output before a discontinuity.
  GstFlowReturn drain() {
    if (is_consuming_) finish_input();
    if (recording_) recording_->begin_times();
    is_consuming_ = false;
    return std::exchange(flow_, GST_FLOW_OK);
  }

  /* seeks, from any thread */

  bool seek(const SeekRequest& request) {
    if (!request.plays_on_from_time() || !timeline_.can_seek()) {
      GST_WARNING_OBJECT(element_,
                         "refused to seek at rate %g in %s: events are read forwards in time, from "
                         "sources that can seek",
                         request.rate(), gst_format_get_name(request.format()));
      return false;
    }
    if (request.counts_from_end() && !GST_CLOCK_TIME_IS_VALID(timeline_.duration())) {
      GST_INFO_OBJECT(element_, "refused to seek from the end: it is not known yet");
      return false;
    }
    if (timeline_.last_seek() == request.seqnum()) return true;
    const auto segment = timeline_.segment_after(request);
    const bool is_pulling = timeline_.is_pulling();
    if (!segment || (!is_pulling && !request.flushes())) return false;
    GST_DEBUG_OBJECT(element_, "seek in %s mode to %" GST_TIME_FORMAT ": %" GST_SEGMENT_FORMAT,
                     is_pulling ? "pull" : "push", GST_TIME_ARGS(segment->position), &*segment);
    const bool done = is_pulling ? seek_pulling(request) : seek_pushing(request, *segment);
    if (done) timeline_.set_last_seek(request.seqnum());
    return done;
  }

  bool seek_pulling(const SeekRequest& request) {
    // The streaming thread may add pads concurrently, so iterate safely.
    const auto send_all = [&](GstEvent* event) {
      gst_event_set_seqnum(event, request.seqnum());
      gst_pad_push_event(sink_, gst_event_ref(event));
      gst_element_foreach_src_pad(
          element_,
          +[](GstElement*, GstPad* pad, gpointer sent) -> gboolean {
            gst_pad_push_event(pad, gst_event_ref(static_cast<GstEvent*>(sent)));
            return TRUE;
          },
          event);
      gst_event_unref(event);
    };
    if (request.flushes())
      send_all(gst_event_new_flush_start());
    else
      gst_pad_pause_task(sink_);
    GST_PAD_STREAM_LOCK(sink_);
    if (request.flushes()) send_all(gst_event_new_flush_stop(TRUE));
    // From the position at which output has stopped.
    if (const auto segment = timeline_.segment_after(request)) timeline_.set_segment(*segment);
    reports_.restart();
    output_.set_seqnum(request.seqnum());
    output_.flush();
    const GstFlowReturn result = guard([&] {
      const auto segment = timeline_.segment();
      if (bytes_) bytes_->retry();
      if (recording_) recording_->seek(position_of(segment), stop_of(segment));
      return GST_FLOW_OK;
    });
    if (result == GST_FLOW_OK) output_.post_segment_start();
    if (timeline_.is_pulling()) gst_pad_start_task(sink_, loop, this, nullptr);
    GST_PAD_STREAM_UNLOCK(sink_);
    return result == GST_FLOW_OK;
  }

  /// Forwards a seek as a seek in bytes. Upstream flushes and sends a BYTES segment, which
  /// completes the seek.
  bool seek_pushing(const SeekRequest& request, const GstSegment& segment) {
    const auto restart = timeline_.begin_restart(request, segment);
    GST_DEBUG_OBJECT(element_, "asking upstream for byte %" G_GUINT64_FORMAT, restart.byte());
    GstEvent* const event = with_seqnum(
        gst_event_new_seek(request.rate(), GST_FORMAT_BYTES, GST_SEEK_FLAG_FLUSH, GST_SEEK_TYPE_SET,
                           static_cast<gint64>(restart.byte()), GST_SEEK_TYPE_NONE, -1),
        restart.seqnum);
    if (gst_pad_push_event(sink_, event)) return true;
    timeline_.end_restart();
    return false;
  }

  GstElement* element_;
  GstPad* sink_;
  const EventReaderFormat& format_;
  ReaderTimeline timeline_;
  ReaderReports reports_;
  ReaderOutput output_;
  OwnedCaps caps_;                                ///< input caps
  std::optional<PadBytes> bytes_;                 ///< pull mode only
  std::optional<DecompressedFile> decompressed_;  ///< of bytes_, if compressed
  std::optional<FileDecompressor> decompressor_;  ///< push mode, from a file's start
  std::shared_ptr<RecordingReader> recording_;
  bool is_consuming_ = false;         ///< bytes were passed to the recording
  GstFlowReturn flow_ = GST_FLOW_OK;  ///< anything else refuses pushed bytes
};

using GstEventReaderPrivate = EventReader*;

#define GST_TYPE_EVENT_READER (gst_event_reader_get_type())
G_DECLARE_DERIVABLE_TYPE(GstEventReader, gst_event_reader, GST, EVENT_READER, GstElement)

struct _GstEventReaderClass {
  GstElementClass parent_class;
  const EventReaderFormat* format;
};

G_DEFINE_ABSTRACT_TYPE_WITH_CODE(GstEventReader, gst_event_reader, GST_TYPE_ELEMENT,
                                 G_ADD_PRIVATE(GstEventReader)
                                     GST_DEBUG_CATEGORY_INIT(event_reader_debug, "eventreader", 0,
                                                             "readers of recordings"))

static EventReader*& priv_of(gpointer element) {
  return *static_cast<EventReader**>(
      gst_event_reader_get_instance_private(GST_EVENT_READER(element)));
}

static EventReader& reader_of(gpointer element) {
  return *priv_of(element);
}

static Guarded<ReaderSettings>& settings_of(GObject* object) {
  return reader_of(object).settings;
}

Guarded<FormatSettings>& format_settings_of(GObject* reader) {
  return reader_of(reader).format_settings;
}

static GstStateChangeReturn change_state(GstElement* element, GstStateChange transition) {
  const auto result =
      GST_ELEMENT_CLASS(gst_event_reader_parent_class)->change_state(element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) reader_of(element).reset();
  return result;
}

/// Creates the reader here, because the subclass's format is not yet known in init.
static void constructed(GObject* object) {
  priv_of(object) =
      new EventReader(GST_ELEMENT(object), *GST_EVENT_READER_GET_CLASS(object)->format);
  G_OBJECT_CLASS(gst_event_reader_parent_class)->constructed(object);
}

static void finalize(GObject* object) {
  delete priv_of(object);
  G_OBJECT_CLASS(gst_event_reader_parent_class)->finalize(object);
}

static void gst_event_reader_init(GstEventReader*) {}

static void gst_event_reader_class_init(GstEventReaderClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->constructed = constructed;
  object_class->finalize = finalize;
  GST_ELEMENT_CLASS(klass)->change_state = change_state;
  Properties<settings_of>(object_class)
      .add_fixed(&ReaderSettings::buffer_duration, "buffer-duration",
                 "Duration of a buffer of events (nanoseconds, in whole microseconds)", GST_USECOND,
                 10 * GST_SECOND);
  install_stats(
      object_class, [](GObject* object) { return reader_of(object).stats(); },
      "Counts since the start or the last seek: events, triggers, frames and imu-samples read; "
      "corrupt-places where bytes were skipped; and what was dropped: outside-events, outside the "
      "sensor; late-items, after their buffer was sent; stray-items, at an impossible time. "
      "skipped-items counts exposures and colours of an Event Stream, which are not events");
  gst_type_mark_as_plugin_api(GST_TYPE_EVENT_READER, static_cast<GstPluginAPIFlags>(0));
}

static void format_class_init(gpointer klass, gpointer data) {
  const auto& format = *static_cast<const EventReaderFormat*>(data);
  GST_EVENT_READER_CLASS(klass)->format = &format;
  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  // A demuxer even of a single stream: its pad is added once the header has given the caps, and
  // players find it as they find the demuxers of video files.
  const char* const name = format.has_many_streams ? "events_%u" : "src";
  add_pad_template(element_class, "sink", GST_PAD_SINK, format.caps);
  add_pad_template(element_class, name, GST_PAD_SRC, FILE_EVENTS_CAPS, GST_PAD_SOMETIMES);
  if (format.has_many_streams)
    add_pad_template(element_class, "video_%u", GST_PAD_SRC, RECORDED_VIDEO_CAPS,
                     GST_PAD_SOMETIMES);
  set_metadata(klass, format.long_name, "Codec/Demuxer", format.description);
  set_input_extensions(element_class, format.caps);
  if (format.add_properties != nullptr) {
    FormatProperties properties(G_OBJECT_CLASS(klass));
    format.add_properties(properties);
  }
}

GType event_reader_type(const EventReaderFormat& format) {
  return row_type(GST_TYPE_EVENT_READER, format.type_name, format_class_init, &format);
}
