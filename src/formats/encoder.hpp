// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "src/core/event.hpp"

namespace eventcamera {

/// Bytes that overwrite what was written at a position of the file.
struct FilePatch {
  std::uint64_t position;
  std::vector<std::uint8_t> bytes;
};

/// Writes one event format. Events come sorted by time and within the sensor, in pieces of any
/// size: how they are split does not change what a reader makes of the file.
class Encoder {
 public:
  virtual ~Encoder() = default;
  Encoder(const Encoder&) = delete;
  Encoder& operator=(const Encoder&) = delete;

  /// Appends the bytes of `events` to `out`, the header before the first.
  void encode(std::span<const AbsoluteEvent> events, std::vector<std::uint8_t>& out) {
    put_header(out);
    append(events, out);
  }

  /// Appends what ends the file; the header, too, if nothing was encoded.
  void finish(std::vector<std::uint8_t>& out) {
    put_header(out);
    append_end(out);
  }

  /// What to write into the header after finish(), where the file can be seeked in. Our readers do
  /// without it.
  virtual std::optional<FilePatch> patch() const { return std::nullopt; }

 protected:
  explicit Encoder(std::string header = {}) : header_(std::move(header)) {}

  virtual void append(std::span<const AbsoluteEvent> events, std::vector<std::uint8_t>& out) = 0;
  virtual void append_end(std::vector<std::uint8_t>& /*out*/) {}

 private:
  void put_header(std::vector<std::uint8_t>& out) {
    out.insert(out.end(), header_.begin(), header_.end());
    header_.clear();
  }

  std::string header_;  ///< empty once it is written
};

}  // namespace eventcamera
