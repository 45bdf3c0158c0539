// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/aedatdemux/pads.hpp"

#include <algorithm>
#include <mutex>
#include <utility>
#include <vector>

#include "elements/eventcam/aedatdemux/queries.hpp"
#include "elements/eventcam/aedatdemux/seeking.hpp"
#include "elements/eventcam/aedatdemux/state.hpp"
#include "elements/eventcam/aedatframe.hpp"
#include "gst/base/file_streams.hpp"
#include "gst/base/owned.hpp"

namespace aedatdemux {

static GstStaticPadTemplate events_template = GST_STATIC_PAD_TEMPLATE(
    "events_%u", GST_PAD_SRC, GST_PAD_SOMETIMES, GST_STATIC_CAPS(FILE_EVENTS_CAPS));
static GstStaticPadTemplate video_template = GST_STATIC_PAD_TEMPLATE(
    "video_%u", GST_PAD_SRC, GST_PAD_SOMETIMES, GST_STATIC_CAPS(AEDAT_VIDEO_CAPS));

void add_pad_templates(GstElementClass* klass) {
  gst_element_class_add_static_pad_template(klass, &events_template);
  gst_element_class_add_static_pad_template(klass, &video_template);
}

static guint group_of(GstAedatDemux* self) {
  auto* priv = self->priv;
  if (priv->group != GST_GROUP_ID_INVALID) return priv->group;
  GstEvent* upstream = gst_pad_get_sticky_event(priv->sink, GST_EVENT_STREAM_START, 0);
  priv->group = group_of_streams(upstream);
  gst_clear_event(&upstream);
  return priv->group;
}

bool send_caps(Stream& stream) {
  const OwnedCaps caps(stream.kind == Aedat4Kind::frames ? gst_video_info_to_caps(&*stream.video)
                                                         : file_events_caps(stream.size));
  return push_stream_caps(stream.pad, caps.get()) != FALSE;
}

GstClockTime pts_of(const State& state, GstClockTime time) {
  return time + static_cast<GstClockTime>(std::max<Microseconds>(state.zero, 0)) * GST_USECOND;
}

void send_segment(GstAedatDemux* self, Stream& stream) {
  if (!std::exchange(stream.segment_due, false)) return;
  GstSegment segment;
  {
    const std::lock_guard lock(self->priv->mutex);
    segment = self->priv->segment;
  }
  segment = segment_from(pts_of(self->priv->state, 0), segment);
  gst_pad_push_event(stream.pad, with_seqnum(gst_event_new_segment(&segment), self->priv->seqnum));
}

static void send_tags(GstAedatDemux* self, std::size_t index) {
  const State& state = self->priv->state;
  constexpr const char* names[] = {"AEDAT 2.0", "AEDAT 3.1", "AEDAT 4.0"};
  GstPad* const pad = state.streams[index].pad;
  GstTagList* const container =
      gst_tag_list_new(GST_TAG_CONTAINER_FORMAT, names[state.reader.version() - 2], nullptr);
  gst_tag_list_set_scope(container, GST_TAG_SCOPE_GLOBAL);
  gst_pad_push_event(pad, gst_event_new_tag(container));
  const auto& source = state.reader.streams()[index].source;
  if (source.empty() ||
      !g_utf8_validate(source.data(), static_cast<gssize>(source.size()), nullptr))
    return;
  gst_pad_push_event(
      pad, gst_event_new_tag(gst_tag_list_new(GST_TAG_DEVICE_MODEL, source.c_str(), nullptr)));
}

void make_pad(GstAedatDemux* self, std::size_t index) {
  auto* priv = self->priv;
  Stream& stream = priv->state.streams[index];
  const bool of_events = stream.kind == Aedat4Kind::events;
  if (of_events) {
    if (stream.size.width <= 0 || stream.size.height <= 0) {
      stream.size = stream.used.sensor();
      stream.size_assumed = true;
      GST_INFO_OBJECT(self, "the size is not told; %dx%d is assumed", stream.size.width,
                      stream.size.height);
    }
    stream.chunker = Chunker(interval_length(self), output_start(self));
  }
  gchar* const name = g_strdup_printf(of_events ? "events_%u" : "video_%u", stream.number);
  stream.pad =
      gst_pad_new_from_static_template(of_events ? &events_template : &video_template, name);
  gst_pad_set_event_function(stream.pad, src_event);
  gst_pad_set_query_function(stream.pad, src_query);
  gst_pad_use_fixed_caps(stream.pad);
  gst_pad_set_active(stream.pad, TRUE);

  GstEvent* const start = file_stream_start(GST_ELEMENT(self), stream.pad, name, group_of(self));
  gst_pad_push_event(stream.pad, with_seqnum(start, priv->seqnum));
  g_free(name);
  send_caps(stream);
  send_segment(self, stream);
  send_tags(self, index);
}

void show_pads(GstAedatDemux* self) {
  std::vector<GstPad*> pads;
  for (const auto& stream : self->priv->state.streams)
    if (stream.pad != nullptr) pads.push_back(stream.pad);
  announce_streams(GST_ELEMENT(self), pads);
  for (GstPad* const pad : pads) {
    if (GST_OBJECT_PARENT(pad) != nullptr) continue;
    gst_flow_combiner_add_pad(self->priv->combiner, pad);
    gst_element_add_pad(GST_ELEMENT(self), pad);
  }
}

}  // namespace aedatdemux
