// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/aedatdemux/input.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>
#include <variant>

#include "elements/eventcam/aedatdemux/output.hpp"
#include "elements/eventcam/aedatdemux/pads.hpp"
#include "elements/eventcam/aedatdemux/state.hpp"
#include "elements/eventcam/aedatdemux/statistics.hpp"
#include "elements/eventcam/aedatdemux/table.hpp"
#include "elements/eventcam/aedatdemux/zero.hpp"
#include "elements/eventcam/aedatframe.hpp"

namespace aedatdemux {

using eventcamera::Aedat4Events;
using eventcamera::Aedat4Picture;
using eventcamera::Aedat4Triggers;

static GstFlowReturn take(GstAedatDemux* self, const Aedat4Events& item) {
  State& state = self->priv->state;
  if (item.events.empty()) return GST_FLOW_OK;
  if (state.holding) {
    hold(state, item.stream, item.events);
    return GST_FLOW_OK;
  }
  Stream& stream = state.streams[item.stream];
  if (stream.pad == nullptr) {
    stream.used.include(item.events);
    make_pad(self, item.stream);
    show_pads(self);
  }
  return put_out(self, item.stream, item.events);
}

static GstFlowReturn take(GstAedatDemux* self, const Aedat4Picture& item) {
  State& state = self->priv->state;
  Frame frame;
  frame.t = item.frame.t;
  if (frame.t < -Chunker::max_time || frame.t > Chunker::max_time ||
      !aedat_frame_info(item.frame, &frame.info)) {
    ++state.counts.untimely;
    return GST_FLOW_OK;
  }
  frame.buffer.reset(aedat_frame_buffer(item.frame, &frame.info));
  if (state.holding) {
    hold(state, item.stream, std::move(frame));
    return GST_FLOW_OK;
  }
  Stream& stream = state.streams[item.stream];
  if (stream.pad == nullptr) {
    stream.video = frame.info;
    make_pad(self, item.stream);
    show_pads(self);
  }
  return put_out(self, item.stream, std::move(frame));
}

static GstFlowReturn take(GstAedatDemux* self, const Aedat4Triggers& item) {
  self->priv->state.counts.triggers += item.triggers.size();
  return GST_FLOW_OK;
}

/// Takes up streams that the reader has come to know. May throw.
static void learn_streams(GstAedatDemux* self) {
  State& state = self->priv->state;
  const auto& known = state.reader.streams();
  for (std::size_t i = 0; i < std::min(known.size(), state.streams.size()); ++i)
    if (known[i].kind != state.streams[i].kind)
      throw std::runtime_error("after a flush there came another file");
  for (auto i = state.streams.size(); i < known.size(); ++i) {
    const auto kind = known[i].kind;
    const auto number = std::count_if(state.streams.begin(), state.streams.end(),
                                      [kind](const Stream& other) { return other.kind == kind; });
    state.streams.push_back(Stream{.kind = kind,
                                   .number = static_cast<guint>(number),
                                   .size = known[i].size,
                                   .chunker = Chunker(interval_length(self)),
                                   .first = {},
                                   .video = {}});
  }
  // Older versions tell their one stream's size only later.
  if (state.holding && state.reader.version() < 4 && !known.empty())
    state.streams.front().size = known.front().size;
}

/// Hands out what the reader makes of what it has. May throw.
static GstFlowReturn read_items(GstAedatDemux* self) {
  State& state = self->priv->state;
  const auto places = state.reader.corruption().places;
  GstFlowReturn result = GST_FLOW_OK;
  while (result == GST_FLOW_OK) {
    const auto item = state.reader.next();
    learn_streams(self);
    seek_table(self);
    if (!item) break;
    if (state.reader.corruption().places != places)
      for (auto& stream : state.streams) stream.discontinuous = true;
    result = std::visit([self](const auto& content) { return take(self, content); }, *item);
    if (result != GST_FLOW_OK) break;
    if (!state.holding)
      result = catch_up(self);
    else if (is_zero_known(state))
      result = release(self);
  }
  report(self);
  return result;
}

GstFlowReturn take_bytes(GstAedatDemux* self, GstBuffer* bytes) {
  GstMapInfo map;
  if (!gst_buffer_map(bytes, &map, GST_MAP_READ)) {
    GST_ELEMENT_ERROR(self, RESOURCE, READ, ("The file cannot be read."), (nullptr));
    return GST_FLOW_ERROR;
  }
  const GstFlowReturn result = self->priv->faults.guard([&] {
    self->priv->state.reader.push({map.data, map.size});
    return read_items(self);
  });
  gst_buffer_unmap(bytes, &map);
  return result;
}

GstFlowReturn take_end(GstAedatDemux* self) {
  State& state = self->priv->state;
  state.reader.finish();
  GstFlowReturn result = read_items(self);
  for (auto& stream : state.streams) {
    if (!state.holding || stream.kind != Aedat4Kind::events) continue;
    stream.chunker.finish();
    stream.first = stream.chunker.first();
  }
  if (result == GST_FLOW_OK && state.holding) result = release(self);
  for (auto& stream : state.streams) {
    if (result != GST_FLOW_OK) break;
    if (stream.pad == nullptr || stream.kind != Aedat4Kind::events) continue;
    stream.chunker.finish();
    result = push_intervals(self, stream);
  }
  report(self);
  warn_of_missing_table(self);
  tell_counts(self);
  return result;
}

}  // namespace aedatdemux
