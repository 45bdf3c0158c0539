// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace eventcamera {

/// Converts text in pieces of any size to UTF-8, if it begins with a byte order mark of UTF-16;
/// other text is left as it is. Characters past U+FFFF become question marks.
class Utf8Text {
 public:
  /// Returns `bytes` as UTF-8; the text is valid as long as `bytes` and `converted`.
  std::string_view text_of(std::span<const std::uint8_t> bytes, std::string& converted) {
    if (encoding_ == Encoding::unknown) {
      start_.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
      if (start_.size() < 2) return {};
      encoding_ = start_.starts_with("\xff\xfe")   ? Encoding::utf16_little
                  : start_.starts_with("\xfe\xff") ? Encoding::utf16_big
                                                   : Encoding::utf8;
      if (encoding_ != Encoding::utf8) start_.erase(0, 2);
      converted.swap(start_);
      if (encoding_ == Encoding::utf8) return converted;
      const std::string units = std::move(converted);
      converted.clear();
      convert({reinterpret_cast<const std::uint8_t*>(units.data()), units.size()}, converted);
      return converted;
    }
    if (encoding_ == Encoding::utf8)
      return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
    convert(bytes, converted);
    return converted;
  }

  /// The text, if it has only one byte.
  std::string_view rest() const { return start_; }

 private:
  enum class Encoding : std::uint8_t { unknown, utf8, utf16_little, utf16_big };

  void convert(std::span<const std::uint8_t> bytes, std::string& out) {
    for (const std::uint32_t byte : bytes) {
      if (!half_) {
        half_ = byte;
        continue;
      }
      append(encoding_ == Encoding::utf16_little ? *half_ | byte << 8 : *half_ << 8 | byte, out);
      half_.reset();
    }
  }

  static void append(std::uint32_t unit, std::string& out) {
    if (unit < 0x80) {
      out += static_cast<char>(unit);
    } else if (unit < 0x800) {
      out += static_cast<char>(0xc0 | unit >> 6);
      out += static_cast<char>(0x80 | (unit & 0x3f));
    } else if (unit >= 0xd800 && unit < 0xe000) {
      if (unit < 0xdc00) out += '?';  // once for both halves
    } else {
      out += static_cast<char>(0xe0 | unit >> 12);
      out += static_cast<char>(0x80 | (unit >> 6 & 0x3f));
      out += static_cast<char>(0x80 | (unit & 0x3f));
    }
  }

  Encoding encoding_ = Encoding::unknown;
  std::string start_;                  ///< first byte, until the encoding is known
  std::optional<std::uint32_t> half_;  ///< first byte of a character
};

}  // namespace eventcamera
