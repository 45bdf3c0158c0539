// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/label.hpp"

namespace eventcamera {

/// Bytes to overwrite at a position in the file.
struct FilePatch {
  std::uint64_t position;
  std::vector<std::uint8_t> bytes;
};

/// Encodes one event format. Events must be sorted by time and within the sensor, in pieces of any
/// size; the split does not affect what a reader gets.
class Encoder {
 public:
  virtual ~Encoder() = default;
  Encoder(const Encoder&) = delete;
  Encoder& operator=(const Encoder&) = delete;

  /// Appends the encoded `events` to `out`, preceded by the header on the first call.
  void encode(std::span<const AbsoluteEvent> events, std::vector<std::uint8_t>& out) {
    put_header(out);
    append(events, out);
  }

  /// Labels the next events, one for each, or none. Returns the number of labels that the format
  /// stores.
  virtual std::size_t label(std::span<const Label> /*labels*/) { return 0; }

  /// Appends an encoded trigger, which must not precede anything written. False if the format has
  /// no triggers, or none of this input.
  bool encode_trigger(const Trigger& trigger, std::vector<std::uint8_t>& out) {
    put_header(out);
    return append_trigger(trigger, out);
  }

  /// Appends the end of the file, or the next piece of a long one, preceded by the header if
  /// nothing was encoded. True if more pieces follow.
  bool finish(std::vector<std::uint8_t>& out) {
    put_header(out);
    return append_end(out);
  }

  /// Number of encoded events that only finish() writes.
  virtual std::uint64_t pending() const { return 0; }

  /// Total pauses between events, in microseconds, that were removed because the format does not
  /// support them.
  virtual std::uint64_t removed_time() const { return 0; }

  /// Patch for the header, to be written after finish() if the output is seekable. This project's
  /// readers do not need it.
  virtual std::optional<FilePatch> patch() const { return std::nullopt; }

 protected:
  explicit Encoder(std::string header = {}) : header_(std::move(header)) {}

  virtual void append(std::span<const AbsoluteEvent> events, std::vector<std::uint8_t>& out) = 0;
  virtual bool append_trigger(const Trigger& /*trigger*/, std::vector<std::uint8_t>& /*out*/) {
    return false;
  }
  virtual bool append_end(std::vector<std::uint8_t>& /*out*/) { return false; }

 private:
  void put_header(std::vector<std::uint8_t>& out) {
    out.insert(out.end(), header_.begin(), header_.end());
    header_.clear();
  }

  std::string header_;  ///< empty once written
};

}  // namespace eventcamera
