// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/hdf5/hdf5_filters.hpp"

#include <hdf5.h>
#include <zlib.h>

#include <algorithm>

#include "src/core/byte_order.hpp"

namespace eventcamera {

namespace {

/// Decompresses zlib data. False if it is corrupt or larger than `max_bytes`.
bool inflate_within(std::size_t max_bytes, std::vector<std::uint8_t>& bytes) {
  std::vector<std::uint8_t> out(max_bytes);
  auto size = static_cast<uLongf>(max_bytes);
  if (uncompress(out.data(), &size, bytes.data(), bytes.size()) != Z_OK) return false;
  out.resize(size);
  bytes = std::move(out);
  return true;
}

/// Decompresses LZF data. False if it is corrupt or larger than `max_bytes`.
bool expand_lzf_within(std::size_t max_bytes, std::vector<std::uint8_t>& bytes) {
  std::vector<std::uint8_t> out;
  out.reserve(max_bytes);
  for (std::size_t at = 0; at < bytes.size();) {
    const std::size_t control = bytes[at++];
    if (control < 32) {  // literal bytes
      const auto count = control + 1;
      if (count > bytes.size() - at || count > max_bytes - out.size()) return false;
      out.insert(out.end(), bytes.begin() + static_cast<std::ptrdiff_t>(at),
                 bytes.begin() + static_cast<std::ptrdiff_t>(at + count));
      at += count;
      continue;
    }
    // A copy of bytes at some distance before, which may overlap their copy.
    constexpr std::size_t long_copy = 7;
    auto count = control >> 5;
    if (count == long_copy) {
      if (at == bytes.size()) return false;
      count += bytes[at++];
    }
    count += 2;
    if (at == bytes.size()) return false;
    const auto distance = ((control & 31) << 8 | bytes[at++]) + 1;
    if (distance > out.size() || count > max_bytes - out.size()) return false;
    for (; count > 0; --count) out.push_back(out[out.size() - distance]);
  }
  bytes = std::move(out);
  return true;
}

/// Undoes the shuffle filter, which stores all first bytes of the numbers, then all second bytes,
/// and so on.
void unshuffle(std::size_t number_bytes, std::vector<std::uint8_t>& bytes) {
  const auto count = bytes.size() / number_bytes;
  if (count == 0) return;
  std::vector<std::uint8_t> out(bytes.size());
  for (std::size_t byte = 0; byte < number_bytes; ++byte) {
    const auto* from = bytes.data() + byte * count;
    auto* to = out.data() + byte;
    for (std::size_t i = 0; i < count; ++i) to[i * number_bytes] = from[i];
  }
  std::copy(bytes.begin() + static_cast<std::ptrdiff_t>(count * number_bytes), bytes.end(),
            out.begin() + static_cast<std::ptrdiff_t>(count * number_bytes));
  bytes = std::move(out);
}

/// Fletcher-32 checksum over big-endian 16-bit words.
std::uint32_t fletcher_sum(std::span<const std::uint8_t> bytes) {
  std::uint64_t low = 0;
  std::uint64_t high = 0;
  const auto fold = [](std::uint64_t sum) { return (sum & 0xffff) + (sum >> 16); };
  for (std::size_t i = 0; i < bytes.size(); i += 2) {
    const unsigned second = i + 1 < bytes.size() ? bytes[i + 1] : 0;
    low = fold(low + (static_cast<unsigned>(bytes[i]) << 8 | second));
    high = fold(high + low);
  }
  return static_cast<std::uint32_t>(fold(high) << 16 | fold(low));
}

/// Removes the checksum at the end. False if it does not match the bytes before it.
bool remove_fletcher_sum(std::vector<std::uint8_t>& bytes) {
  if (bytes.size() < sizeof(std::uint32_t)) return false;
  bytes.resize(bytes.size() - sizeof(std::uint32_t));
  const auto sum = little_endian<std::uint32_t>(bytes.data() + bytes.size());
  return sum == fletcher_sum(bytes);
}

}  // namespace

bool is_own_hdf5_filter(int filter) {
  return filter == H5Z_FILTER_DEFLATE || filter == H5Z_FILTER_SHUFFLE ||
         filter == H5Z_FILTER_FLETCHER32 || filter == lzf_filter;
}

bool undo_hdf5_filters(std::span<const int> filters, std::uint32_t filter_mask,
                       std::size_t number_bytes, std::size_t chunk_bytes,
                       std::vector<std::uint8_t>& bytes) {
  for (auto i = filters.size(); i-- > 0;) {
    if ((filter_mask >> i & 1) != 0) continue;
    switch (filters[i]) {
      case H5Z_FILTER_DEFLATE:
        // Each further filter may have added a checksum.
        if (!inflate_within(chunk_bytes + 4 * filters.size(), bytes)) return false;
        break;
      case lzf_filter:
        if (!expand_lzf_within(chunk_bytes + 4 * filters.size(), bytes)) return false;
        break;
      case H5Z_FILTER_FLETCHER32:
        if (!remove_fletcher_sum(bytes)) return false;
        break;
      default:
        unshuffle(number_bytes, bytes);
    }
  }
  return bytes.size() == chunk_bytes;
}

}  // namespace eventcamera
