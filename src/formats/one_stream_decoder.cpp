// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/one_stream_decoder.hpp"

#include <algorithm>
#include <utility>

#include "src/formats/chunker.hpp"

namespace eventcamera {

/// Bytes decoded at once; the output stays in the cache, however large the pieces are.
constexpr std::size_t block_size = std::size_t{1} << 14;

std::optional<Item> OneStreamDecoder::next() {
  while (true) {
    if (std::exchange(triggers_due_, false) && !decoded_.triggers.empty())
      return TriggerItem{0, decoded_.triggers};
    if (std::exchange(events_due_, false) && !decoded_.events.empty())
      return EventItem{0, decoded_.events};
    decoded_.events.clear();
    decoded_.triggers.clear();
    if (!rest_.empty()) {
      const auto block = rest_.first(std::min(rest_.size(), block_size));
      rest_ = rest_.subspan(block.size());
      decoder_->decode(block, decoded_);
    } else if (std::exchange(finish_due_, false)) {
      decoder_->finish(decoded_);
    } else {
      return std::nullopt;
    }
    streams_.front().size = decoder_->size();
    streams_.front().mirrored = decoder_->is_mirrored();
    streams_.front().labelled = decoder_->has_labels();
    events_due_ = triggers_due_ = true;
  }
}

void OneStreamDecoder::restart(const SeekPoint& seek_point) {
  rest_ = {};
  finish_due_ = events_due_ = triggers_due_ = false;
  decoder_->restart(seek_point);
}

std::optional<Microseconds> OneStreamDecoder::last_time() {
  if (auto* const source = std::exchange(source_, nullptr); source != nullptr) {
    Decoded tail;
    decoder_->decode_tail(*source, tail);
    Chunker chunker(1);  // rejects erroneous times
    chunker.push(tail.events);
    chunker.finish();
    if (chunker.first()) last_time_ = chunker.latest();
  }
  return last_time_;
}

}  // namespace eventcamera
