// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/unit_decoder.hpp"

#include <algorithm>
#include <utility>

namespace eventcamera {

UnitDecoder::UnitDecoder(std::unique_ptr<UnitReader> reader, SensorSize size) {
  begin(std::move(reader), size);
}

void UnitDecoder::begin(std::unique_ptr<UnitReader> reader, SensorSize size) {
  reader_ = std::move(reader);
  size_ = size;
}

std::size_t UnitDecoder::read_header(std::span<const std::uint8_t>, bool) {
  return 0;
}

/// Consumes the header, as far as it is there, from the front of rest_.
void UnitDecoder::read_headers(bool ended) {
  std::size_t taken = 0;
  while (!reader_) {
    const auto more = read_header(std::span(rest_).subspan(taken), ended);
    taken += more;
    if (more == 0) break;
  }
  rest_.erase(rest_.begin(), rest_.begin() + static_cast<std::ptrdiff_t>(taken));
  position_ += taken;
  units_begin_ = position_;
}

void UnitDecoder::decode(std::span<const std::uint8_t> bytes, Decoded& out) {
  if (!reader_) {
    rest_.insert(rest_.end(), bytes.begin(), bytes.end());
    read_headers(false);
    if (!reader_) return;
    bytes = {};
    const auto read = read_units(rest_, out);
    rest_.erase(rest_.begin(), rest_.begin() + static_cast<std::ptrdiff_t>(read));
  } else if (!rest_.empty()) {
    // Complete the unit that the last bytes began.
    const auto before = rest_.size();
    const auto more = std::min(bytes.size(), UnitReader::longest);
    rest_.insert(rest_.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(more));
    const auto read = read_units(rest_, out);
    if (read == 0) return;
    bytes = bytes.subspan(read - before);
    rest_.clear();
  }
  const auto left = bytes.subspan(read_units(bytes, out));
  rest_.insert(rest_.end(), left.begin(), left.end());
}

void UnitDecoder::finish(Decoded& out) {
  if (!reader_) {
    read_headers(true);
    if (!reader_) throw UnsupportedFormat("the file ends within its header");
    const auto read = read_units(rest_, out);
    rest_.erase(rest_.begin(), rest_.begin() + static_cast<std::ptrdiff_t>(read));
  }
  if (rest_.empty()) return;
  corruption_.note(position_, "the file ends within an event");
  rest_.clear();
}

void UnitDecoder::restart(const SeekPoint& seek_point) {
  rest_.clear();
  position_ = seek_point.position;
  latest_ = seek_point.t;
  reader_->restore({seek_point.clock, seek_point.state});
}

std::size_t UnitDecoder::read_units(std::span<const std::uint8_t> bytes, Decoded& out) {
  // Seek points are recorded between batches; silence must not make them rare.
  constexpr std::ptrdiff_t max_batch = 1 << 15;
  const auto* from = bytes.data();
  const auto* const to = from + bytes.size();
  batch_.triggers = &out.triggers;
  for (;;) {
    if (seek_points_.due(position_)) {
      const auto state = reader_->state();
      seek_points_.note({latest_, position_, state.clock, state.rest});
    }
    batch_.start = from;
    batch_.start_position = position_;
    batch_.end = batch_.begin();
    const auto* reached = reader_->read(from, from + std::min(to - from, max_batch), batch_);
    deliver(out);
    if (reached == from) return bytes.size() - static_cast<std::size_t>(to - from);
    position_ += static_cast<std::uint64_t>(reached - from);
    from = reached;
  }
}

void UnitDecoder::deliver(Decoded& out) {
  const std::span events(batch_.begin(), batch_.end);
  if (events.empty()) return;
  // Nearly all batches are sorted, which is cheaper to check than to compute running maxima.
  bool sorted = events.front().t >= latest_;
  for (std::size_t i = 1; i < events.size(); ++i) sorted &= events[i - 1].t <= events[i].t;
  if (sorted) {
    latest_ = events.back().t;
  } else {
    for (const auto& event : events) {
      corruption_.unsorted += static_cast<std::uint64_t>(event.t < latest_);
      latest_ = std::max(latest_, event.t);
    }
  }
  out.events.insert(out.events.end(), events.begin(), events.end());
}

}  // namespace eventcamera
