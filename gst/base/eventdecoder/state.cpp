// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/eventdecoder/state.hpp"

#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include "src/formats/decoder.hpp"

namespace eventdecoder {

using eventcamera::Decoder;

Microseconds interval_length(GstEventDecoder* self) {
  const std::lock_guard lock(self->priv->mutex);
  return static_cast<Microseconds>(self->priv->buffer_time / GST_USECOND);
}

bool is_timed(GstEventDecoder* self) {
  const std::lock_guard lock(self->priv->mutex);
  return self->priv->timed;
}

bool reads_files(GstEventDecoder* self) {
  return GST_EVENT_DECODER_GET_CLASS(self)->open != nullptr;
}

/// None where an EventFile is read.
static std::unique_ptr<Decoder> make_decoder(GstEventDecoder* self) {
  if (reads_files(self)) return nullptr;
  return GST_EVENT_DECODER_GET_CLASS(self)->create(self, self->priv->caps.get());
}

void begin(GstEventDecoder* self) {
  auto* priv = self->priv;
  auto decoder = make_decoder(self);
  const std::lock_guard lock(priv->decoding);
  priv->state.emplace(State{.decoder = std::move(decoder),
                            .file = nullptr,
                            .collected = {},
                            .chunker = Chunker(interval_length(self)),
                            .decoded = {},
                            .assumed = {},
                            .before = {},
                            .shift = {}});
}

void drop_held(GstEventDecoder* self) {
  for (GstEvent* event : self->priv->held) gst_event_unref(event);
  self->priv->held.clear();
}

void reset(GstEventDecoder* self) {
  auto* priv = self->priv;
  drop_held(self);
  gst_clear_event(&priv->stream_start);
  priv->caps.reset();
  priv->stream_started = false;
  priv->caps_sent = false;
  priv->segment_due = true;
  priv->seqnum = GST_SEQNUM_INVALID;
  priv->discontinuous = false;
  priv->faults.begin_anew();
  {
    const std::lock_guard lock(priv->decoding);
    priv->state.reset();
  }
  const std::lock_guard lock(priv->mutex);
  gst_segment_init(&priv->segment, GST_FORMAT_TIME);
  priv->first.reset();
  priv->duration = GST_CLOCK_TIME_NONE;
  priv->restart.reset();
  priv->timed = false;
  priv->pushed_bytes = 0;
  priv->counts = {};
}

void restart_at(GstEventDecoder* self, const Restart& restart) {
  auto* priv = self->priv;
  State& state = *priv->state;
  auto* seekable = dynamic_cast<Decoder*>(state.decoder.get());
  auto fresh = restart.seek_point && seekable != nullptr ? nullptr : make_decoder(self);
  const auto length = interval_length(self);
  const auto to = static_cast<Microseconds>(restart.segment.position / GST_USECOND);
  const std::lock_guard decoding(priv->decoding);
  if (state.file) {
    state.before = state.corruption();
    state.file->seek(priv->first.value_or(0) + to);
  } else if (fresh) {
    state.decoder = std::move(fresh);
    state.before = {};
    state.pulled = 0;
  } else {
    state.before = state.decoder->corruption();
    seekable->restart(*restart.seek_point);
    state.pulled = restart.seek_point->position;
  }
  const std::lock_guard lock(priv->mutex);
  state.chunker = priv->first ? Chunker(length, *priv->first + to) : Chunker(length);
  state.outside = 0;
  priv->counts = {};
  priv->segment = restart.segment;
  priv->seqnum = restart.seqnum;
  priv->segment_due = true;
  priv->discontinuous = true;
}

std::optional<SeekPoint> seek_point_before(GstEventDecoder* self, GstClockTime time) {
  auto* priv = self->priv;
  const std::lock_guard decoding(priv->decoding);
  if (!priv->state) return std::nullopt;
  const auto* seekable = dynamic_cast<const Decoder*>(priv->state->decoder.get());
  if (seekable == nullptr) return std::nullopt;
  const std::lock_guard lock(priv->mutex);
  return seekable->seek_point_before(priv->first.value_or(0) +
                                     static_cast<Microseconds>(time / GST_USECOND));
}

}  // namespace eventdecoder
