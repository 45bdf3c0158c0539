// SPDX-License-Identifier: LGPL-2.1-or-later
// Numbers of text, and what we write as text; other_readers.py has the texts of others.
#include <gtest/gtest.h>

#include <memory>

#include "src/formats/text/csv_decoder.hpp"
#include "src/formats/text/csv_encoder.hpp"
#include "tests/formats/recordings.hpp"

namespace {

using namespace recordings;

TEST(Decimal, IsExact) {
  struct Case {
    const char* text;
    int power;
    std::int64_t value;
    bool whole;
  };
  for (const auto& [text, power, value, whole] : {
           Case{"0", 6, 0, true},
           {"-12", 0, -12, true},
           {"+12.50", 1, 125, true},
           {".5", 6, 500'000, true},
           {"5.", 0, 5, true},
           {"0.003820001", 6, 3820, false},
           {"0.0038195", 6, 3819, false},
           {"0.00381974", 6, 3819, false},
           {"0.00381975", 6, 3820, false},
           {"0.000003", 6, 3, true},
           {"2.999999999999999924e-06", 6, 3, false},  // 3e-6 as a double
           {"3.2999999999999996e-05", 6, 33, false},   // 33*1e-6
           {"0.0011239999999999998", 6, 1124, false},  // 1124*1e-6
           {"3.290176391601562e-05", 6, 33, false},    // (1.6e9 + 33e-6) - 1.6e9
           {"1600000000.123456740", 6, 1600000000123456, false},
           {"1600000000.123456999", 6, 1600000000123457, false},
           {"1600000000.123456", 6, 1600000000123456, true},
           {"-0.0000015", 6, -2, false},
           {"-3.000000000000000076e-06", 6, -3, false},
           {"0.00381949999999999999999999", 6, 3819, false},
           {"1.000000000000000000e+00", 0, 1, true},
           {"1.5E-6", 6, 1, false},
           {"1468939993.067416019", 6, 1468939993067416, false},
           {"9223372036854775807", 0, INT64_MAX, true},
           {"-9223372036854775807", 0, -INT64_MAX, true},
           {"9223372036854.775807", 6, INT64_MAX, true},
           {"123456", -3, 123, false},
           {"123500", -3, 123, false},
           {"123999", -3, 123, false},
           {"-123001", -3, -124, false},
           {"0e999999999999", 6, 0, true},
           {"1e-999999999999", 6, 0, false},
           {"100000000000000000000000000000e-29", 0, 1, true},
       }) {
    const auto decimal = read_decimal(text, power);
    ASSERT_TRUE(decimal) << text;
    EXPECT_EQ(decimal->value, value) << text;
    EXPECT_EQ(decimal->whole, whole) << text;
  }
  for (const auto* const text :
       {"", "-", ".", "e5", "1e", "1e+", "1.2.3", "1,2", "nan", "inf", " 1", "1 ", "0x10",
        "9223372036854775808", "1e19", "1e999999999999"})
    EXPECT_FALSE(read_decimal(text, 0)) << text;
}

std::vector<std::optional<EventColumn>> columns_in(const CsvFormat& format) {
  std::vector<std::optional<EventColumn>> columns(format.order.begin(), format.order.end());
  if (format.labels) columns.resize(6);
  return columns;
}

TEST(Csv, HasTheLabelsOfEvents) {
  const auto encoder = make_csv_encoder({.labels = true}, {640, 480});
  std::vector<std::uint8_t> bytes;
  const std::vector<Label> labels = {{300, Cause::leak}, {0, Cause::light}};
  const auto some = [](int x) { return Events{AbsoluteEvent::at(x, x + 1, x + 2, Polarity::on)}; };
  encoder->encode(some(1), bytes);  // without
  encoder->label(labels);
  encoder->encode(some(4), bytes);
  encoder->encode(some(7), bytes);
  EXPECT_EQ(std::string(bytes.begin(), bytes.end()),
            "t,x,y,p,cause,class\n3,1,2,1,0,0\n6,4,5,1,2,300\n9,7,8,1,1,0\n");
}

TEST(Csv, EveryFormatComesBack) {
  for (const auto& [name, description, format] : csv_formats()) {
    for (const SensorSize size : {SensorSize{1, 1}, {128, 128}, {1280, 720}}) {
      SCOPED_TRACE(testing::Message() << name << " " << size.width);
      auto events = random_events(size, 20'000, 1, 1000);
      const auto encoder = make_csv_encoder(format, size);
      // With a sensor of a few pixels, times and coordinates are indistinguishable; bursts and
      // silences make the unit ambiguous.
      const bool is_small = size.width < 100;
      TableSettings settings{.unit = format.unit};
      if (is_small) {
        settings.columns = columns_in(format);
        for (const Microseconds t : {-1, -3'000'001})
          events.insert(events.begin(), AbsoluteEvent::at(0, 0, t, Polarity::on));
      }
      const auto decoder = make_csv_decoder(settings);
      EXPECT_TRUE(decode(*decoder, encode(*encoder, events, 77), 0).events == events);
      EXPECT_EQ(decoder->corruption().places + decoder->corruption().outside, 0U);
      using Header = CsvFormat::Header;
      const auto header = format.header;
      const bool sized =
          header == Header::names_and_size || header == Header::geometry || header == Header::size;
      EXPECT_EQ(decoder->size(), sized ? size : SensorSize{});
    }
  }
}

}  // namespace
