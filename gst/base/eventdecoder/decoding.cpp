// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/eventdecoder/decoding.hpp"

#include <algorithm>
#include <mutex>
#include <span>

#include "gst/base/eventdecoder/duration.hpp"
#include "gst/base/eventdecoder/intervals.hpp"
#include "gst/base/eventdecoder/state.hpp"
#include "gst/base/pulling.hpp"

namespace eventdecoder {

/// Decoded at once, so that events stay in the cache and no buffer makes too many.
constexpr std::size_t decoded_bytes = 1 << 16;
/// Read ahead for the duration.
constexpr guint64 scanned_bytes = 1 << 24;

/// Decodes a few bytes.
static void decode(GstEventDecoder* self, std::span<const guint8> bytes) {
  State& state = *self->priv->state;
  const std::lock_guard lock(self->priv->decoding);
  state.consumed = true;
  state.decoder->decode(bytes, state.decoded);
}

GstFlowReturn take_bytes(GstEventDecoder* self, std::span<const guint8> bytes, GstBuffer* buffer) {
  GstFlowReturn result = GST_FLOW_OK;
  while (!bytes.empty() && result == GST_FLOW_OK) {
    const auto few = bytes.first(std::min(bytes.size(), decoded_bytes));
    bytes = bytes.subspan(few.size());
    decode(self, few);
    slice(self, buffer);
    result = hand_out(self);
  }
  return result;
}

void finish_decoder(GstEventDecoder* self) {
  State& state = *self->priv->state;
  const std::lock_guard lock(self->priv->decoding);
  if (state.decoder) state.decoder->finish(state.decoded);
}

/// GST_FLOW_EOS at the end of the file.
template <class Take>
static GstFlowReturn pull_piece(GstEventDecoder* self, const Take& take) {
  State& state = *self->priv->state;
  GstBuffer* piece = nullptr;
  GstFlowReturn result = gst_pad_pull_range(self->priv->sink, state.pulled, pulled_piece, &piece);
  state.at_end = result == GST_FLOW_EOS;
  if (result != GST_FLOW_OK) return result;
  GstMapInfo map;
  if (!gst_buffer_map(piece, &map, GST_MAP_READ)) {
    gst_buffer_unref(piece);
    GST_ELEMENT_ERROR(self, RESOURCE, READ, ("The file cannot be read."), (nullptr));
    return GST_FLOW_ERROR;
  }
  result =
      self->priv->faults.guard([&] { return take(std::span<const guint8>(map.data, map.size)); });
  const gsize size = map.size;
  gst_buffer_unmap(piece, &map);
  gst_buffer_unref(piece);
  state.pulled += size;
  return result;
}

GstFlowReturn scan(GstEventDecoder* self) {
  auto* priv = self->priv;
  State& state = *priv->state;
  const auto drop = [&] {
    slice(self, nullptr);
    while (state.chunker.next()) continue;
    return GST_FLOW_OK;
  };
  GstFlowReturn result = GST_FLOW_OK;
  while (result == GST_FLOW_OK && state.pulled < scanned_bytes)
    result = pull_piece(self, [&](std::span<const guint8> bytes) {
      for (; !bytes.empty(); bytes = bytes.subspan(std::min(bytes.size(), decoded_bytes))) {
        decode(self, bytes.first(std::min(bytes.size(), decoded_bytes)));
        drop();
      }
      return GST_FLOW_OK;
    });
  const bool whole = result == GST_FLOW_EOS;
  if (result != GST_FLOW_OK && !whole) return result;
  return priv->faults.guard([&] {
    if (whole) {
      finish_decoder(self);
      drop();
      state.chunker.finish();
    }
    Restart beginning;
    {
      const std::lock_guard lock(priv->mutex);
      priv->first = state.chunker.first();
      beginning.segment = priv->segment;
      beginning.seqnum = priv->seqnum;
    }
    GstClockTime duration = duration_so_far(self);
    if (!GST_CLOCK_TIME_IS_VALID(duration)) duration = 0;
    const guint64 size = whole ? 0 : upstream_bytes(priv->sink);
    if (size > 0) duration = gst_util_uint64_scale(duration, size, state.pulled);
    set_duration(self, duration);
    beginning.seek_point = seek_point_before(self, beginning.segment.position);
    restart_at(self, beginning);
    state.scanned = true;
    return GST_FLOW_OK;
  });
}

GstFlowReturn pull_bytes(GstEventDecoder* self) {
  return pull_piece(
      self, [&](std::span<const guint8> bytes) { return take_bytes(self, bytes, nullptr); });
}

}  // namespace eventdecoder
