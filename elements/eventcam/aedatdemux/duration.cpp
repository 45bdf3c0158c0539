// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/aedatdemux/duration.hpp"

#include <algorithm>
#include <limits>
#include <mutex>
#include <span>
#include <utility>
#include <variant>
#include <vector>

#include "elements/eventcam/aedatdemux/state.hpp"
#include "gst/base/owned.hpp"
#include "gst/base/pulling.hpp"
#include "src/formats/aedat/aedat_reader.hpp"

namespace aedatdemux {

using eventcamera::Aedat4Events;
using eventcamera::Aedat4Picture;
using eventcamera::Aedat4Triggers;

/// Read ahead where there is no table.
constexpr guint64 scanned_bytes = guint64{1} << 24;

/// Until after the last event or frame that the table has.
static GstClockTime duration_by_table(const State& state) {
  Microseconds end = state.zero;
  const auto& streams = state.reader.streams();
  for (const auto& entry : state.table) {
    const auto stream =
        std::find_if(streams.begin(), streams.end(),
                     [&](const eventcamera::Aedat4Stream& s) { return s.id == entry.stream; });
    if (stream != streams.end() && is_shown(stream->kind) && entry.end < Chunker::max_time)
      end = std::max(end, entry.end + 1);
  }
  return static_cast<GstClockTime>(end - state.zero) * GST_USECOND;
}

namespace {

/// The greatest time of what a reader is given, as far as it is to be believed.
class LatestTime {
 public:
  explicit LatestTime(Microseconds interval) : interval_(interval) {}

  void take(const Aedat4Events& item) {
    while (chunkers_.size() <= item.stream) chunkers_.emplace_back(interval_);
    Chunker& chunker = chunkers_[item.stream];
    chunker.push(item.events);
    note(chunker);
  }

  void take(const Aedat4Picture& item) {
    if (item.frame.t <= Chunker::max_time) latest_ = std::max(latest_, item.frame.t);
  }

  void take(const Aedat4Triggers& /*item*/) {}

  Microseconds finish() {
    for (auto& chunker : chunkers_) {
      chunker.finish();
      note(chunker);
    }
    return latest_;
  }

 private:
  void note(Chunker& chunker) {
    while (chunker.next()) continue;
    if (chunker.first()) latest_ = std::max(latest_, chunker.latest());
  }

  Microseconds interval_;
  Microseconds latest_ = std::numeric_limits<Microseconds>::min();
  std::vector<Chunker> chunkers_;  ///< a stream each
};

}  // namespace

/// Reads a file without a table ahead, all of most, for its duration. May throw.
static GstClockTime duration_by_reading(GstAedatDemux* self) {
  State& state = self->priv->state;
  const guint64 size = upstream_bytes(self->priv->sink);
  if (size == 0) return GST_CLOCK_TIME_NONE;
  AedatReader reader;
  LatestTime latest(interval_length(self));
  const auto take_all = [&] {
    while (const auto item = reader.next())
      std::visit([&](const auto& content) { latest.take(content); }, *item);
  };
  std::vector<guint8> bytes(pulled_piece);
  guint64 position = 0;
  GstFlowReturn result = GST_FLOW_OK;
  while (result == GST_FLOW_OK && position < scanned_bytes) {
    GstBuffer* piece = nullptr;
    result = gst_pad_pull_range(self->priv->sink, position, pulled_piece, &piece);
    if (result != GST_FLOW_OK) break;
    const OwnedBuffer owner(piece);
    const gsize count = gst_buffer_extract(piece, 0, bytes.data(), bytes.size());
    reader.push(std::span(bytes).first(count));
    position += count;
    take_all();
  }
  if (result != GST_FLOW_OK && result != GST_FLOW_EOS) return GST_CLOCK_TIME_NONE;
  if (result == GST_FLOW_EOS) {
    reader.finish();
    take_all();
  }
  const Microseconds end = latest.finish();
  if (end < state.zero) return GST_CLOCK_TIME_NONE;
  const auto duration = static_cast<GstClockTime>(end + 1 - state.zero) * GST_USECOND;
  state.duration_estimated = result != GST_FLOW_EOS;
  return state.duration_estimated ? gst_util_uint64_scale(duration, size, position) : duration;
}

GstClockTime duration_of_file(GstAedatDemux* self) {
  if (!self->priv->state.table.empty()) return duration_by_table(self->priv->state);
  {
    const std::lock_guard lock(self->priv->mutex);
    if (!self->priv->pulls) return GST_CLOCK_TIME_NONE;
  }
  return duration_by_reading(self);
}

void learn_duration(GstAedatDemux* self) {
  {
    const std::lock_guard lock(self->priv->mutex);
    auto& segment = self->priv->segment;
    const bool known = GST_CLOCK_TIME_IS_VALID(segment.duration) &&
                       !std::exchange(self->priv->state.duration_estimated, false);
    if (known || GST_CLOCK_TIME_IS_VALID(segment.stop)) return;
    segment.duration = self->priv->state.newest;
  }
  gst_element_post_message(GST_ELEMENT(self), gst_message_new_duration_changed(GST_OBJECT(self)));
}

}  // namespace aedatdemux
