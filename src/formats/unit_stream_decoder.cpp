// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/unit_stream_decoder.hpp"

#include <algorithm>
#include <span>
#include <utility>

namespace eventcamera {

/// Uses four independent lanes, so that they do not wait for each other.
static Microseconds latest_of(std::span<const AbsoluteEvent> events) {
  Microseconds latest[4];
  std::ranges::fill(latest, std::numeric_limits<Microseconds>::min());
  std::size_t i = 0;
  for (; i + 4 <= events.size(); i += 4)
    for (std::size_t lane = 0; lane < 4; ++lane)
      latest[lane] = std::max(latest[lane], events[i + lane].t);
  for (; i < events.size(); ++i) latest[0] = std::max(latest[0], events[i].t);
  return std::ranges::max(latest);
}

/// Consumes the available part of the header from the front of rest_.
void UnitStreamDecoder::read_headers(bool ended) {
  std::size_t taken = 0;
  while (!decoder_) {
    const auto more = read_header(std::span(rest_).subspan(taken), ended);
    taken += more;
    if (more == 0) break;
  }
  rest_.erase(rest_.begin(), rest_.begin() + static_cast<std::ptrdiff_t>(taken));
  position_ += taken;
  units_begin_ = position_;
}

void UnitStreamDecoder::decode(std::span<const std::uint8_t> bytes, Decoded& out) {
  if (!decoder_) {
    rest_.insert(rest_.end(), bytes.begin(), bytes.end());
    read_headers(false);
    if (!decoder_) return;
    bytes = {};
    const auto read = read_units(rest_, out);
    rest_.erase(rest_.begin(), rest_.begin() + static_cast<std::ptrdiff_t>(read));
  } else if (!rest_.empty()) {
    // Complete the unit that the last bytes began.
    const auto before = rest_.size();
    const auto more = std::min(bytes.size(), UnitDecoder::max_size);
    rest_.insert(rest_.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(more));
    const auto read = read_units(rest_, out);
    if (read == 0) return;
    bytes = bytes.subspan(read - before);
    rest_.clear();
  }
  const auto left = bytes.subspan(read_units(bytes, out));
  rest_.insert(rest_.end(), left.begin(), left.end());
}

void UnitStreamDecoder::finish(Decoded& out) {
  if (!decoder_) {
    read_headers(true);
    if (!decoder_) throw UnsupportedFormat("the file ends within its header");
    const auto read = read_units(rest_, out);
    rest_.erase(rest_.begin(), rest_.begin() + static_cast<std::ptrdiff_t>(read));
  }
  if (rest_.empty()) return;
  corruption_.note(position_, "the file ends within an event");
  rest_.clear();
}

void UnitStreamDecoder::restore(const SeekPoint& seek_point) {
  rest_.clear();
  position_ = seek_point.position;
  latest_ = seek_point.t;
  decoder_->restore({seek_point.clock, seek_point.state});
}

std::size_t UnitStreamDecoder::read_units(std::span<const std::uint8_t> bytes, Decoded& out) {
  // Seek points are recorded between batches: a batch without events must end, too.
  constexpr std::size_t max_batch = 1 << 15;
  for (std::size_t at = 0;;) {
    if (seek_points_.due(position_)) {
      const auto state = decoder_->state();
      seek_points_.note({latest_, position_, state.clock, state.rest});
    }
    const auto events = out.events.size();
    const auto triggers = out.triggers.size();
    const auto few = bytes.subspan(at, std::min(bytes.size() - at, max_batch));
    const auto read = decoder_->decode(few, position_, batch_, out);
    latest_ = std::max(latest_, latest_of(std::span(out.events).subspan(events)));
    for (const auto& trigger : std::span(out.triggers).subspan(triggers))
      latest_ = std::max(latest_, trigger.t);
    if (read == 0) return at;
    at += read;
    position_ += read;
  }
}

}  // namespace eventcamera
