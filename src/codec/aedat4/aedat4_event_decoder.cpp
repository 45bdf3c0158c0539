// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/codec/aedat4/aedat4_event_decoder.hpp"

namespace eventcamera {

void Aedat4EventDecoder::decode(std::span<const std::uint8_t> bytes, Decoded& out) {
  streams_.push(bytes);
  drain(out);
}

void Aedat4EventDecoder::finish(Decoded& out) {
  streams_.finish();
  drain(out);
}

void Aedat4EventDecoder::drain(Decoded& out) {
  while (const auto item = streams_.next()) {
    find_stream();
    if (const auto* const events = std::get_if<Aedat4Events>(&*item)) {
      if (events->stream == stream_)
        out.events.insert(out.events.end(), events->events.begin(), events->events.end());
    } else if (const auto* const triggers = std::get_if<Aedat4Triggers>(&*item)) {
      out.triggers.insert(out.triggers.end(), triggers->triggers.begin(), triggers->triggers.end());
    }
  }
  find_stream();
  damage_ = streams_.damage();
}

void Aedat4EventDecoder::find_stream() {
  const auto& streams = streams_.streams();
  for (std::size_t i = 0; i < streams.size() && !stream_; ++i) {
    if (streams[i].kind != Aedat4Kind::events) continue;
    stream_ = i;
    size_ = streams[i].size;
  }
}

}  // namespace eventcamera
