// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/sensor_size.hpp"
#include "src/formats/corruption.hpp"
#include "src/formats/unit_decoder.hpp"
#include "src/wire/rtp_payload.hpp"

namespace eventcamera {

/// Decodes payloads of RTP packets; rejects those that are not valid in every detail.
class RtpPayloadDecoder {
 public:
  RtpPayloadDecoder(SensorSize sensor, RtpEventFormat format);

  /// False if the payload is not valid, or of another sensor or format.
  bool decode(std::span<const std::uint8_t> payload);

  // Of the payload that was decoded last:
  const RtpPayloadHeader& header() const { return header_; }
  std::span<const Event> events() const { return events_; }

 private:
  bool decode_evt3(std::span<const std::uint8_t> words);
  bool decode_xytp(std::span<const std::uint8_t> body);
  bool take(std::uint64_t t, std::uint16_t x, std::uint16_t y_p);

  SensorSize sensor_;
  RtpEventFormat format_;
  std::unique_ptr<UnitDecoder> evt3_;
  Corruption corruption_;
  Decoded words_;  ///< with times of the words
  RtpPayloadHeader header_;
  std::vector<Event> events_;
};

}  // namespace eventcamera
