// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "src/core/event.hpp"
#include "src/formats/encoder.hpp"
#include "src/formats/numpy/npy_header.hpp"

namespace eventcamera {

/// Encodes NumPy files: a structured array of x, y (uint16), t (int64, microseconds) and p (uint8,
/// 1 = ON). The header contains the number of events; until patch() is applied, an impossibly large
/// one: the decoder then reads to the end, and numpy.load() fails rather than return too few
/// events.
class NpyEncoder final : public Encoder {
 public:
  static constexpr std::size_t event_bytes = 13;

  NpyEncoder() : Encoder(header_text()) {}

  std::optional<FilePatch> patch() const override {
    const auto text = shape(count_);
    return FilePatch{count_at, {text.begin(), text.end()}};
  }

 private:
  // The count is padded with blanks to its maximum length, so that it can be patched.
  static constexpr std::string_view before_count =
      "{'descr': [('x', '<u2'), ('y', '<u2'), ('t', '<i8'), ('p', '|u1')], "
      "'fortran_order': False, 'shape': (";
  static constexpr std::string_view after_count = ")}";
  static constexpr std::size_t max_count = 20;
  static constexpr std::size_t count_at = npy_magic.size() + 4 + before_count.size();

  /// Content of a tuple with one element, such as "50000,".
  static std::string shape(std::uint64_t count) {
    auto text = std::to_string(count) + ',';
    text.resize(max_count, ' ');
    return text;
  }

  static std::string header_text() {
    return npy_preamble(std::string(before_count) + shape(npy_unknown_count) +
                        std::string(after_count));
  }

  void append(std::span<const AbsoluteEvent> events, std::vector<std::uint8_t>& out) override {
    count_ += events.size();
    auto end = out.size();
    out.resize(end + events.size() * event_bytes);
    for (const auto& event : events) {
      auto* const at = out.data() + end;
      const auto y = static_cast<std::uint16_t>(event.y());
      std::memcpy(at, &event.x, 2);
      std::memcpy(at + 2, &y, 2);
      std::memcpy(at + 4, &event.t, 8);
      at[12] = static_cast<std::uint8_t>(event.polarity());
      end += event_bytes;
    }
  }

  std::uint64_t count_ = 0;
};

}  // namespace eventcamera
