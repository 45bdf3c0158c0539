// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/recording/reader/reader_pad.hpp"

#include <algorithm>
#include <utility>

#include "gst/base/event_buffer.hpp"
#include "gst/base/event_caps.hpp"
#include "gst/base/pads.hpp"

using eventcamera::SensorSize;

GstEvent* with_seqnum(GstEvent* event, guint32 seqnum) {
  if (seqnum != GST_SEQNUM_INVALID) gst_event_set_seqnum(event, seqnum);
  return event;
}

std::vector<eventcamera::Event> SpareMemory::pop() {
  const std::lock_guard lock(mutex_);
  if (count_ == 0) return {};
  auto memory = std::exchange(spare_[--count_], {});
  capacity_ -= memory.capacity();
  return memory;
}

void SpareMemory::push(std::vector<eventcamera::Event> memory) noexcept {
  constexpr std::size_t min_needed = 512;
  const std::lock_guard lock(mutex_);
  needed_ = std::max({memory.size(), needed_ - needed_ / 64, min_needed});
  const auto capacity = memory.capacity();
  if (capacity / 4 > needed_ || capacity_ + capacity > max_events || count_ == spare_.size())
    return;
  spare_[count_++] = std::move(memory);
  capacity_ += capacity;
}

ReaderPad::ReaderPad(GstPadTemplate* templ, const std::string& name, GstDebugCategory* category)
    : pad_(gst_pad_new_from_template(templ, name.c_str())), name_(name), category_(category) {
  gst_object_ref_sink(pad_);
  gst_pad_use_fixed_caps(pad_);
}

ReaderPad::~ReaderPad() {
  reset();
  gst_object_unref(pad_);
}

void ReaderPad::reset() {
  interrupt();
  started_ = false;
  size_ = {};
  video_.reset();
}

void ReaderPad::interrupt() {
  segment_due_ = true;
  discontinuous_ = true;
}

void ReaderPad::start_stream(GstElement* element, guint group) {
  const bool is_only = name_ == "src";
  gchar* const id = gst_pad_create_stream_id(pad_, element, is_only ? nullptr : name_.c_str());
  GstStream* const stream =
      gst_stream_new(id, nullptr, GST_STREAM_TYPE_VIDEO, GST_STREAM_FLAG_NONE);
  GstEvent* const event = gst_event_new_stream_start(id);
  gst_event_set_stream(event, stream);
  gst_event_set_group_id(event, group);
  gst_object_unref(stream);
  g_free(id);
  start_stream(event);
}

void ReaderPad::start_stream(GstEvent* upstream) {
  reset();
  started_ = true;
  if (!GST_PAD_IS_ACTIVE(pad_)) gst_pad_set_active(pad_, TRUE);
  gst_pad_push_event(pad_, upstream);
}

void ReaderPad::send_tags(const std::string& format, const std::string& camera) {
  if (!format.empty()) {
    GstTagList* const container =
        gst_tag_list_new(GST_TAG_CONTAINER_FORMAT, format.c_str(), nullptr);
    gst_tag_list_set_scope(container, GST_TAG_SCOPE_GLOBAL);
    gst_pad_push_event(pad_, gst_event_new_tag(container));
  }
  if (!camera.empty() &&
      g_utf8_validate(camera.data(), static_cast<gssize>(camera.size()), nullptr))
    gst_pad_push_event(
        pad_, gst_event_new_tag(gst_tag_list_new(GST_TAG_DEVICE_MODEL, camera.c_str(), nullptr)));
}

bool ReaderPad::send_caps(SensorSize size) {
  if (size == size_) return true;
  const OwnedCaps caps = event_caps(size.width, size.height);
  const bool taken = push_caps(caps.get());
  if (taken) size_ = size;
  return taken;
}

bool ReaderPad::send_caps(const GstVideoInfo& info) {
  if (video_ && gst_video_info_is_equal(&*video_, &info)) return true;
  const OwnedCaps caps(gst_video_info_to_caps(&info));
  const bool taken = push_caps(caps.get());
  if (taken) video_ = info;
  return taken;
}

bool ReaderPad::push_caps(GstCaps* caps) {
  GST_CAT_DEBUG_OBJECT(category_, pad_, "sending %" GST_PTR_FORMAT, caps);
  if (GstStream* const stream = gst_pad_get_stream(pad_)) {
    gst_stream_set_caps(stream, caps);
    gst_object_unref(stream);
  }
  return gst_pad_push_event(pad_, gst_event_new_caps(caps)) != FALSE;
}

GstFlowReturn ReaderPad::refusal() const {
  return GST_PAD_IS_FLUSHING(pad_) || gst_pad_get_last_flow_return(pad_) == GST_FLOW_FLUSHING
             ? GST_FLOW_FLUSHING
             : GST_FLOW_NOT_NEGOTIATED;
}

void ReaderPad::send_segment(const GstSegment& segment, guint32 seqnum) {
  if (std::exchange(segment_due_, false))
    gst_pad_push_event(pad_, with_seqnum(gst_event_new_segment(&segment), seqnum));
}

GstFlowReturn ReaderPad::push(GstBuffer* buffer, GstClockTime pts) {
  GST_BUFFER_PTS(buffer) = pts;
  if (std::exchange(discontinuous_, false)) GST_BUFFER_FLAG_SET(buffer, GST_BUFFER_FLAG_DISCONT);
  return gst_pad_push(pad_, buffer);
}

GstFlowReturn ReaderPad::push(std::vector<eventcamera::Event> memory, std::size_t count,
                              std::span<const eventcamera::Label> labels, GstClockTime pts,
                              GstClockTime duration) {
  struct Owner {
    std::shared_ptr<SpareMemory> spare;
    std::vector<eventcamera::Event> memory;
  };
  auto owner = std::make_unique<Owner>(Owner{spare_, std::move(memory)});
  auto* const events = owner->memory.data();
  const gsize size = count * sizeof(eventcamera::Event);
  OwnedBuffer buffer(gst_buffer_new_wrapped_full(
      static_cast<GstMemoryFlags>(0), events, size, 0, size, owner.release(), [](gpointer data) {
        const std::unique_ptr<Owner> last(static_cast<Owner*>(data));
        last->spare->push(std::move(last->memory));
      }));
  if (!labels.empty()) std::ranges::copy(labels, add_labels(buffer.get(), count).begin());
  GST_BUFFER_DURATION(buffer.get()) = duration;
  return push(buffer.release(), pts);
}

GstFlowReturn ReaderPad::push_gap(GstClockTime pts, GstClockTime duration) {
  return push_event(pad_, gst_event_new_gap(pts, duration));
}
