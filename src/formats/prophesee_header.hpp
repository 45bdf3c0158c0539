// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>

#include "src/formats/corruption.hpp"

namespace eventcamera {

/// Header lines "% key value" of Prophesee files. The header ends with "% end" or, in older files,
/// at the first byte that does not start such a line.
class PropheseeHeader {
 public:
  /// Reads a line from the front of `bytes` and returns its length; 0 if it is incomplete or the
  /// header has ended. `ended`: no more bytes will follow. Throws UnsupportedFormat if the header
  /// is too long.
  std::size_t read_line(std::span<const std::uint8_t> bytes, bool ended) {
    if (ended_) return 0;
    const auto looked_at = bytes.first(std::min(bytes.size(), max_line));
    // Binary data may look like the start of a line, but is unlikely to continue as text.
    const auto text_end = std::find_if(looked_at.begin(), looked_at.end(), [](std::uint8_t byte) {
      return byte < ' ' && byte != '\t' && byte != '\r';
    });
    const auto stop = past_zeros(text_end, looked_at.end());
    const bool is_undecided = stop != text_end && (stop == looked_at.end() ||
                                                   (looked_at.end() - stop == 1 && *stop == '%'));
    if (is_undecided && !ended && bytes.size() < max_line) return 0;
    const bool begins = (looked_at.empty() || looked_at[0] == '%') &&
                        (looked_at.size() < 2 || looked_at[1] == ' ' || looked_at[1] == '\n');
    const bool next = stop - text_end > 0 && text_end - looked_at.begin() > 2 &&
                      looked_at.end() - stop >= 2 && stop[0] == '%' && stop[1] == ' ';
    const bool whole = next || (stop != looked_at.end() && *stop == '\n');
    if (!begins || (!whole && (ended || stop != looked_at.end() || bytes.size() >= max_line))) {
      ended_ = true;
      return 0;
    }
    if (!whole) return 0;

    const auto length = static_cast<std::size_t>(stop - looked_at.begin()) + (next ? 0 : 1);
    length_ += length;
    if (length_ > max_header) throw UnsupportedFormat("the header is too long");
    found_ = true;
    const auto line = trimmed({reinterpret_cast<const char*>(looked_at.data()) + 1,
                               static_cast<std::size_t>(text_end - looked_at.begin()) - 1});
    const auto key = line.substr(0, line.find(' '));
    if (key == "end") ended_ = true;
    values_[std::string(key)] = trimmed(line.substr(key.size()));
    return length;
  }

  bool ended() const { return ended_; }

  bool found() const { return found_; }

  /// Value of a key; empty if there is none.
  std::string value(const std::string& key) const {
    const auto found = values_.find(key);
    return found == values_.end() ? std::string() : found->second;
  }

  /// Parses a number from 1 to `max`; 0 if the text is anything else.
  static int number(const std::string& text, int max) {
    int number = 0;
    const auto end = text.data() + text.size();
    const auto parsed = std::from_chars(text.data(), end, number);
    return parsed.ec == std::errc() && parsed.ptr == end && number >= 1 && number <= max ? number
                                                                                         : 0;
  }

 private:
  static constexpr std::size_t max_line = 4096;
  static constexpr std::size_t max_header = 65536;

  static std::string_view trimmed(std::string_view text) {
    const auto first = text.find_first_not_of(" \t\r");
    if (first == std::string_view::npos) return {};
    return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
  }

  /// The tool of the GenX320 evaluation kit ends some lines with a zero, in place of a line end or
  /// before it.
  template <class Iterator>
  static Iterator past_zeros(Iterator at, Iterator end) {
    return std::find_if(at, end, [](std::uint8_t byte) { return byte != 0; });
  }

  std::map<std::string, std::string> values_;
  std::size_t length_ = 0;
  bool found_ = false;
  bool ended_ = false;
};

}  // namespace eventcamera
