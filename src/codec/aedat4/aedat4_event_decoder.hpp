// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <optional>

#include "src/codec/aedat4/aedat4_decoder.hpp"
#include "src/codec/decoder.hpp"

namespace eventcamera {

/// Reads the first stream of events in AEDAT4, and every trigger.
class Aedat4EventDecoder final : public Decoder {
 public:
  void decode(std::span<const std::uint8_t> bytes, Decoded& out) override;
  void finish(Decoded& out) override;

 private:
  void drain(Decoded& out);
  void find_stream();

  Aedat4Decoder streams_;
  std::optional<std::size_t> stream_;  ///< the first one of events
};

}  // namespace eventcamera
