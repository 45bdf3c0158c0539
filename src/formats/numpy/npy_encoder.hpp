// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "src/formats/encoder.hpp"

namespace eventcamera {

/// Encodes NumPy files: a structured array of x, y (uint16), t (int64, microseconds) and p (uint8,
/// 1 = ON). The header contains the number of events; until patch() is applied, an impossibly large
/// one: NpyDecoder then reads to the end, and numpy.load() fails rather than return too few events.
class NpyEncoder final : public Encoder {
 public:
  static constexpr std::size_t event_bytes = 13;

  NpyEncoder();

  std::optional<FilePatch> patch() const override;

 private:
  void append(std::span<const AbsoluteEvent> events, std::vector<std::uint8_t>& out) override;

  std::uint64_t count_ = 0;
};

}  // namespace eventcamera
