// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <vector>

#include "src/core/sensor_size.hpp"

/// Checks what all known readers of EVT words rely on, word by word. Each function returns the
/// first fault, or nothing.
namespace evt_validator {

using eventcamera::SensorSize;
using Bytes = std::span<const std::uint8_t>;

template <class Word>
std::vector<Word> words_of(Bytes bytes) {
  std::vector<Word> words(bytes.size() / sizeof(Word));
  std::memcpy(words.data(), bytes.data(), words.size() * sizeof(Word));
  return words;
}

inline std::string at(std::size_t word, const std::string& what) {
  return "word " + std::to_string(word) + ": " + what;
}

inline std::string evt3(Bytes bytes, SensorSize size) {
  if (bytes.size() % 2 != 0) return "a byte is left over";
  const auto words = words_of<std::uint16_t>(bytes);
  const int width = size.width;
  int high = -1;
  int low = -1;  // none since the last TIME_HIGH
  int y = -1;
  std::int64_t laps = 0;
  std::int64_t last_time = -1;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const int payload = words[i] & 0xfff;
    switch (words[i] >> 12) {
      case 0x8:  // TIME_HIGH
        if (high == -1 ? payload != 0 : payload != ((high + 1) & 0xfff))
          return at(i, "a TIME_HIGH that is not the next");
        if (payload == 0 && high != -1) ++laps;
        high = payload;
        low = -1;
        break;
      case 0x6:  // TIME_LOW
        if (high == -1) return at(i, "TIME_LOW before TIME_HIGH");
        if (payload <= low) return at(i, "a TIME_LOW that does not go on");
        low = payload;
        break;
      case 0x0:  // ADDR_Y
        if ((payload & 0x800) != 0) return at(i, "bit 11 of ADDR_Y");
        if (payload >= size.height) return at(i, "a row outside the sensor");
        if (payload == y) return at(i, "the same row again");
        y = payload;
        break;
      case 0x2:  // ADDR_X
        if ((payload & 0x7ff) >= width) return at(i, "a column outside the sensor");
        if (low == -1 || y == -1) return at(i, "an event without its time or row");
        break;
      case 0x3: {  // VECT_BASE_X
        if (low == -1 || y == -1) return at(i, "a vector without its time or row");
        if ((payload & 0x7ff) + 32 > width) return at(i, "a vector that leaves the sensor");
        if (i + 3 >= words.size() || words[i + 1] >> 12 != 4 || words[i + 2] >> 12 != 4 ||
            words[i + 3] >> 12 != 5)
          return at(i, "a vector that is not VECT_12, VECT_12, VECT_8");
        if ((words[i + 3] & 0xf00) != 0) return at(i + 3, "more than 8 bits");
        if (((words[i + 1] | words[i + 2] | words[i + 3]) & 0xfff) == 0)
          return at(i, "a vector without events");
        i += 3;
        break;
      }
      default:
        return at(i, "a type that is not to be written");
    }
    const auto time = (laps << 24) + (static_cast<std::int64_t>(high) << 12) + (low < 0 ? 0 : low);
    if (time < last_time) return at(i, "time goes back");
    last_time = time;
  }
  return {};
}

/// Types of a format with the fields of EVT2.
struct Types {
  std::uint32_t off, on, time_high;
};

/// Tracks the time of EVT2-like words.
class Time {
 public:
  std::string high(std::uint32_t count) {
    constexpr std::uint32_t max_high = (1U << 28) - 1;
    // OpenEB detects a wrap if the time falls by its range minus at most 10 ms.
    if (known_ && count < count_ && ((count_ - count) << 6) < (max_high << 6) - 10'000)
      return "a TIME_HIGH that falls and is no wrap";
    known_ = true;
    count_ = count;
    low_ = 0;
    return {};
  }

  std::string low(std::uint32_t low) {
    if (!known_) return "an event before TIME_HIGH";
    if (low < low_) return "time goes back";
    low_ = low;
    return {};
  }

 private:
  bool known_ = false;
  std::uint32_t count_ = 0;
  std::uint32_t low_ = 0;
};

/// Checks EVT2 and the common part of EVT4. `vectors`: types of vector heads, by polarity.
inline std::string evt2_or_4(Bytes bytes, SensorSize size, Types types, Types vectors) {
  if (bytes.size() % 4 != 0) return "bytes are left over";
  const auto words = words_of<std::uint32_t>(bytes);
  Time time;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const auto type = words[i] >> 28;
    std::string wrong;
    if (type == types.time_high) {
      wrong = time.high(words[i] & 0x0fffffff);
    } else if (type == types.off || type == types.on || type == vectors.off || type == vectors.on) {
      wrong = time.low(words[i] >> 22 & 63);
      auto x = static_cast<int>(words[i] >> 11 & 0x7ff);
      if (static_cast<int>(words[i] & 0x7ff) >= size.height) wrong = "a row outside the sensor";
      if (type == vectors.off || type == vectors.on) {
        if (x % 32 != 0) wrong = "a vector that does not begin at a multiple of 32";
        if (++i == words.size() || words[i] == 0) return at(i, "a vector without events");
        x += 31 - __builtin_clz(words[i]);
      }
      if (x >= size.width) wrong = "a column outside the sensor";
    } else {
      wrong = "a type that is not to be written";
    }
    if (!wrong.empty()) return at(i, wrong);
  }
  return {};
}

inline std::string evt2(Bytes bytes, SensorSize size) {
  constexpr std::uint32_t none = 0x10;
  return evt2_or_4(bytes, size, {0x0, 0x1, 0x8}, {none, none, none});
}

/// Conditions under which OpenEB's robust EVT4 decoder drops events.
inline std::string dropped_evt4(Bytes bytes, SensorSize size) {
  const auto words = words_of<std::uint32_t>(bytes);
  std::int64_t base = -1;     // last TIME_HIGH that it accepted
  std::int64_t pending = -1;  // jump that it has not accepted yet
  for (std::size_t i = 0; i < words.size(); ++i) {
    const auto type = words[i] >> 28;
    if (type == 0xe) {
      constexpr std::int64_t lap = std::int64_t{1} << 34;
      auto time = static_cast<std::int64_t>(words[i] & 0x0fffffff) << 6;
      if (base >= 0) time += base / lap * lap;
      if (base >= time + lap / 2) time += lap;
      const auto near = [time](std::int64_t t) { return time >= t && time <= t + 64; };
      if (pending >= 0 && (near(pending) || near(base))) {
        base = time;
        pending = -1;
      } else if (pending >= 0 || (base >= 0 && (time < base || time >= base + 1000))) {
        pending = time;
      } else {
        base = time;
      }
    } else if (pending >= 0) {
      return at(i, "an event after a jump in time");
    } else if (type == 0xc || type == 0xd) {
      if (static_cast<int>(words[i] >> 11 & 0x7ff) + 32 > size.width)
        return at(i, "a vector that leaves the sensor");
      ++i;
    }
  }
  return {};
}

inline std::string evt4(Bytes bytes, SensorSize size) {
  const auto wrong = evt2_or_4(bytes, size, {0xa, 0xb, 0xe}, {0xc, 0xd, 0x10});
  return wrong.empty() ? dropped_evt4(bytes, size) : wrong;
}

inline std::string evt21(Bytes bytes, SensorSize size, bool legacy) {
  if (bytes.size() % 8 != 0) return "bytes are left over";
  const auto halves = words_of<std::uint32_t>(bytes);
  Time time;
  for (std::size_t i = 0; i < halves.size(); i += 2) {
    const auto upper = halves[i + (legacy ? 0 : 1)];
    const auto lower = halves[i + (legacy ? 1 : 0)];
    std::string wrong;
    if (upper >> 28 == 0x8) {
      wrong = time.high(upper & 0x0fffffff);
      if (lower != 0) wrong = "bits below a TIME_HIGH";
    } else if (upper >> 28 <= 1) {
      wrong = time.low(upper >> 22 & 63);
      const auto x = static_cast<int>(upper >> 11 & 0x7ff);
      if (static_cast<int>(upper & 0x7ff) >= size.height) wrong = "a row outside the sensor";
      if (x % 32 != 0) wrong = "a vector that does not begin at a multiple of 32";
      if (lower == 0)
        wrong = "a vector without events";
      else if (x + 31 - __builtin_clz(lower) >= size.width)
        wrong = "a column outside the sensor";
    } else {
      wrong = "a type that is not to be written";
    }
    if (!wrong.empty()) return at(i / 2, wrong);
  }
  return {};
}

}  // namespace evt_validator
