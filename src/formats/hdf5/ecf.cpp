// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/hdf5/ecf.hpp"

#include <algorithm>
#include <array>
#include <cassert>

#include "src/formats/byte_cursor.hpp"

namespace eventcamera {

namespace {

constexpr std::uint32_t all_packed = 2;  // y, x and p of an event are packed together
constexpr std::uint32_t xp_packed = 1;   // x and p are packed together
constexpr std::size_t header_bytes = 12;

/// Number of consecutive events from `first` on with the same value.
template <class Value>
std::size_t run(std::span<const AbsoluteEvent> events, std::size_t first, const Value& value) {
  auto end = first + 1;
  while (end < events.size() && value(events[end]) == value(events[first])) ++end;
  return end - first;
}

int polarity_bit(const AbsoluteEvent& event) {
  return event.y_p >> 15;
}

void put_times(std::span<const AbsoluteEvent> events, ByteAppender& writer) {
  auto last = static_cast<std::uint64_t>(events.front().t);
  for (std::size_t i = 0; i < events.size();) {
    auto gap = static_cast<std::uint64_t>(events[i].t) - last;
    last += gap;
    if (gap >= 15) {
      for (; gap > 0; gap >>= 4) writer.put(static_cast<std::uint8_t>(0xf0 | (gap & 15)));
    }
    const auto count = run(events, i, [](const AbsoluteEvent& event) { return event.t; });
    if (count < 15) {
      writer.put(static_cast<std::uint8_t>(gap << 4 | count));
    } else {
      writer.put(static_cast<std::uint8_t>(gap << 4 | 15));
      writer.put(static_cast<std::uint16_t>(count));
    }
    i += count;
  }
}

bool read_times(ByteCursor& reader, std::span<AbsoluteEvent> events) {
  auto t = reader.number<std::uint64_t>();
  for (std::size_t i = 0; i < events.size();) {
    auto byte = reader.number<std::uint8_t>();
    std::uint64_t gap = 0;
    for (unsigned shift = 0; byte >= 0xf0; shift += 4) {
      if (shift >= 64) return false;
      gap |= static_cast<std::uint64_t>(byte & 15) << shift;
      byte = reader.number<std::uint8_t>();
    }
    t += gap + (byte >> 4);
    std::size_t count = byte & 15;
    if (count == 15) count = reader.number<std::uint16_t>();
    if (reader.failed() || count > events.size() - i) return false;
    for (auto& event : events.subspan(i, count)) event.t = static_cast<Microseconds>(t);
    i += count;
  }
  return true;
}

/// Writes runs of equal values as words, with the value in the upper bits and the length in the
/// lower ones. If all lower bits are set, the length follows the word.
template <class Word, unsigned count_mask, class Value>
void put_runs(std::span<const AbsoluteEvent> events, ByteAppender& writer, const Value& value) {
  for (std::size_t i = 0; i < events.size();) {
    const auto count = run(events, i, value);
    const auto bits = static_cast<unsigned>(value(events[i]));
    writer.put(
        static_cast<Word>(bits * (count_mask + 1) | std::min<std::size_t>(count, count_mask)));
    if (count >= count_mask) writer.put(static_cast<std::uint16_t>(count));
    i += count;
  }
}

template <class Word, unsigned count_mask, class SetValue>
bool read_runs(ByteCursor& reader, std::span<AbsoluteEvent> events, const SetValue& set_value) {
  for (std::size_t i = 0; i < events.size();) {
    const unsigned word = reader.number<Word>();
    std::size_t count = word & count_mask;
    if (count == count_mask) count = reader.number<std::uint16_t>();
    if (reader.failed() || count > events.size() - i) return false;
    const auto value = static_cast<std::uint16_t>(word / (count_mask + 1));
    for (auto& event : events.subspan(i, count)) set_value(event, value);
    i += count;
  }
  return true;
}

bool read_rows(ByteCursor& reader, std::span<AbsoluteEvent> events) {
  return read_runs<std::uint16_t, 31>(reader, events,
                                      [](AbsoluteEvent& event, std::uint16_t y) { event.y_p = y; });
}

void put_columns(std::span<const AbsoluteEvent> events, ByteAppender& writer) {
  for (std::size_t i = 0; i < events.size();) {
    const unsigned x = events[i++].x;
    unsigned mask = 0;
    for (unsigned j = 0; j < 5 && i < events.size(); ++j) {
      if (events[i].x != x + j + 1) continue;
      mask |= 16 >> j;
      ++i;
    }
    writer.put(static_cast<std::uint16_t>(x << 5 | mask));
  }
}

bool read_columns(ByteCursor& reader, std::span<AbsoluteEvent> events) {
  for (std::size_t i = 0; i < events.size();) {
    const auto word = reader.number<std::uint16_t>();
    if (reader.failed()) return false;
    const unsigned x = word >> 5;
    events[i++].x = static_cast<std::uint16_t>(x);
    // The last mask of other writers may extend past the last event.
    for (unsigned j = 0; j < 5 && i < events.size(); ++j)
      if ((word & 16 >> j) != 0) events[i++].x = static_cast<std::uint16_t>(x + j + 1);
  }
  return true;
}

/// Numbers of four events, with zeros past the last event.
template <class Number>
std::array<std::uint32_t, 4> group(std::span<const AbsoluteEvent> events, std::size_t first,
                                   const Number& number) {
  std::array<std::uint32_t, 4> numbers{};
  for (std::size_t j = 0; j < 4 && first + j < events.size(); ++j)
    numbers[j] = static_cast<std::uint32_t>(number(events[first + j]));
  return numbers;
}

void put_all_packed(std::span<const AbsoluteEvent> events, ByteAppender& writer) {
  for (std::size_t i = 0; i < events.size(); i += 4) {
    const auto v = group(events, i, [](const AbsoluteEvent& event) {
      return event.y() << 12 | event.x << 1 | polarity_bit(event);
    });
    writer.put(v[0] << 8 | (v[1] & 0xff));
    writer.put(v[1] >> 8 << 16 | (v[2] & 0xffff));
    writer.put(v[2] >> 16 << 24 | v[3]);
  }
}

bool read_all_packed(ByteCursor& reader, std::span<AbsoluteEvent> events) {
  for (std::size_t i = 0; i < events.size(); i += 4) {
    const auto w0 = reader.number<std::uint32_t>();
    const auto w1 = reader.number<std::uint32_t>();
    const auto w2 = reader.number<std::uint32_t>();
    if (reader.failed()) return false;
    const std::array<std::uint32_t, 4> v = {w0 >> 8, (w0 & 0xff) | w1 >> 16 << 8,
                                            (w1 & 0xffff) | w2 >> 24 << 16, w2 & 0xffffff};
    for (std::size_t j = 0; j < 4 && i + j < events.size(); ++j) {
      events[i + j].x = static_cast<std::uint16_t>(v[j] >> 1 & 0x7ff);
      events[i + j].y_p = static_cast<std::uint16_t>((v[j] >> 12 & 0x7ff) | (v[j] & 1) << 15);
    }
  }
  return true;
}

void put_xp_packed(std::span<const AbsoluteEvent> events, ByteAppender& writer) {
  for (std::size_t i = 0; i < events.size(); i += 4) {
    const auto v = group(
        events, i, [](const AbsoluteEvent& event) { return event.x << 1 | polarity_bit(event); });
    writer.put(static_cast<std::uint16_t>(v[0] << 4 | (v[1] & 0xf)));
    writer.put(static_cast<std::uint16_t>(v[1] >> 4 << 8 | (v[2] & 0xff)));
    writer.put(static_cast<std::uint16_t>(v[2] >> 8 << 12 | v[3]));
  }
}

bool read_xp_packed(ByteCursor& reader, std::span<AbsoluteEvent> events) {
  for (std::size_t i = 0; i < events.size(); i += 4) {
    const unsigned h0 = reader.number<std::uint16_t>();
    const unsigned h1 = reader.number<std::uint16_t>();
    const unsigned h2 = reader.number<std::uint16_t>();
    if (reader.failed()) return false;
    const std::array<unsigned, 4> v = {h0 >> 4, (h0 & 0xf) | h1 >> 8 << 4,
                                       (h1 & 0xff) | h2 >> 12 << 8, h2 & 0xfff};
    for (std::size_t j = 0; j < 4 && i + j < events.size(); ++j) {
      events[i + j].x = static_cast<std::uint16_t>(v[j] >> 1);
      events[i + j].y_p |= static_cast<std::uint16_t>((v[j] & 1) << 15);
    }
  }
  return true;
}

/// Chooses the packing from the first quarter of the events: run lengths only pay off if runs are
/// common.
std::uint32_t packing(std::span<const AbsoluteEvent> events) {
  const auto sample = events.first(events.size() < 16 ? events.size() : events.size() / 4);
  std::size_t same_row = 0;
  std::size_t near = 0;
  unsigned run_begin = sample.front().x;
  for (std::size_t i = 1; i < sample.size(); ++i) {
    same_row += sample[i].y() == sample[i - 1].y() ? 1 : 0;
    if (sample[i].x > sample[i - 1].x && sample[i].x <= run_begin + 5) {
      ++near;
    } else {
      run_begin = sample[i].x;
    }
  }
  if (same_row * 100 <= sample.size() * 20) return all_packed;
  if (near * 100 <= sample.size() * 8) return xp_packed;
  return 0;
}

}  // namespace

void encode_ecf(std::span<const AbsoluteEvent> events, std::vector<std::uint8_t>& out) {
  assert(events.size() <= ecf_max_events);
  ByteAppender writer(out);
  if (events.empty()) {
    writer.put<std::uint32_t>(0);
    writer.put<std::uint64_t>(0);
    return;
  }
  const auto packed = packing(events);
  writer.put(static_cast<std::uint32_t>(events.size() << 2 | packed));
  writer.put(events.front().t);
  put_times(events, writer);
  if (packed == all_packed) {
    put_all_packed(events, writer);
    return;
  }
  put_runs<std::uint16_t, 31>(events, writer, [](const AbsoluteEvent& event) { return event.y(); });
  if (packed == xp_packed) {
    put_xp_packed(events, writer);
  } else {
    put_columns(events, writer);
    put_runs<std::uint8_t, 127>(events, writer, polarity_bit);
  }
}

bool decode_ecf(std::span<const std::uint8_t> chunk, std::vector<AbsoluteEvent>& out) {
  if (chunk.size() < header_bytes) return false;
  ByteCursor reader(chunk);
  const auto head = reader.number<std::uint32_t>();
  const std::size_t count = head >> 2;
  if (count > ecf_max_events) return false;
  const auto begin = out.size();
  out.resize(begin + count);
  const auto events = std::span(out).subspan(begin);
  bool sound = read_times(reader, events);
  if ((head & all_packed) != 0) {
    sound = sound && read_all_packed(reader, events);
  } else if ((head & xp_packed) != 0) {
    sound = sound && read_rows(reader, events) && read_xp_packed(reader, events);
  } else {
    sound =
        sound && read_rows(reader, events) && read_columns(reader, events) &&
        read_runs<std::uint8_t, 127>(reader, events, [](AbsoluteEvent& event, std::uint16_t on) {
          event.y_p |= static_cast<std::uint16_t>(on << 15);
        });
  }
  if (!sound) out.resize(begin);
  return sound;
}

std::optional<Microseconds> ecf_first_time(std::span<const std::uint8_t> chunk) {
  if (chunk.size() < header_bytes) return std::nullopt;
  return little_endian<Microseconds>(chunk.data() + 4);
}

}  // namespace eventcamera
