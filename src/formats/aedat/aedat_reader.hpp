// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/formats/reader.hpp"

namespace eventcamera {

class Aedat4Decoder;

/// Reads AEDAT 4, 3.1 and 2.0, as the first line of the file says. The older ones are read as one
/// stream of events, and triggers.
class AedatReader final : public Reader {
 public:
  void push(std::span<const std::uint8_t> piece) override;
  void finish() override;
  bool open(ByteSource& source) override;
  std::optional<Item> next() override;
  const std::vector<StreamInfo>& streams() const override;
  const Corruption& corruption() const override;
  std::optional<SeekPoint> seek_point_before(Microseconds t) const override;
  void restart(const SeekPoint& seek_point) override;
  std::optional<Microseconds> last_time() override;
  bool is_empty(std::size_t stream) const override;
  std::string format_name() const override;
  std::uint64_t imu_samples() const override;

  /// What reads AEDAT 4; nothing where the file is not AEDAT 4, or not known to be.
  const Aedat4Decoder* aedat4() const;

 private:
  bool find_version();

  std::vector<std::uint8_t> start_;  ///< of the file: the pieces until its version is known
  bool finished_ = false;
  ByteSource* source_ = nullptr;
  std::string version_;  ///< empty before it is known
  std::unique_ptr<Reader> reader_;
};

}  // namespace eventcamera
