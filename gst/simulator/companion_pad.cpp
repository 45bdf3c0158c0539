// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/simulator/companion_pad.hpp"

#include <algorithm>
#include <string>
#include <utility>

using eventcamera::Nanoseconds;

std::optional<Nanoseconds> running_time_of(const GstSegment& segment, GstClockTime time) {
  guint64 running = 0;
  const gint sign = gst_segment_to_running_time_full(&segment, GST_FORMAT_TIME, time, &running);
  if (sign == 0 || running >= G_MAXINT64 / 2) return std::nullopt;
  return sign * static_cast<Nanoseconds>(running);
}

static CompanionPad::Item copy_of(const CompanionPad::Item& item) {
  return {item.time, OwnedBuffer(gst_buffer_ref(item.buffer.get())),
          OwnedCaps(gst_caps_ref(item.caps.get()))};
}

/* functions of the pad */

struct CompanionPad::Functions {
  static CompanionPad& of(GstPad* pad) {
    return *static_cast<CompanionPad*>(gst_pad_get_element_private(pad));
  }

  static GstFlowReturn chain(GstPad* pad, GstObject* element, GstBuffer* buffer) {
    const Report no_memory{GST_RESOURCE_ERROR_NO_SPACE_LEFT,
                           std::string("Not enough memory for the ") + of(pad).content_ + "."};
    return catch_exceptions(element, no_memory, [&] {
      return of(pad).push(GST_ELEMENT(element), OwnedBuffer(buffer));
    });
  }

  static gboolean event(GstPad* pad, GstObject*, GstEvent* event) {
    of(pad).take_event(event);
    gst_event_unref(event);
    return TRUE;
  }

  /// The element's other pads know nothing of this stream.
  static gboolean query(GstPad* pad, GstObject* element, GstQuery* query) {
    switch (GST_QUERY_TYPE(query)) {
      case GST_QUERY_CAPS:
      case GST_QUERY_ACCEPT_CAPS:
        return gst_pad_query_default(pad, element, query);
      default:
        return FALSE;
    }
  }
};

GstPad* CompanionPad::add_to(GstElement* element, GstPadTemplate* pad_template) {
  if (const OwnedPad existing = pad()) return nullptr;
  GstPad* const pad =
      gst_pad_new_from_template(pad_template, GST_PAD_TEMPLATE_NAME_TEMPLATE(pad_template));
  gst_pad_set_element_private(pad, this);
  gst_pad_set_chain_function(pad, Functions::chain);
  gst_pad_set_event_function(pad, Functions::event);
  gst_pad_set_query_function(pad, Functions::query);
  g_signal_connect(pad, "linked", G_CALLBACK(+[](GstPad*, GstPad*, CompanionPad* self) {
                     self->change([&] { self->is_linked_ = true; });
                   }),
                   this);
  g_signal_connect(pad, "unlinked", G_CALLBACK(+[](GstPad*, GstPad*, CompanionPad* self) {
                     self->change([&] { self->is_linked_ = false; });
                   }),
                   this);
  gst_segment_init(&segment_, GST_FORMAT_TIME);
  change([&] {
    pad_ = pad;
    is_flushing_ = false;
  });
  gst_element_add_pad(element, pad);
  return pad;
}

void CompanionPad::remove_from(GstElement* element, GstPad* pad) {
  change([&] {
    pad_ = nullptr;
    is_flushing_ = true;
  });
  gst_pad_set_active(pad, FALSE);
  gst_element_remove_pad(element, pad);
  forget();
}

void CompanionPad::forget() {
  change([&] {
    items_.clear();
    known_ = never;
    is_segment_done_ = false;
  });
}

/// Buffers may follow those of a segment that is done, as in a loop.
void CompanionPad::begin_segment() {
  if (std::exchange(is_segment_done_, false)) known_ = never;
}

OwnedPad CompanionPad::pad() {
  const std::lock_guard lock(mutex_);
  return OwnedPad(pad_ == nullptr ? nullptr : GST_PAD(gst_object_ref(pad_)));
}

bool CompanionPad::is_linked() {
  const std::lock_guard lock(mutex_);
  return is_linked_;
}

/* the pad's thread */

GstFlowReturn CompanionPad::push(GstElement* element, OwnedBuffer buffer) {
  const auto cause = [&] {
    gchar* text = gst_info_strdup_printf("%" GST_PTR_FORMAT, buffer.get());
    std::string description = text;
    g_free(text);
    return description;
  };
  const auto time = running_time_of(segment_, GST_BUFFER_PTS(buffer.get()));
  if (!caps_) return GST_FLOW_NOT_NEGOTIATED;

  std::unique_lock lock(mutex_);
  if (!time || *time < known_) {
    lock.unlock();
    warn_of_times_(element,
                   {GST_STREAM_ERROR_FORMAT,
                    std::string("Cannot match all ") + content_ +
                        " to the video: one has no PTS, or an earlier one than the one before it; "
                        "skipping it. Give them the timestamps of the frames that they belong to."},
                   cause());
    return GST_FLOW_OK;
  }
  changed_.wait(lock, [&] {
    return is_stopped_ || is_flushing_ || items_.empty() ||
           items_.back().time < (is_seeking_ ? never : position_) + resolution;
  });
  if (is_stopped_ || is_flushing_) return GST_FLOW_FLUSHING;
  if (position_ == forever && !is_seeking_) return GST_FLOW_EOS;
  const bool is_full = items_.size() == max_items;
  if (is_full) items_.pop_front();
  known_ = *time;
  items_.push_back({*time, std::move(buffer), OwnedCaps(gst_caps_ref(caps_.get()))});
  lock.unlock();
  changed_.notify_all();
  if (is_full)
    warn_of_number_(
        element,
        {GST_STREAM_ERROR_FORMAT, "More than " + std::to_string(max_items) + " " + content_ +
                                      " between two frames; dropping the earliest."},
        "limit of memory");
  return GST_FLOW_OK;
}

void CompanionPad::take_event(GstEvent* event) {
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_CAPS: {
      GstCaps* caps = nullptr;
      gst_event_parse_caps(event, &caps);
      caps_.reset(gst_caps_ref(caps));
      break;
    }
    case GST_EVENT_SEGMENT:
      gst_event_copy_segment(event, &segment_);
      // As from byte sources: the timestamps count from 0.
      if (segment_.format != GST_FORMAT_TIME) gst_segment_init(&segment_, GST_FORMAT_TIME);
      change([&] { begin_segment(); });
      break;
    case GST_EVENT_GAP: {
      GstClockTime start = GST_CLOCK_TIME_NONE;
      GstClockTime duration = GST_CLOCK_TIME_NONE;
      gst_event_parse_gap(event, &start, &duration);
      if (GST_CLOCK_TIME_IS_VALID(duration)) start += duration;
      if (const auto end = running_time_of(segment_, start))
        change([&] { known_ = std::max(known_, *end - resolution); });
      break;
    }
    case GST_EVENT_SEGMENT_DONE:
      change([&] {
        is_segment_done_ = true;
        known_ = forever;
      });
      break;
    case GST_EVENT_EOS:
      change([&] { known_ = forever; });
      break;
    case GST_EVENT_STREAM_START:  // perhaps after the end of another one
      change([&] { known_ = never; });
      break;
    case GST_EVENT_FLUSH_START:
      change([&] { is_flushing_ = true; });
      break;
    case GST_EVENT_FLUSH_STOP:
      forget();
      change([&] { is_flushing_ = false; });
      break;
    default:
      break;
  }
}

/* the video's thread */

void CompanionPad::start() {
  forget();
  change([&] {
    is_stopped_ = false;
    is_flushing_ = false;
    is_video_flushing_ = false;
    position_ = never;
  });
  warn_of_times_.reset();
  warn_of_number_.reset();
}

void CompanionPad::stop() {
  change([&] { is_stopped_ = true; });
  forget();
}

void CompanionPad::set_flushing(bool is_flushing) {
  change([&] { is_video_flushing_ = is_flushing; });
}

void CompanionPad::set_seeking(bool is_seeking) {
  change([&] { is_seeking_ = is_seeking; });
}

void CompanionPad::begin() {
  change([&] {
    position_ = never;
    begin_segment();
  });
}

void CompanionPad::advance(Nanoseconds start, Nanoseconds time) {
  change([&] {
    while (items_.size() > 1 && items_[1].time <= start) items_.pop_front();
    position_ = std::max(position_, time);
  });
}

std::optional<std::vector<CompanionPad::Item>> CompanionPad::items(Nanoseconds from,
                                                                   Nanoseconds until) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] {
    return is_stopped_ || is_video_flushing_ || !is_linked_ || until - resolution < known_;
  });
  if (is_stopped_ || is_video_flushing_) return std::nullopt;
  auto first = std::ranges::upper_bound(items_, from, {}, &Item::time);
  if (first != items_.begin()) --first;
  std::vector<Item> found;
  for (; first != items_.end() && first->time < until + resolution; ++first)
    found.push_back(copy_of(*first));
  return found;
}
