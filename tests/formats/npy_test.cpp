// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <memory>

#include "src/core/sensor_size.hpp"
#include "src/formats/numpy/npy_decoder.hpp"
#include "src/formats/numpy/npy_encoder.hpp"
#include "src/formats/numpy/npy_header.hpp"
#include "tests/formats/recordings.hpp"

namespace {

using namespace recordings;

std::unique_ptr<NpyDecoder> make_decoder() {
  return std::make_unique<NpyDecoder>();
}

Events events_of(const Bytes& bytes) {
  NpyDecoder decoder;
  return decode(decoder, bytes).events;
}

Bytes with_header(const std::string& dictionary, int version = 1) {
  std::string text = std::string("\x93NUMPY") + static_cast<char>(version) + '\0';
  text += static_cast<char>(dictionary.size() & 0xff);
  text += static_cast<char>(dictionary.size() >> 8);
  if (version > 1) text += std::string(2, '\0');
  return bytes_of(text + dictionary);
}

template <class Number>
void append(Bytes& bytes, Number number, bool big_endian = false) {
  std::uint8_t raw[sizeof number];
  std::memcpy(raw, &number, sizeof number);
  if (big_endian) std::reverse(std::begin(raw), std::end(raw));
  bytes.insert(bytes.end(), std::begin(raw), std::end(raw));
}

TEST(Npy, ComesBack) {
  const auto events = random_events({640, 480}, 50'000, 1, -1000);
  NpyEncoder encoder;
  const auto unpatched = encode(encoder, events, 17);
  EXPECT_EQ((unpatched.size() - events.size() * NpyEncoder::event_bytes) % 64, 0U);
  auto patched = unpatched;
  apply_patch(encoder, patched);
  for (const auto& bytes : {unpatched, patched})
    EXPECT_TRUE(events_however_split(make_decoder, bytes) == events);
}

TEST(Npy, FieldsOfAnyKindInAnyOrder) {
  auto bytes = with_header(
      "{'descr': [('p', '|i1'), ('', '|V3'), ('label', '<U2'), ('time', '>f8'), ('box', '<f4', (2, "
      "2)), "
      "(('column', 'x'), '<f2'), ('y', '>u4')], 'fortran_order': False, 'shape': (103,), }\n",
      3);
  const auto element = [&](std::int8_t p, double t, std::uint16_t half, std::uint32_t y) {
    append(bytes, p);
    bytes.insert(bytes.end(), 3 + 8, 0xee);
    append(bytes, t, true);
    bytes.insert(bytes.end(), 16, 0xee);
    append(bytes, half);
    append(bytes, y, true);
  };
  element(1, 0.003820, 0x4900, 7);  // 10
  element(-1, 1468939993.0674, 0x0000, 8);
  Events expected = {AbsoluteEvent::at(10, 7, 3820, Polarity::on),
                     AbsoluteEvent::at(0, 8, 1'468'939'993'067'400, Polarity::off)};
  for (int i = 0; i < 100; ++i) {
    element(1, 0.003820, 0x4900, 7);
    expected.push_back(expected.front());
  }
  element(1, std::nan(""), 0x4900, 7);
  EXPECT_EQ(events_however_split(make_decoder, bytes), expected);
  NpyDecoder decoder;
  decode(decoder, bytes);
  EXPECT_EQ(decoder.corruption().places, 1U);
  EXPECT_EQ(decoder.corruption().first_at, bytes.size() - 42);
}

TEST(Npy, SmallElements) {
  auto bytes = with_header(
      "{'descr': [('t', '<u2'), ('x', '|u1'), ('y', '|u1'), ('p', '|b1')], 'fortran_order': True, "
      "'shape': (2,)}");
  for (const std::uint8_t byte : {1, 2, 3, 4, 1, 5, 6, 7, 8, 0}) bytes.push_back(byte);
  EXPECT_EQ(events_of(bytes), (Events{AbsoluteEvent::at(3, 4, 0x201, Polarity::on),
                                      AbsoluteEvent::at(7, 8, 0x605, Polarity::off)}));
}

/// Array of shape (N, 4).
template <class Number>
Bytes rows_of(const std::string& type, std::initializer_list<Number> numbers) {
  auto bytes = with_header("{'descr': '" + type + "', 'fortran_order': False, 'shape': (" +
                           std::to_string(numbers.size() / 4) + ", 4), }");
  for (const auto number : numbers) append(bytes, number, type.front() == '>');
  return bytes;
}

TEST(Npy, RowsOfNumbers) {
  const Events expected = {AbsoluteEvent::at(3, 4, 10, Polarity::on),
                           AbsoluteEvent::at(5, 6, 12, Polarity::off)};
  for (const auto& bytes : {rows_of<std::uint32_t>("<u4", {10, 3, 4, 1, 12, 5, 6, 0}),
                            rows_of<std::int64_t>(">i8", {3, 4, 1, 10, 5, 6, -1, 12}),
                            rows_of<double>("<f8", {10e-6, 3, 4, 1, 12e-6, 5, 6, 0}),
                            rows_of<double>("<f8", {3, 4, 10e-6, 1, 5, 6, 12e-6, -1}),
                            rows_of<double>("<f8", {10, 3, 4, 1, 12, 5, 6, 0})})
    EXPECT_EQ(events_however_split(make_decoder, bytes), expected);
  const auto mirrored = rows_of<std::int32_t>("<i4", {1, 4, 3, 10'999, 0, 6, 5, 12'000});
  EXPECT_THROW(events_of(mirrored), UnsupportedFormat);
  NpyDecoder decoder({.columns = *columns_of("pyxt"), .unit = TimeUnit::nanoseconds});
  EXPECT_EQ(decode(decoder, mirrored).events, expected);
}

TEST(Npy, ColumnsThatFollowEachOther) {
  for (const std::size_t count : {1, 7, 40'000}) {
    Events expected;
    for (std::size_t i = 0; i < count; ++i)
      expected.push_back(AbsoluteEvent::at(static_cast<int>(i % 640), static_cast<int>(i % 480),
                                           static_cast<Microseconds>(i * 3),
                                           i % 3 == 0 ? Polarity::on : Polarity::off));
    const auto number = std::to_string(count);
    for (const auto& layout :
         {"True, 'shape': (" + number + ", 4)", "False, 'shape': (4, " + number + ")"}) {
      if (count < 7 && layout.front() == 'F') continue;
      auto bytes = with_header("{'descr': '<i8', 'fortran_order': " + layout + ", }");
      for (const auto& event : expected) append<std::int64_t>(bytes, event.t);
      for (const auto& event : expected) append<std::int64_t>(bytes, event.x);
      for (const auto& event : expected) append<std::int64_t>(bytes, event.y());
      for (const auto& event : expected)
        append<std::int64_t>(bytes, event.polarity() == Polarity::on ? 1 : 0);
      EXPECT_EQ(events_of(bytes), expected) << layout;
    }
  }
}

/// Array of fields t, x, y and p of 64 bits.
template <class Time>
Bytes fields_of(const std::string& time_type, const std::vector<Time>& times,
                const std::vector<std::int64_t>& polarities) {
  auto bytes = with_header("{'descr': [('t', '" + time_type +
                           "'), ('x', '<i8'), ('y', '<i8'), ('p', '<i8')], 'fortran_order': False, "
                           "'shape': (" +
                           std::to_string(times.size()) + ",)}");
  for (std::size_t i = 0; i < times.size(); ++i) {
    append(bytes, times[i]);
    append<std::int64_t>(bytes, 3);
    append<std::int64_t>(bytes, 4);
    append(bytes, polarities[i % polarities.size()]);
  }
  return bytes;
}

TEST(Npy, RefusesDoubtfulPolaritiesAndTimes) {
  std::vector<std::int64_t> times, nanoseconds;
  for (int i = 0; i < 11'000; ++i) {
    times.push_back(i * 3);
    nanoseconds.push_back(i * 5003);
  }
  EXPECT_EQ(events_of(fields_of("<i8", times, {1, UINT32_MAX})).at(1).polarity(), Polarity::off);
  EXPECT_THROW(events_of(fields_of("<i8", times, {0, 1, 2, 3})), UnsupportedFormat);
  EXPECT_THROW(events_of(fields_of("<i8", nanoseconds, {1, -1})), UnsupportedFormat);
  // Not only in the first rows.
  std::vector<std::int64_t> late(10'000, 1);
  late.resize(11'000, 3);
  EXPECT_THROW(events_of(fields_of("<i8", times, late)), UnsupportedFormat);
}

TEST(Npy, TimesWithAFractionAreRounded) {
  const double epoch = 1.6e9;
  std::vector<Microseconds> times;
  for (const auto& event : events_of(fields_of<double>(
           "<f8", {33 * 1e-6, 1124 * 1e-6, (epoch + 33e-6) - epoch, 40.5e-6}, {1})))
    times.push_back(event.t);
  EXPECT_EQ(times, (std::vector<Microseconds>{33, 1124, 33, 40}));
}

TEST(Npy, UnitByTheNameOrTheNumbers) {
  const auto first_time = [](const std::string& name, const std::string& type, auto first,
                             auto second) {
    auto bytes = with_header("{'descr': [('" + name + "', '" + type +
                             "'), ('x', '<u2'), ('y', '<u2'), ('p', '<i4')], 'fortran_order': "
                             "False, 'shape': (2,)}");
    for (const auto t : {first, second}) {
      append(bytes, t);
      append<std::uint64_t>(bytes, 0);
    }
    return events_of(bytes).at(0).t;
  };
  constexpr std::int64_t epoch = 1'468'939'993'067'416'019;
  EXPECT_EQ(first_time("t", "<i8", std::int64_t{1500}, std::int64_t{2500}), 1500);
  EXPECT_EQ(first_time("t_ns", "<i8", std::int64_t{1999}, std::int64_t{2500}), 1);
  EXPECT_EQ(first_time("t_ns", "<i8", std::int64_t{-1001}, std::int64_t{2500}), -2);
  EXPECT_EQ(first_time("time_ms", "<u8", std::uint64_t{1500}, std::uint64_t{2500}), 1'500'000);
  EXPECT_EQ(first_time("ts", "<i8", epoch, epoch + 1), epoch / 1000);
  EXPECT_EQ(first_time("t", "<f8", 1.5, 2.0), 1'500'000);
  EXPECT_EQ(first_time("t", "<f8", 1500.0, 2500.0), 1500);
  EXPECT_EQ(first_time("t_s", "<f4", 1500.0F, 2500.0F), 1'500'000'000);
}

TEST(Npy, WhatIsWrongIsSkippedAndCounted) {
  auto bytes = with_header(
      "{'descr': [('t', '<u8'), ('x', '<i4'), ('y', '<i4'), ('p', '<i4')], 'fortran_order': False, "
      "'shape': (105,), }");
  const auto begin = bytes.size();
  const auto element = [&](std::uint64_t t, std::int32_t x, std::int32_t y) {
    append(bytes, t);
    append(bytes, x);
    append(bytes, y);
    append<std::int32_t>(bytes, 1);
  };
  element(5, 1, 1);
  // Past the largest signed number.
  element(1ULL << 63, 1, 1);
  element(6, -1, 1);
  element(7, 70000, 1);
  element(4, 1, max_side);
  for (int i = 0; i < 100; ++i) element(4, 1, max_side - 1);
  {
    NpyDecoder decoder;
    EXPECT_EQ(decode(decoder, bytes).events.size(), 101U);
    EXPECT_EQ(decoder.corruption().places, 1U);
    EXPECT_EQ(decoder.corruption().first_at, begin + 20);
    EXPECT_EQ(decoder.corruption().outside, 3U);
  }
  auto longer = bytes;
  longer.insert(longer.end(), 1000, 0);
  const Bytes shorter(bytes.begin(), bytes.end() - 20);
  const Bytes cut(bytes.begin(), bytes.end() - 1);
  for (const auto& corrupt : {longer, shorter, cut}) {
    NpyDecoder decoder;
    decode(decoder, corrupt);
    EXPECT_EQ(decoder.corruption().places, 2U);
    events_however_split(make_decoder, corrupt);
  }
}

TEST(Npy, WhatIsNoneIsRefused) {
  const auto refused = [](const Bytes& bytes) {
    EXPECT_THROW(events_of(bytes), UnsupportedFormat) << std::string(bytes.begin(), bytes.end());
  };
  refused({});
  refused(bytes_of("hello, this is a text"));
  refused(bytes_of("\x93NUMPY"));
  refused(bytes_of(std::string("\x93NUMPY\x04\0\x10\0", 10)));
  refused(bytes_of(std::string("\x93NUMPY\x02\0\xff\xff\xff\xff", 12) + "{'descr'"));
  for (const std::string array : {"'<f8', 'fortran_order': True, 'shape': (5, 4)",  // cut short
                                  "'<f8', 'fortran_order': False, 'shape': (3, 500)",
                                  "'<f8', 'fortran_order': False, 'shape': (5, 3)",
                                  "'<f8', 'fortran_order': False, 'shape': (5,)",
                                  "'<f8', 'fortran_order': False, 'shape': (5, 0)",
                                  "'<c8', 'fortran_order': False, 'shape': (5, 4)",
                                  "'<f8', 'fortran_order': False, 'shape': (5, 4, 1)",
                                  "'<f8', 'fortran_order': False, 'shape': ()"})
    refused(with_header("{'descr': " + array + ", }"));
  const std::string txy = "[('t', '<u8'), ('x', '<i4'), ('y', '<i4'), ";
  for (const std::string& descr :
       {std::string("[]"), std::string("[('t', '<u8')]"), std::string("[["), std::string("[("),
        txy + "]", txy + "('p', '<i4'), ('p', '<i4')]", txy + "('p', '<c8')]",
        txy + "('p', '<i3')]", txy + "('p', '<i4', (2,))]", txy + "('p', [('q', '<i4')])]",
        txy + "('p', '<i4'), ('', '|V99999999999')]", txy + "('p', '<i4')",
        txy + "('p', '<i4'), ('b', '|V60000', (65535, 65535))]"})
    refused(with_header("{'descr': " + descr + ", 'fortran_order': False, 'shape': (5,), }"));
  const auto fields = txy + "('p', '<i4')]";
  for (const std::string shape :
       {"()", "(5, 4)", "(-1,)", "(5", "5", "(99999999999999999999,)", "(x,)"})
    refused(
        with_header("{'descr': " + fields + ", 'fortran_order': False, 'shape': " + shape + ", }"));
  refused(with_header("{'descr': " + fields + ", 'fortran_order': False}"));
  refused(with_header("{'descr': " + fields + ", 'shape': (1,)} more"));
  refused(with_header("{'descr': " + fields + ", 'shape': (1,), 'other': 3}"));
}

}  // namespace
