// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace eventcamera {

/// A kind of file, each with a reader of its own.
enum class FileKind : std::uint8_t {
  aedat,
  csv,
  event_stream,
  hdf5,
  npy,
  prophesee_dat,
  prophesee_raw,
};

/// What a file seems to be.
struct Recognised {
  FileKind kind;
  int version = 0;      ///< of AEDAT
  bool certain = true;  ///< else another kind of file may well begin like this, too

  friend constexpr bool operator==(const Recognised&, const Recognised&) = default;
};

/// More bytes of a file's beginning than these are not looked at.
constexpr std::size_t max_recognised_bytes = 16384;

/// What a file that begins with these bytes is; nothing where it is none that we read, or where
/// that takes more bytes. More bytes do not make another kind of it, unless it was text: what is
/// text so far may be none in the end.
std::optional<Recognised> recognise(std::span<const std::uint8_t> start);

}  // namespace eventcamera
