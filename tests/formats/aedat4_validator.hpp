// SPDX-License-Identifier: LGPL-2.1-or-later
// Strict AEDAT4 reader, independent of this project's code and of the FlatBuffers library: throws
// on any deviation from the format.
#pragma once

#include <lz4frame.h>
#include <zstd.h>

#include <cstdint>
#include <cstring>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "src/core/event.hpp"

namespace eventcamera::aedat4_validator {

using View = std::span<const std::uint8_t>;

inline void require(bool holds, const char* what) {
  if (!holds) throw std::runtime_error(what);
}

template <class Number>
Number number(View bytes, std::size_t at) {
  require(at + sizeof(Number) <= bytes.size(), "a number beyond the end");
  Number value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

/// Table of a FlatBuffer; positions are relative to the buffer's size prefix.
class Table {
 public:
  Table(View buffer, std::size_t at) : buffer_(buffer), at_(at) {
    require(at % 4 == 0, "a table that is not aligned");
    vtable_ = at - static_cast<std::size_t>(number<std::int32_t>(buffer, at));
    const auto size = number<std::uint16_t>(buffer, vtable_);
    require(vtable_ % 2 == 0 && size >= 4 && size % 2 == 0, "a vtable's size");
    fields_ = (size - 4U) / 2;
    table_size_ = number<std::uint16_t>(buffer, vtable_ + 2);
    require(at + table_size_ <= buffer.size(), "a table beyond the end");
  }

  static Table root(View buffer, const std::string& identifier) {
    require(number<std::uint32_t>(buffer, 0) == buffer.size() - 4, "a FlatBuffer's size prefix");
    require(identifier == std::string(buffer.begin() + 8, buffer.begin() + 12), "an identifier");
    return {buffer, 4 + number<std::uint32_t>(buffer, 4)};
  }

  /// Position of field `i`; 0 if absent.
  std::size_t at(std::size_t i, std::size_t size) const {
    const auto offset =
        i < fields_ ? number<std::uint16_t>(buffer_, vtable_ + 4 + 2 * i) : std::uint16_t{0};
    if (offset == 0) return 0;
    require(offset + size <= table_size_, "a field beyond its table");
    return at_ + offset;
  }

  template <class Number>
  Number get(std::size_t i, Number otherwise) const {
    const auto place = at(i, sizeof(Number));
    require(place % sizeof(Number) == 0, "a field that is not aligned");
    return place != 0 ? number<Number>(buffer_, place) : otherwise;
  }

  struct Vector {
    std::size_t at;
    std::size_t count;
  };
  Vector vector(std::size_t i, std::size_t element, std::size_t alignment) const {
    const auto place = at(i, 4);
    require(place != 0, "a vector that is missing");
    const auto start = place + number<std::uint32_t>(buffer_, place);
    const Vector found{start + 4, number<std::uint32_t>(buffer_, start)};
    require(found.at % alignment == 0, "a vector that is not aligned");
    require(found.at + found.count * element <= buffer_.size(), "a vector beyond the end");
    return found;
  }

 private:
  View buffer_;
  std::size_t at_;
  std::size_t vtable_ = 0;
  std::size_t fields_ = 0;
  std::size_t table_size_ = 0;
};

inline std::vector<std::uint8_t> decompressed(int compression, View bytes) {
  if (compression == 0) return {bytes.begin(), bytes.end()};
  std::vector<std::uint8_t> content(16 << 20);
  if (compression == 1 || compression == 2) {
    LZ4F_dctx* context = nullptr;
    LZ4F_createDecompressionContext(&context, LZ4F_VERSION);
    auto size = content.size();
    auto used = bytes.size();
    const auto result =
        LZ4F_decompress(context, content.data(), &size, bytes.data(), &used, nullptr);
    LZ4F_freeDecompressionContext(context);
    require(result == 0 && used == bytes.size(), "an LZ4 frame");
    content.resize(size);
  } else {
    const auto size = ZSTD_decompress(content.data(), content.size(), bytes.data(), bytes.size());
    require(ZSTD_isError(size) == 0, "a Zstandard frame");
    content.resize(size);
  }
  return content;
}

struct Frame {
  std::int64_t t;
  std::int64_t exposure_end;
  int format;
  int width;
  int height;
  int x;
  std::vector<std::uint8_t> pixels;
};

struct Entry {
  std::int64_t offset;
  std::int32_t stream;
  std::int32_t size;
  std::int64_t elements;
  std::int64_t start;
  std::int64_t end;

  friend bool operator==(const Entry&, const Entry&) = default;
};

struct File {
  std::string xml;
  std::vector<AbsoluteEvent> events;  ///< events of stream 0
  std::vector<Frame> frames;          ///< frames of stream 1
  std::vector<Entry> packets;         ///< actual packets
  std::vector<Entry> table;           ///< packets according to the table
  std::size_t max_packet = 0;         ///< events
};

inline void read_packet(View content, std::int32_t stream, Entry& entry, File& out) {
  if (stream == 0) {
    const auto elements = Table::root(content, "EVTS").vector(0, 16, 8);
    require(elements.count > 0, "a packet without events");
    for (std::size_t i = 0; i < elements.count; ++i) {
      const auto at = elements.at + 16 * i;
      const auto x = number<std::int16_t>(content, at + 8);
      const auto y = number<std::int16_t>(content, at + 10);
      const auto on = number<std::uint32_t>(content, at + 12);
      require(x >= 0 && y >= 0 && on <= 1, "an event");
      out.events.push_back(AbsoluteEvent::at(x, y, number<std::int64_t>(content, at),
                                             on == 1 ? Polarity::on : Polarity::off));
    }
    entry.elements = static_cast<std::int64_t>(elements.count);
    entry.start = number<std::int64_t>(content, elements.at);
    entry.end = out.events.back().t;
    out.max_packet = std::max(out.max_packet, elements.count);
  } else {
    require(stream == 1, "a stream that the header does not list");
    const auto table = Table::root(content, "FRME");
    const auto pixels = table.vector(10, 1, 1);
    const auto* const first = content.data() + pixels.at;
    out.frames.push_back({table.get<std::int64_t>(0, 0),
                          table.get<std::int64_t>(4, 0),
                          table.get<std::int8_t>(5, 0),
                          table.get<std::int16_t>(6, 0),
                          table.get<std::int16_t>(7, 0),
                          table.get<std::int16_t>(8, 0),
                          {first, first + pixels.count}});
    entry.elements = 1;
    entry.start = entry.end = out.frames.back().t;
  }
}

inline File read(View bytes) {
  constexpr std::size_t magic = 14;
  File out;
  require(bytes.size() > 18 && std::memcmp(bytes.data(), "#!AER-DAT4.0\r\n", magic) == 0, "magic");
  const auto header_size = 4 + std::size_t{number<std::uint32_t>(bytes, magic)};
  require(magic + header_size <= bytes.size(), "the header's size");
  const auto header_bytes = bytes.subspan(magic, header_size);
  const auto header = Table::root(header_bytes, "IOHE");
  const auto compression = header.get<std::int32_t>(0, 0);
  const auto table_at = header.get<std::int64_t>(1, -1);
  const auto text = header.vector(2, 1, 4);
  out.xml.assign(header_bytes.begin() + static_cast<std::ptrdiff_t>(text.at),
                 header_bytes.begin() + static_cast<std::ptrdiff_t>(text.at + text.count));
  auto at = magic + header_size;
  const auto end = table_at == -1 ? bytes.size() : static_cast<std::size_t>(table_at);
  require(end <= bytes.size(), "the table's position");
  while (at < end) {
    Entry entry{static_cast<std::int64_t>(at + 8),
                number<std::int32_t>(bytes, at),
                number<std::int32_t>(bytes, at + 4),
                0,
                0,
                0};
    require(entry.size > 0 && at + 8 + static_cast<std::size_t>(entry.size) <= end,
            "a packet's size");
    const auto payload = bytes.subspan(at + 8, static_cast<std::size_t>(entry.size));
    read_packet(decompressed(compression, payload), entry.stream, entry, out);
    out.packets.push_back(entry);
    at += 8 + payload.size();
  }
  require(at == end, "packets that do not end at the table");
  if (table_at == -1) return out;
  const auto content = decompressed(compression, bytes.subspan(end));
  const auto entries = Table::root(content, "FTAB").vector(0, 4, 4);
  for (std::size_t i = 0; i < entries.count; ++i) {
    const auto place = entries.at + 4 * i;
    const Table entry(content, place + number<std::uint32_t>(content, place));
    const auto info = entry.at(1, 8);
    require(info != 0, "an entry without its packet");
    out.table.push_back({entry.get<std::int64_t>(0, 0), number<std::int32_t>(content, info),
                         number<std::int32_t>(content, info + 4), entry.get<std::int64_t>(2, 0),
                         entry.get<std::int64_t>(3, 0), entry.get<std::int64_t>(4, 0)});
  }
  return out;
}

}  // namespace eventcamera::aedat4_validator
