// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "src/formats/decoder.hpp"
#include "src/formats/recording_decoder.hpp"

namespace eventcamera {

/// A recording with a single stream of events (and triggers), on top of the decoder of its format.
class OneStreamDecoder final : public RecordingDecoder {
 public:
  explicit OneStreamDecoder(std::unique_ptr<Decoder> decoder) : decoder_(std::move(decoder)) {
    streams_.front().size = decoder_->size();
  }

  void push(std::span<const std::uint8_t> piece) override { rest_ = piece; }
  void finish() override { finish_due_ = true; }
  bool open(ByteSource& source) override {
    source_ = &source;
    return false;
  }
  std::optional<Item> next() override;
  const std::vector<StreamInfo>& streams() const override { return streams_; }
  const Corruption& corruption() const override { return decoder_->corruption(); }
  std::optional<SeekPoint> seek_point_before(Microseconds t) const override {
    return decoder_->seek_point_before(t);
  }
  void restart(const SeekPoint& seek_point) override;
  std::optional<Microseconds> last_time() override;

 private:
  std::unique_ptr<Decoder> decoder_;
  ByteSource* source_ = nullptr;           ///< null in push mode, and once the last time is known
  std::optional<Microseconds> last_time_;  ///< if the decoder can find it
  std::vector<StreamInfo> streams_{{.id = 0, .kind = StreamKind::events, .size = {}, .source = {}}};
  std::span<const std::uint8_t> rest_;
  bool finish_due_ = false;
  Decoded decoded_;
  bool events_due_ = false;  ///< events in decoded_ are to be returned
  bool triggers_due_ = false;
};

}  // namespace eventcamera
