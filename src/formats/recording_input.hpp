// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <utility>

#include "src/formats/decoder.hpp"
#include "src/formats/held_items.hpp"

namespace eventcamera {

/// Items of a recording, decoded from bytes that are pushed or pulled. Those that were read ahead
/// can be held and read again.
class RecordingInput {
 public:
  /// Creates a decoder of the file, positioned at its start. May throw.
  using MakeDecoder = std::function<std::unique_ptr<Decoder>()>;

  explicit RecordingInput(MakeDecoder make_decoder)
      : make_decoder_(std::move(make_decoder)), decoder_(make_decoder_()) {}

  /// Pull mode: sets the source of bytes, which must outlive this object. Call restart() next.
  void open(ByteSource& source) { source_ = &source; }
  bool is_pulling() const { return source_ != nullptr; }

  /// Adds bytes, which must stay valid until next() returns nothing.
  void push(std::span<const std::uint8_t> bytes);

  /// Declares the end of the bytes.
  void finish();
  bool is_finished() const { return is_finished_; }

  /// Further bytes may follow the end.
  void expect_more() { is_finished_ = false; }

  /// Returns the next item, valid until the next call. Nothing if more bytes are needed, if bytes
  /// cannot be read, and after the end. May throw.
  std::optional<Item> next();

  /// Drops the items of all bytes so far.
  void discard();

  /// Keeps a copy of an item until restart().
  void hold(const Item& item) { held_.push(item); }

  /// Size of the held items in memory, in bytes.
  std::size_t held_size() const { return held_.size(); }

  /// The next items are the held ones.
  void replay() { is_replaying_ = true; }

  /// Continues at a seek point, or with a new decoder at the start of the file.
  void restart(const std::optional<SeekPoint>& seek_point);

  /// As Decoder::seek_point_before(). May be called from any thread.
  std::optional<SeekPoint> seek_point_before(Microseconds t) const;

  /// True if all items before this position in the file were returned.
  bool has_passed(std::uint64_t position) const {
    return held_.size() == 0 && decoder_->position() >= position;
  }

  Decoder& decoder() { return *decoder_; }
  const Decoder& decoder() const { return *decoder_; }

  /// Pull mode: the source of bytes.
  ByteSource& source() const { return *source_; }

  /// Pull mode: true if the decoder reads from the source.
  bool reads_itself() const { return reads_itself_; }

  /// Offset of the next byte to push or pull, unless the decoder reads itself.
  std::uint64_t position() const { return position_; }

 private:
  std::unique_lock<std::mutex> lock() const { return std::unique_lock(mutex_); }
  std::optional<Item> decode();

  MakeDecoder make_decoder_;
  mutable std::mutex mutex_;  ///< guards decoder_ against seek_point_before()
  std::unique_ptr<Decoder> decoder_;

  ByteSource* source_ = nullptr;
  bool reads_itself_ = false;
  std::uint64_t position_ = 0;
  bool is_finished_ = false;

  HeldItems held_;
  bool is_replaying_ = false;
};

}  // namespace eventcamera
