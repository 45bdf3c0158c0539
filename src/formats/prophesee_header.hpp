// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>

namespace eventcamera {

/// Header lines "% key value" of Prophesee files. The header ends with "% end" or, in older files,
/// at the first byte that does not start such a line.
class PropheseeHeader {
 public:
  /// Reads a line from the front of `bytes` and returns its length; 0 if it is incomplete or the
  /// header has ended. `ended`: no more bytes will follow. Throws UnsupportedFormat if the header
  /// is too long.
  std::size_t read_line(std::span<const std::uint8_t> bytes, bool ended);

  bool ended() const { return ended_; }

  /// True if there was any line.
  bool found() const { return found_; }

  /// Value of a key; empty if there is none.
  std::string value(const std::string& key) const;

  /// Parses a number from 1 to `max`; 0 if the text is anything else.
  static int number(const std::string& text, int max);

 private:
  std::map<std::string, std::string> values_;
  std::size_t length_ = 0;
  bool found_ = false;
  bool ended_ = false;
};

}  // namespace eventcamera
