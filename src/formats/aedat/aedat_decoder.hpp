// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/formats/decoder.hpp"

namespace eventcamera {

class Aedat4Decoder;

/// Decodes AEDAT 4, 3.1, 2.0 and 1.0, according to the first line of the file. The older versions
/// are read as a single stream of events (and triggers).
class AedatDecoder final : public Decoder {
 public:
  /// `assumed` is the sensor size to use if an AEDAT 2.0 file does not state it.
  explicit AedatDecoder(SensorSize assumed = {}) : assumed_(assumed) {}

  void push(std::span<const std::uint8_t> piece) override;
  void drain() override;
  bool open(ByteSource& source) override;
  std::optional<Item> next() override;
  const std::vector<StreamInfo>& streams() const override;
  const Corruption& corruption() const override;
  std::optional<SeekPoint> seek_point_before(Microseconds t) const override;
  void restart(const SeekPoint& seek_point) override;
  std::optional<Microseconds> last_time() override;
  std::optional<std::uint64_t> end_of(std::size_t stream, Microseconds t) const override;
  std::uint64_t position() const override;
  std::string format_name() const override;

  /// The AEDAT 4 decoder; null if the file is not AEDAT 4, or not yet known to be.
  const Aedat4Decoder* aedat4() const;

 private:
  bool find_version();

  const SensorSize assumed_;
  std::vector<std::uint8_t> start_;  ///< start of the file, collected until its version is known
  bool finished_ = false;
  ByteSource* source_ = nullptr;
  std::string version_;  ///< empty until known
  std::unique_ptr<Decoder> reader_;
};

}  // namespace eventcamera
