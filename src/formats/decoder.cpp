// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/decoder.hpp"

#include <algorithm>
#include <utility>

#include "src/formats/chunker.hpp"

namespace eventcamera {

/// Bytes decoded at once; the output stays in the cache, however large the pieces are.
constexpr std::size_t block_size = std::size_t{1} << 14;

std::optional<Item> EventDecoder::next() {
  while (true) {
    if (std::exchange(triggers_due_, false) && !decoded_.triggers.empty())
      return TriggerItem{0, decoded_.triggers};
    if (std::exchange(events_due_, false) && !decoded_.events.empty())
      return EventItem{0, decoded_.events};
    decoded_.events.clear();
    decoded_.triggers.clear();
    if (!pushed_.empty()) {
      const auto block = pushed_.first(std::min(pushed_.size(), block_size));
      pushed_ = pushed_.subspan(block.size());
      decode(block, decoded_);
    } else if (std::exchange(is_draining_, false)) {
      finish(decoded_);
    } else {
      return std::nullopt;
    }
    events_due_ = triggers_due_ = true;
  }
}

void EventDecoder::restart(const SeekPoint& seek_point) {
  pushed_ = {};
  is_draining_ = events_due_ = triggers_due_ = false;
  restore(seek_point);
}

std::optional<Microseconds> EventDecoder::last_time() {
  if (auto* const source = std::exchange(source_, nullptr); source != nullptr) {
    Decoded tail;
    decode_tail(*source, tail);
    Chunker chunker(1);  // rejects erroneous times
    chunker.push(tail.events);
    chunker.finish();
    if (chunker.first()) last_time_ = chunker.latest();
  }
  return last_time_;
}

}  // namespace eventcamera
