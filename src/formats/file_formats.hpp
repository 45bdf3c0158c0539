// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace eventcamera {

/// How likely a file has a format, by its first bytes.
enum class Likelihood : std::uint8_t {
  none,
  possible,  ///< any content may precede the signature
  high,      ///< other files may start like this
  certain,
};

/// A format of event files: a row of the table that typefinders are registered from, and that
/// readers and writers take their extensions from.
struct FileFormat {
  const char* media_type;
  /// Extensions, separated by commas.
  const char* extensions;
  /// Extensions that select the writer, separated by semicolons, each followed by properties to
  /// set: "csv; txt format=rpg". Empty if the format is only read.
  const char* written = "";
  /// First bytes of every file.
  std::string_view magic = {};
  /// Examines the content further, if set; `magic` was found.
  Likelihood (*match)(std::span<const std::uint8_t> start) = nullptr;
  /// Returns the field `version` of the caps, if they have one.
  int (*version)(std::span<const std::uint8_t> start) = nullptr;
  /// False if only the structure of the content identifies the format: other formats are tried
  /// first, and the extension alone does not suffice.
  bool has_signature = true;
};

std::span<const FileFormat> file_formats();

const FileFormat* file_format_of(std::string_view media_type);

/// Maximum number of bytes examined at the start of a file.
constexpr std::size_t max_recognised_bytes = 16384;

/// Returns how likely a file that starts with these bytes has a format; `none` if more bytes are
/// needed. More bytes do not change it, except for text, which may turn out to be binary.
Likelihood likelihood(const FileFormat& format, std::span<const std::uint8_t> start);

}  // namespace eventcamera
