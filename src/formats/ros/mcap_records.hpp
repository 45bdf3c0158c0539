// SPDX-License-Identifier: LGPL-2.1-or-later
// Layout of MCAP files, version 0: mcap.dev/spec.
#pragma once

#include <cstddef>
#include <cstdint>

namespace eventcamera {

/// First byte of a record. Its size, 64 bits, and its content follow.
enum class McapOpcode : std::uint8_t {
  header = 0x01,
  footer = 0x02,
  schema = 0x03,
  channel = 0x04,
  message = 0x05,
  chunk = 0x06,
  message_index = 0x07,
  chunk_index = 0x08,
  statistics = 0x0b,
  summary_offset = 0x0e,
  data_end = 0x0f,
};

/// Size of opcode and size.
inline constexpr std::size_t mcap_record_header = 9;

/// Size of a message before its data: channel, sequence number, and the times of recording and
/// publication.
inline constexpr std::size_t mcap_message_header = 22;

/// Size of the footer's content.
inline constexpr std::size_t mcap_footer = 20;

}  // namespace eventcamera
