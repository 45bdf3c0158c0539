// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/aedatdemux/zero.hpp"

#include <algorithm>
#include <limits>
#include <mutex>
#include <optional>
#include <span>
#include <utility>

#include "elements/eventcam/aedatdemux/duration.hpp"
#include "elements/eventcam/aedatdemux/output.hpp"
#include "elements/eventcam/aedatdemux/pads.hpp"

namespace aedatdemux {

/// So much is held back at most, in bytes and in microseconds.
constexpr std::size_t max_held = std::size_t{1} << 24;
constexpr Microseconds max_hold = 1'000'000;

GstFlowReturn release(GstAedatDemux* self) {
  auto* priv = self->priv;
  State& state = priv->state;
  state.holding = false;
  std::optional<Microseconds> zero;
  for (const auto& stream : state.streams)
    if (stream.first) zero = std::min(zero.value_or(*stream.first), *stream.first);
  state.zero = zero.value_or(0);
  const GstClockTime duration = duration_of_file(self);
  {
    const std::lock_guard lock(priv->mutex);
    priv->segment.duration = duration;
    priv->shown = true;
  }
  auto held = std::exchange(state.held, {});
  for (const auto& item : held) {
    auto& video = state.streams[item.stream].video;
    if (item.frame.buffer && !video) video = item.frame.info;
  }
  bool any = false;
  for (std::size_t i = 0; i < state.streams.size(); ++i) {
    const Stream& stream = state.streams[i];
    const bool of_events =
        stream.kind == Aedat4Kind::events && (stream.first || stream.size != SensorSize{});
    if (!of_events && !stream.video) continue;
    make_pad(self, i);
    any = true;
  }
  if (!any) {
    GST_ELEMENT_ERROR(self, STREAM, DEMUX, ("The file has neither events nor frames."), (nullptr));
    return GST_FLOW_ERROR;
  }
  show_pads(self);
  gst_element_no_more_pads(GST_ELEMENT(self));
  GstFlowReturn result = GST_FLOW_OK;
  for (auto& item : held) {
    result = item.frame.buffer ? put_out(self, item.stream, std::move(item.frame))
                               : put_out(self, item.stream, item.events);
    if (result == GST_FLOW_OK) result = catch_up(self);
    if (result != GST_FLOW_OK) break;
  }
  return result;
}

/// Whether a stream's first time is still to come.
static bool is_awaited(const State& state, std::size_t index) {
  const Stream& stream = state.streams[index];
  if (!is_shown(stream.kind) || stream.first) return false;
  const int id = state.reader.streams()[index].id;
  return state.table.empty() ||
         std::any_of(state.table.begin(), state.table.end(),
                     [id](const Aedat4TableEntry& entry) { return entry.stream == id; });
}

bool is_zero_known(const State& state) {
  if (state.held.empty()) return false;
  if (state.held_bytes >= max_held) return true;
  bool awaited = false;
  auto first = std::numeric_limits<Microseconds>::max();
  auto last = std::numeric_limits<Microseconds>::min();
  for (std::size_t i = 0; i < state.streams.size(); ++i) {
    const Stream& stream = state.streams[i];
    awaited |= is_awaited(state, i);
    if (!stream.first) continue;
    first = std::min(first, *stream.first);
    last =
        std::max(last, stream.kind == Aedat4Kind::events ? stream.chunker.latest() : *stream.first);
  }
  return !awaited || (last > first && last - first >= max_hold);
}

void hold(State& state, std::size_t index, std::span<const AbsoluteEvent> events) {
  Stream& stream = state.streams[index];
  stream.used.include(events);
  // It tells which times are to be believed.
  stream.chunker.push(events);
  while (stream.chunker.next()) continue;
  stream.first = stream.chunker.first();
  state.held.push_back({index, {events.begin(), events.end()}, {}});
  state.held_bytes += sizeof(Held) + events.size_bytes();
}

void hold(State& state, std::size_t index, Frame frame) {
  Stream& stream = state.streams[index];
  stream.first = std::min(stream.first.value_or(frame.t), frame.t);
  state.held_bytes += sizeof(Held) + gst_buffer_get_size(frame.buffer.get());
  state.held.push_back({index, {}, std::move(frame)});
}

}  // namespace aedatdemux
