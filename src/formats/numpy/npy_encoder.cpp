// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/numpy/npy_encoder.hpp"

#include <cstring>
#include <string>
#include <string_view>

#include "src/formats/numpy/npy_header.hpp"

namespace eventcamera {

namespace {

// The count is padded with blanks to its maximum length, so that it can be patched.
constexpr std::string_view before_count =
    "{'descr': [('x', '<u2'), ('y', '<u2'), ('t', '<i8'), ('p', '|u1')], "
    "'fortran_order': False, 'shape': (";
constexpr std::string_view after_count = ")}";
constexpr std::size_t max_count = 20;
constexpr std::size_t count_at = npy_magic.size() + 4 + before_count.size();

/// Content of a tuple with one element, such as "50000,".
std::string shape(std::uint64_t count) {
  auto text = std::to_string(count) + ',';
  text.resize(max_count, ' ');
  return text;
}

std::string header_text() {
  return npy_preamble(std::string(before_count) + shape(npy_unknown_count) +
                      std::string(after_count));
}

}  // namespace

NpyEncoder::NpyEncoder() : Encoder(header_text()) {}

void NpyEncoder::append(std::span<const AbsoluteEvent> events, std::vector<std::uint8_t>& out) {
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

std::optional<FilePatch> NpyEncoder::patch() const {
  const auto text = shape(count_);
  return FilePatch{count_at, {text.begin(), text.end()}};
}

}  // namespace eventcamera
