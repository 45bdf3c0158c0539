// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <string>
#include <string_view>

#include "src/formats/byte_queue.hpp"
#include "src/formats/corruption.hpp"

namespace eventcamera {

/// Header of AEDAT 2.0 and 3.1: lines of text starting with '#'.
class AedatHeader {
 public:
  enum class Next {
    more,  ///< more bytes are needed
    line,  ///< another line was read
    last,  ///< the last line of the header was read
    data,  ///< the next bytes are not a header line
  };

  /// The first line starts with `magic`, the last one with `last_line`.
  AedatHeader(std::string_view magic, std::string_view last_line)
      : magic_(magic), last_line_(last_line) {}

  /// Reads a line from the front of `queue`. Throws UnsupportedFormat.
  Next next(ByteQueue& queue) {
    if (!in_line_) {
      line_.clear();
      if (first_line_ && !begins_with_magic(queue)) return Next::more;
      const auto start = queue.peek(1);
      if (start.empty()) return Next::more;
      if (start.front() != '#') return Next::data;
      in_line_ = true;
    }
    while (in_line_) {
      const auto bytes = queue.peek(1);
      if (bytes.empty()) return Next::more;
      const auto end = std::find(bytes.begin(), bytes.end(), '\n');
      const auto count = static_cast<std::size_t>(end - bytes.begin());
      line_.append(reinterpret_cast<const char*>(bytes.data()),
                   std::min(count, max_line - std::min(line_.size(), max_line)));
      in_line_ = end == bytes.end();
      queue.consume(count + (in_line_ ? 0 : 1));
    }
    if (line_.back() == '\r') line_.pop_back();
    first_line_ = false;
    return line_.starts_with(last_line_) ? Next::last : Next::line;
  }

  /// The line read last, without CR and LF.
  const std::string& line() const { return line_; }

  bool in_first_line() const { return first_line_; }
  bool in_line() const { return in_line_; }

  UnsupportedFormat wrong_magic() const {
    return UnsupportedFormat("not an AEDAT file of this version: it does not begin with " +
                             std::string(magic_));
  }

 private:
  /// Longer lines are cut to this length.
  static constexpr std::size_t max_line = 4096;

  /// False if more bytes are needed.
  bool begins_with_magic(ByteQueue& queue) const {
    const auto start = queue.peek(std::min(queue.size(), magic_.size()));
    const auto count = std::min(start.size(), magic_.size());
    if (!std::equal(start.begin(), start.begin() + static_cast<std::ptrdiff_t>(count),
                    magic_.begin()))
      throw wrong_magic();
    return count == magic_.size();
  }

  std::string_view magic_, last_line_;
  std::string line_;
  bool first_line_ = true;
  bool in_line_ = false;
};

}  // namespace eventcamera
