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
  npz,
  prophesee_dat,
  prophesee_raw,
};

struct Recognised {
  FileKind kind;
  int version = 0;      ///< of AEDAT
  bool certain = true;  ///< false: other kinds of files may begin like this, too

  friend constexpr bool operator==(const Recognised&, const Recognised&) = default;
};

/// At most this much of a file's beginning is examined.
constexpr std::size_t max_recognised_bytes = 16384;

/// The kind of a file that begins with these bytes; nothing where it is unknown, or where that
/// takes more bytes. More bytes do not turn it into another kind, unless it was text: what is text
/// so far may be none in the end.
///
/// `wanted` is the only kind that matters to the caller: other kinds may then be missed. It saves a
/// trial decode, which text takes to be recognised as CSV.
std::optional<Recognised> recognise(std::span<const std::uint8_t> start,
                                    std::optional<FileKind> wanted = std::nullopt);

}  // namespace eventcamera
