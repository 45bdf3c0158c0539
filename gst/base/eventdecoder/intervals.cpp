// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/eventdecoder/intervals.hpp"

#include <algorithm>
#include <mutex>

#include "gst/base/eventdecoder/output.hpp"
#include "gst/base/eventdecoder/state.hpp"
#include "gst/base/eventdecoder/statistics.hpp"

namespace eventdecoder {

/// EVT3's clock, the shortest of all, begins anew after this time, and so do the others'.
constexpr Microseconds clock_range = Microseconds{1} << 24;

/// Leaves out what lies outside of a size that the decoder does not know.
static void keep_to_size(State& state) {
  auto& events = state.decoded.events;
  if (state.told_size().width > 0) return;
  if (state.assumed)
    state.outside += eventcamera::erase_outside(events, *state.assumed);
  else
    state.used.include(events);
}

/// Moves the clock of words to that of the buffer that they come in. Where the clocks differ only
/// by what the words' is cut short by, no microsecond is lost.
static void set_shift(State& state, Microseconds first, GstBuffer* buffer) {
  const auto start = static_cast<Microseconds>(GST_BUFFER_PTS(buffer) / GST_USECOND);
  const auto length = GST_BUFFER_DURATION_IS_VALID(buffer)
                          ? static_cast<Microseconds>(GST_BUFFER_DURATION(buffer) / GST_USECOND)
                          : 0;
  const auto into = ((first - start) % clock_range + clock_range) % clock_range;
  state.shift = start + (into <= length ? into : 0) - first;
}

void slice(GstEventDecoder* self, GstBuffer* buffer) {
  State& state = *self->priv->state;
  keep_to_size(state);
  if (self->priv->timed && !state.shift && buffer != nullptr && GST_BUFFER_PTS_IS_VALID(buffer) &&
      !state.decoded.events.empty())
    set_shift(state,
              std::clamp(state.decoded.events.front().t, -Chunker::max_time, Chunker::max_time),
              buffer);
  state.chunker.push(state.decoded.events);
  state.decoded.events.clear();
  if (!state.decoded.triggers.empty()) {
    const std::lock_guard lock(self->priv->mutex);
    self->priv->counts.triggers += state.decoded.triggers.size();
    state.decoded.triggers.clear();
  }
}

GstFlowReturn hand_out(GstEventDecoder* self) {
  GstFlowReturn result = GST_FLOW_OK;
  while (result == GST_FLOW_OK) {
    const auto interval = self->priv->state->chunker.next();
    if (!interval) break;
    result = push_interval(self, *interval);
  }
  report(self);
  return result;
}

void forget_times(GstEventDecoder* self) {
  State& state = *self->priv->state;
  state.chunker = Chunker(interval_length(self));
  state.shift.reset();
  state.decoded = {};
  state.consumed = false;
  state.stopped = GST_FLOW_OK;
}

}  // namespace eventdecoder
