// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "src/core/sensor_size.hpp"
#include "src/formats/byte_source.hpp"
#include "src/formats/decoder.hpp"

namespace eventcamera {

/// Decodes AEDAT 4, 3.1, 2.0 and 1.0, according to the first line of the file. The older versions
/// are read as a single stream of events (and triggers).
class AedatDecoder final : public Decoder {
 public:
  /// `assumed` is the sensor size to use if an AEDAT 2.0 file does not state it.
  explicit AedatDecoder(SensorSize assumed = {}) : assumed_(assumed) {}

  void push(std::span<const std::uint8_t> piece) override {
    if (reader_)
      reader_->push(piece);
    else
      start_.insert(start_.end(), piece.begin(), piece.end());
  }

  void drain() override {
    finished_ = true;
    if (reader_) reader_->drain();
  }

  bool open(ByteSource& source) override {
    source_ = &source;
    return false;
  }

  std::optional<Item> next() override {
    return reader_ || find_version() ? reader_->next() : std::nullopt;
  }

  const std::vector<StreamInfo>& streams() const override {
    return reader_ ? reader_->streams() : no_streams_;
  }

  const Corruption& corruption() const override {
    return reader_ ? reader_->corruption() : no_corruption_;
  }

  std::optional<SeekPoint> seek_point_before(Microseconds t) const override {
    return reader_ ? reader_->seek_point_before(t) : std::nullopt;
  }

  void restart(const SeekPoint& seek_point) override { reader_->restart(seek_point); }

  std::optional<Microseconds> last_time() override {
    return reader_ ? reader_->last_time() : std::nullopt;
  }

  std::optional<std::uint64_t> end_of(std::size_t stream, Microseconds t) const override {
    return reader_ ? reader_->end_of(stream, t) : std::nullopt;
  }

  std::uint64_t position() const override { return reader_ ? reader_->position() : 0; }
  std::string format_name() const override { return "AEDAT " + version_; }

 private:
  bool find_version();

  const SensorSize assumed_;
  std::vector<std::uint8_t> start_;  ///< start of the file, collected until its version is known
  bool finished_ = false;
  ByteSource* source_ = nullptr;
  std::string version_;  ///< empty until known
  std::unique_ptr<Decoder> reader_;
  std::vector<StreamInfo> no_streams_;
  Corruption no_corruption_;
};

}  // namespace eventcamera
