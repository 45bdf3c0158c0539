// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>

namespace eventcamera {

/// The lines "% key value" before the data of Prophesee's files. "% end" ends them, and so does, in
/// older files, what is no such line.
class PropheseeHeader {
 public:
  /// Takes a line from the front of `bytes` and returns its length; 0 where it is not yet whole or
  /// the header has ended. `ended`: no more bytes will come. Throws UnsupportedFormat where there
  /// is too much.
  std::size_t take(std::span<const std::uint8_t> bytes, bool ended);

  bool ended() const { return ended_; }

  /// Whether there was any line.
  bool found() const { return found_; }

  /// Empty where there is none.
  std::string value(const std::string& key) const;

  /// A number from 1 to `largest`, else 0.
  static int number(const std::string& text, int largest);

 private:
  std::map<std::string, std::string> values_;
  std::size_t length_ = 0;
  bool found_ = false;
  bool ended_ = false;
};

}  // namespace eventcamera
