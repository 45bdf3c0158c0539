// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/recording_input.hpp"

namespace eventcamera {

void RecordingInput::push(std::span<const std::uint8_t> bytes) {
  const auto guard = lock();
  decoder_->push(bytes);
  position_ += bytes.size();
  is_finished_ = false;
}

void RecordingInput::finish() {
  const auto guard = lock();
  decoder_->drain();
  is_finished_ = true;
}

std::optional<Item> RecordingInput::decode() {
  const auto guard = lock();
  return decoder_->next();
}

std::optional<Item> RecordingInput::next() {
  if (is_replaying_)
    if (const auto item = held_.next()) return item;
  while (true) {
    if (const auto item = decode()) return item;
    if (source_ == nullptr || is_finished_) return std::nullopt;
    if (reads_itself_) {
      is_finished_ = !source_->failed();
      return std::nullopt;
    }
    const auto piece = source_->piece(position_);
    if (!piece) return std::nullopt;
    if (piece->empty())
      finish();
    else
      push(*piece);
  }
}

void RecordingInput::discard() {
  while (decode()) continue;
}

void RecordingInput::restart(const std::optional<SeekPoint>& seek_point) {
  const auto guard = lock();
  if (seek_point) {
    decoder_->restart(*seek_point);
  } else {
    decoder_ = make_decoder_();
    if (source_ != nullptr) reads_itself_ = decoder_->open(*source_);
  }
  position_ = seek_point ? seek_point->position : 0;
  is_finished_ = false;
  held_.clear();
  is_replaying_ = false;
}

std::optional<SeekPoint> RecordingInput::seek_point_before(Microseconds t) const {
  const auto guard = lock();
  return decoder_->seek_point_before(t);
}

}  // namespace eventcamera
