// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/eventdecoder/event_file.hpp"

#include <exception>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <stdexcept>
#include <utility>

#include "gst/base/eventdecoder/duration.hpp"
#include "gst/base/eventdecoder/intervals.hpp"
#include "gst/base/eventdecoder/state.hpp"
#include "gst/base/pad_bytes.hpp"
#include "src/formats/memory_bytes.hpp"

namespace eventdecoder {

/// Read at once.
constexpr std::size_t read_events = 1 << 14;
/// Read ahead where the file does not tell the sensor's size.
constexpr std::size_t scanned_events = std::size_t{1} << 22;
/// Of a file that is pushed, in bytes.
constexpr std::size_t max_collected = std::size_t{1} << 28;

void collect(GstEventDecoder* self, std::span<const guint8> bytes) {
  auto& collected = self->priv->state->collected;
  if (bytes.size() > max_collected - collected.size())
    throw std::runtime_error("a file this large has to be pulled, as from filesrc");
  self->priv->state->consumed = true;
  collected.insert(collected.end(), bytes.begin(), bytes.end());
}

/// Runs what reads a file. Where its bytes could not be pulled, that is the result, whatever else
/// it led to.
template <class Work>
static GstFlowReturn while_readable(GstEventDecoder* self, const Work& work) {
  GstFlowReturn& unread = self->priv->state->unread;
  unread = GST_FLOW_OK;
  try {
    const GstFlowReturn result = work();
    return unread == GST_FLOW_OK ? result : unread;
  } catch (const std::exception&) {
    if (unread == GST_FLOW_OK || unread == GST_FLOW_EOS) throw;
    return unread;
  }
}

/// Reads some events of an open file. GST_FLOW_EOS at its end. May throw.
static GstFlowReturn read_file(GstEventDecoder* self) {
  return while_readable(self, [&] {
    State& state = *self->priv->state;
    const auto count = state.file->read(read_events, state.decoded.events);
    state.file->read_triggers(read_events, state.decoded.triggers);
    return count > 0 ? GST_FLOW_OK : GST_FLOW_EOS;
  });
}

/// Reads an open file's beginning, for the time of its first event, and the size of the sensor
/// where the file does not tell it. May throw.
static GstFlowReturn read_ahead(GstEventDecoder* self) {
  State& state = *self->priv->state;
  GstFlowReturn result = GST_FLOW_OK;
  std::size_t count = 0;
  const auto is_known = [&] {
    return state.chunker.first() && (state.told_size().width > 0 || count >= scanned_events);
  };
  while (result == GST_FLOW_OK && !is_known()) {
    result = read_file(self);
    count += state.decoded.events.size();
    slice(self, nullptr);
    if (result == GST_FLOW_EOS) state.chunker.finish();
    while (state.chunker.next()) continue;
  }
  return result;
}

GstFlowReturn read_collected(GstEventDecoder* self) {
  State& state = *self->priv->state;
  state.file = GST_EVENT_DECODER_GET_CLASS(self)->open(
      std::make_unique<eventcamera::MemoryBytes>(std::move(state.collected)));
  read_ahead(self);
  state.file->seek(std::numeric_limits<Microseconds>::min());
  state.chunker = Chunker(interval_length(self));
  state.before = state.corruption();
  GstFlowReturn result = GST_FLOW_OK;
  while (result == GST_FLOW_OK) {
    result = read_file(self);
    if (result != GST_FLOW_OK) break;
    slice(self, nullptr);
    result = hand_out(self);
  }
  return result == GST_FLOW_EOS ? GST_FLOW_OK : result;
}

GstFlowReturn scan_file(GstEventDecoder* self) {
  auto* priv = self->priv;
  State& state = *priv->state;
  // It may have been begun before, and interrupted by a flush.
  state.decoded = {};
  state.chunker = Chunker(interval_length(self));
  GstFlowReturn result = while_readable(self, [&] {
    state.file = GST_EVENT_DECODER_GET_CLASS(self)->open(
        std::make_unique<PadBytes>(priv->sink, state.unread));
    return GST_FLOW_OK;
  });
  if (result == GST_FLOW_OK) result = read_ahead(self);
  if (result != GST_FLOW_OK && result != GST_FLOW_EOS) return result;
  std::optional<EventFile::TimeRange> range;
  result = while_readable(self, [&] {
    range = state.file->time_range();
    return GST_FLOW_OK;
  });
  if (result != GST_FLOW_OK && result != GST_FLOW_EOS) return result;
  Restart beginning;
  std::optional<Microseconds> length;
  {
    const std::lock_guard lock(priv->mutex);
    priv->first = state.chunker.first();
    beginning.segment = priv->segment;
    beginning.seqnum = priv->seqnum;
    if (range && priv->first && range->last >= *priv->first && range->last < Chunker::max_time)
      length = range->last + 1 - *priv->first;
  }
  if (length || !range)
    set_duration(self, static_cast<GstClockTime>(length.value_or(0)) * GST_USECOND);
  result = while_readable(self, [&] {
    restart_at(self, beginning);
    return GST_FLOW_OK;
  });
  if (result == GST_FLOW_EOS) result = GST_FLOW_OK;  // it shows again where it is read
  state.scanned = result == GST_FLOW_OK;
  return result;
}

GstFlowReturn pull_events(GstEventDecoder* self) {
  return self->priv->faults.guard([&] {
    State& state = *self->priv->state;
    const GstFlowReturn result = read_file(self);
    state.at_end = result == GST_FLOW_EOS;
    if (result != GST_FLOW_OK) return result;
    slice(self, nullptr);
    return hand_out(self);
  });
}

}  // namespace eventdecoder
