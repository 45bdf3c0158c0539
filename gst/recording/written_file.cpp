// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/recording/written_file.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include "gst/base/buffer_bytes.hpp"
#include "gst/base/errors.hpp"
#include "gst/base/pads.hpp"
#include "gst/recording/stream_header.hpp"

GST_DEBUG_CATEGORY_EXTERN(event_writer_debug);
#define GST_CAT_DEFAULT event_writer_debug

using eventcamera::AbsoluteEvent;
using eventcamera::Encoder;
using eventcamera::Microseconds;
using eventcamera::Trigger;

/// Alignment of words in bytes; none crosses a multiple of it.
static constexpr std::size_t word_bytes = 8;

/// Maximum bytes per event, including time words.
static constexpr std::size_t max_event_bytes = 32;

WrittenFile::WrittenFile(WritableEvents& writable, GstPad* src, const GstEventCameraInfo& info,
                         std::unique_ptr<Encoder> encoder, OwnedCaps caps)
    : writable_(writable),
      src_(src),
      info_(info),
      caps_(std::move(caps)),
      encoder_(std::move(encoder)) {
  writable_.begin_file({info.width, info.height});
  encoder_->encode({}, bytes_);
  if (bytes_.empty()) return;
  header_.reset(copied_buffer(std::as_bytes(std::span(bytes_))));
  caps_ = with_stream_header(std::move(caps_), header_.get());
  bytes_.clear();
}

/* output */

/// Maximum bytes per buffer.
static std::size_t capacity(guint mtu) {
  return mtu / word_bytes * word_bytes;
}

GstFlowReturn WrittenFile::push_header(GstClockTime pts) {
  const OwnedBuffer header = std::move(header_);
  if (!header) return GST_FLOW_OK;
  GstBuffer* const buffer = gst_buffer_copy(header.get());  // the original belongs to the caps
  GST_BUFFER_PTS(buffer) = pts;
  has_begun_ = true;
  return gst_pad_push(src_, buffer);
}

/// Pushes the encoded bytes in one buffer, or in several if the words of a silence exceed one. Only
/// the last has a duration, because the interval continues after the others.
GstFlowReturn WrittenFile::push_bytes(GstClockTime pts, GstClockTime duration) {
  std::span<const guint8> bytes = bytes_;
  GstFlowReturn result = GST_FLOW_OK;
  while (!bytes.empty() && result == GST_FLOW_OK) {
    const auto piece = bytes.first(std::min(bytes.size(), capacity(mtu_)));
    bytes = bytes.subspan(piece.size());
    GstBuffer* const buffer = copied_buffer(std::as_bytes(piece));
    GST_BUFFER_PTS(buffer) = pts;
    if (bytes.empty()) GST_BUFFER_DURATION(buffer) = duration;
    GST_LOG_OBJECT(element(), "%" G_GSIZE_FORMAT " bytes at %" GST_TIME_FORMAT, piece.size(),
                   GST_TIME_ARGS(pts));
    has_begun_ = true;
    result = gst_pad_push(src_, buffer);
  }
  bytes_.clear();
  return result;
}

/// Overwrites part of the header.
GstFlowReturn WrittenFile::push_patch(eventcamera::FilePatch patch) {
  GST_DEBUG_OBJECT(element(),
                   "completing the header: %" G_GSIZE_FORMAT " bytes at %" G_GUINT64_FORMAT,
                   patch.bytes.size(), patch.position);
  if (!peer_can_seek(src_, GST_FORMAT_BYTES)) {
    GST_ELEMENT_WARNING(element(), STREAM, ENCODE,
                        ("The file header lacks the number of events. Write to a sink that can "
                         "seek, such as filesink, to complete it."),
                        ("downstream does not seek in bytes"));
    return GST_FLOW_OK;
  }
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_BYTES);
  segment.start = patch.position;
  gst_pad_push_event(src_, gst_event_new_segment(&segment));
  bytes_ = std::move(patch.bytes);
  return push_bytes(GST_CLOCK_TIME_NONE, GST_CLOCK_TIME_NONE);
}

/// A stream without buffers may have no segment.
static void ensure_segment(GstPad* src) {
  if (has_segment(src)) return;
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  gst_pad_push_event(src, gst_event_new_segment(&segment));
}

/* encoding */

/// Returns the number of leading events that fit into `room` bytes. Limited to events so close in
/// time that no words for pauses are written between them.
static std::size_t count_that_fits(std::span<const AbsoluteEvent> events, std::size_t room) {
  constexpr Microseconds close = 1000;
  events = events.first(std::min(events.size(), room / max_event_bytes));
  const auto end = std::ranges::find_if(
      events, [&](const auto& event) { return event.t - events.front().t > close; });
  return static_cast<std::size_t>(end - events.begin());
}

/// Encodes events, and pushes each full buffer. `start` is the start time of the next buffer.
GstFlowReturn WrittenFile::encode(std::span<const AbsoluteEvent> events, GstClockTime& start) {
  const auto room = capacity(mtu_);
  while (!events.empty()) {
    const auto count = mtu_ == G_MAXUINT
                           ? events.size()
                           : count_that_fits(events, room - std::min(room, bytes_.size()));
    if (count == 0) {
      const auto end = std::max(start, static_cast<GstClockTime>(events.front().t) * GST_USECOND);
      const GstFlowReturn result = push_bytes(start, end - start);
      if (result != GST_FLOW_OK) return result;
      start = end;
    }
    encoder_->encode(events.first(count), bytes_);
    if (count > 0) last_ = events[count - 1].t;
    events = events.subspan(count);
  }
  return GST_FLOW_OK;
}

/// Encodes triggers, except late ones.
void WrittenFile::encode(std::span<const Trigger> triggers) {
  for (const auto& trigger : triggers) {
    if (trigger.t < last_ || !encoder_->encode_trigger(trigger, bytes_)) {
      GST_LOG_OBJECT(element(),
                     "dropped a trigger of input %u at %" G_GINT64_FORMAT
                     " us: late, or the format has none",
                     unsigned{trigger.id}, gint64{trigger.t});
      continue;
    }
    last_ = trigger.t;
    ++writable_.written().lock()->triggers;
  }
}

/// Encodes all queued triggers.
void WrittenFile::encode_triggers() {
  encode(triggers_.pop_before(eventcamera::after_all_items));
}

/// Encodes events, and the queued triggers among them.
GstFlowReturn WrittenFile::encode_all(std::span<const AbsoluteEvent> events, GstClockTime& start) {
  if (events.empty()) return GST_FLOW_OK;
  std::span<const Trigger> triggers = triggers_.pop_before(events.back().t);
  GstFlowReturn result = GST_FLOW_OK;
  while (!events.empty() && result == GST_FLOW_OK) {
    const auto due = std::ranges::lower_bound(triggers, events.front().t, {}, &Trigger::t);
    encode(std::span(triggers.begin(), due));
    triggers = {due, triggers.end()};
    const auto next = triggers.empty() ? events.back().t : triggers.front().t;
    const auto end = std::ranges::upper_bound(events, next, {}, &AbsoluteEvent::t);
    const auto count = static_cast<std::size_t>(end - events.begin());
    result = encode(events.first(count), start);
    events = events.subspan(count);
  }
  return result;
}

/// Warns of the first pause that is removed, and at the end of the file of the total, if there are
/// more.
void WrittenFile::warn_of_pauses(bool at_end) {
  const auto removed = encoder_->removed_time();
  const auto reported = pauses_reported_;
  if (removed == reported || (reported > 0 && !at_end)) return;
  pauses_reported_ = removed;
  const auto seconds = std::to_string(removed / 1'000'000) + " s";
  post_message(
      element(), GST_MESSAGE_WARNING,
      {GST_STREAM_ERROR_ENCODE,
       (reported == 0 ? "Left out a pause of " + seconds + ", which is"
                      : "Left out pauses of " + seconds + " in total, which are") +
           " too long for this format: later timestamps are shifted back by that much. Write "
           "AEDAT4, HDF5, NumPy or text to keep them."},
      "the clock of the format cannot represent " + std::to_string(removed) + " us");
}

/* input */

GstFlowReturn WrittenFile::write(GstBuffer* buffer, guint mtu) {
  mtu_ = mtu;
  GstClockTime start = GST_BUFFER_PTS(buffer);
  GstFlowReturn result = GST_FLOW_OK;
  const bool encoded = writable_.write(buffer, [&](const auto& events) {
    if (result == GST_FLOW_OK) result = push_header(start);
    if (result != GST_FLOW_OK) return;
    const auto labels = encoder_->label(writable_.labels());
    writable_.written().lock()->labels += labels;
    result = encode_all(events, start);
  });
  if (!encoded) return GST_FLOW_ERROR;
  warn_of_pauses(false);
  if (result != GST_FLOW_OK) return result;
  GstClockTime duration = GST_BUFFER_DURATION(buffer);
  if (GST_CLOCK_TIME_IS_VALID(duration))
    duration -= std::min(duration, start - GST_BUFFER_PTS(buffer));
  return push_bytes(start, duration);
}

GstFlowReturn WrittenFile::write(std::span<const Trigger> triggers, guint mtu) {
  mtu_ = mtu;
  triggers_.push(triggers);
  if (!triggers_.is_full()) return GST_FLOW_OK;
  ensure_segment(src_);
  const auto first = std::max<Microseconds>(*triggers_.first(), 0);
  const auto start = static_cast<GstClockTime>(first) * GST_USECOND;
  if (const GstFlowReturn result = push_header(start); result != GST_FLOW_OK) return result;
  encode_triggers();
  writable_.advance_to(last_);
  return push_bytes(start, GST_CLOCK_TIME_NONE);
}

GstFlowReturn WrittenFile::end(guint mtu) {
  mtu_ = mtu;
  ensure_segment(src_);
  GstFlowReturn result = push_header(GST_CLOCK_TIME_NONE);
  if (result != GST_FLOW_OK) return result;
  encode_triggers();
  for (bool more = true; more && result == GST_FLOW_OK;) {
    more = encoder_->finish(bytes_);
    result = push_bytes(GST_CLOCK_TIME_NONE, GST_CLOCK_TIME_NONE);
  }
  warn_of_pauses(true);
  auto patch = encoder_->patch();
  return result == GST_FLOW_OK && patch ? push_patch(*std::move(patch)) : result;
}

void WrittenFile::warn_of_pending() const {
  const auto pending = encoder_->pending();
  if (pending == 0) return;
  const Report report{GST_STREAM_ERROR_ENCODE,
                      "Lost " + std::to_string(pending) + " event" + (pending == 1 ? "" : "s") +
                          ", and the file is incomplete, because the stream was stopped before its "
                          "end. Send EOS first, as gst-launch-1.0 -e does."};
  GST_WARNING_OBJECT(element(), "%s", report.text.c_str());
  post_message(element(), GST_MESSAGE_WARNING, report,
               "the format is written at the end of the stream");
}
