// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace eventcamera {

/// Kinds of files, each with its own reader.
enum class FileKind : std::uint8_t {
  aedat,
  atis_bin,
  csv,
  event_stream,
  hdf5,
  mcap,
  npy,
  npz,
  prophesee_dat,
  prophesee_raw,
  rosbag,
  rosbag2_db3,
};

struct Recognised {
  FileKind kind;
  int version = 0;      ///< AEDAT only
  bool certain = true;  ///< false: other kinds of files may start like this, too

  friend constexpr bool operator==(const Recognised&, const Recognised&) = default;
};

/// Maximum number of bytes examined at the start of a file.
constexpr std::size_t max_recognised_bytes = 16384;

/// Returns the kind of a file that starts with these bytes; nothing if it is unknown or more bytes
/// are needed. More bytes do not change the kind, except for text, which may turn out to be binary.
///
/// If `wanted` is set, other kinds may be missed. This saves the trial decode that recognises text
/// as CSV.
std::optional<Recognised> recognise(std::span<const std::uint8_t> start,
                                    std::optional<FileKind> wanted = std::nullopt);

}  // namespace eventcamera
