// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gtest/gtest.h>

#include <cstdio>
#include <memory>

#include "tests/formats/decoders.hpp"
#include "tests/formats/recordings.hpp"

namespace {

using namespace recordings;

struct Read {
  Events events;
  Corruption corruption;
  SensorSize size;
};

Read read(std::string_view text, const TableSettings& settings = {}) {
  const auto decoder = make_csv_decoder(settings);
  auto events = decode(*decoder, bytes_of(text)).events;
  return {std::move(events), decoder->corruption(), decoder->size()};
}

AbsoluteEvent on(int x, int y, Microseconds t) {
  return AbsoluteEvent::at(x, y, t, Polarity::on);
}

AbsoluteEvent off(int x, int y, Microseconds t) {
  return AbsoluteEvent::at(x, y, t, Polarity::off);
}

/// Events of two lines.
const Events two = {on(3, 4, 10), off(5, 6, 12)};

void expect_two(std::initializer_list<const char*> texts, const TableSettings& settings = {}) {
  for (const auto* const text : texts) {
    const auto found = read(text, settings);
    EXPECT_EQ(found.events, two) << text;
    EXPECT_EQ(found.corruption.places, 0U) << text;
  }
}

/// Message of the error for a text that is refused.
std::string error_of(std::string_view text) {
  try {
    read(text);
  } catch (const UnsupportedFormat& error) {
    return error.what();
  }
  return "none";
}

bool mentions(const std::string& message, std::string_view words) {
  return message.find(words) != std::string::npos;
}

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

TEST(Csv, ColumnsByNames) {
  expect_two({"t,x,y,p\n10,3,4,1\n12,5,6,0\n", "x;y;polarity;timestamp\n3;4;1;10\n5;6;-1;12\n",
              "\"X\", \"Y\", \"Pol\", \"Time\"\r\n3, 4, True, 10\r\n5, 6, False, 12",
              "id t   x y p note\n1 10 3  4 1 a\n2 12 5 6 0 b\n",
              "\xef\xbb\xbft,x,y,p\n10,3,4,1\n12,5,6,0\n",
              "t,x@640,y@480,on\r\n10,3,4,1\r\n12,5,6,0\r\n"});
  EXPECT_EQ(read("t,x@640,y@480,on\r\n10,3,4,1\r\n").size, (SensorSize{640, 480}));
}

TEST(Csv, ColumnsByTheFirstLines) {
  expect_two({"10,3,4,1\n12,5,6,0\n", "3,4,1,10\n5,6,0,12\n", "3,4,1,10\n5,6,-1,12\n",
              "0.000010 3 4 1\n0.000012 5 6 0\n", "3\t4\t1e-5\t1\n5\t6\t1.2e-5\t-1\n",
              "# t x y p\n\n10 3 4 true\n# more\n12 5 6 FALSE",
              "%geometry:640,480\n3,4,1,10\n5,6,0,12\n", "240 180\n0.00001 3 4 1\n0.000012 5 6 0\n",
              "1.0e-05 3.00e+00 4.00e+00 1.00e+00\n1.2e-05 5.00e+00 6.00e+00 0.00e+00\n"});
  EXPECT_EQ(read("%geometry:640,480\n3,4,1,10\n").size, (SensorSize{640, 480}));
  // The only events that could be txyp as well.
  EXPECT_EQ(read("%geometry:640,480\n5,3,1,0\n").events, Events{on(5, 3, 0)});
  EXPECT_EQ(read("240 180\n0.00001 3 4 1\n").size, (SensorSize{240, 180}));
  // Out of order, but with one column of seconds.
  EXPECT_EQ(read("3 4 0.00001 1\n5 6 0.000002 0\n").events, (Events{on(3, 4, 10), off(5, 6, 2)}));
}

TEST(Csv, OrderAndUnitAsSet) {
  TableSettings settings;
  settings.columns = *columns_of("pyxt");
  EXPECT_EQ(read("1,4,3,10\n0,6,5,2\n", settings).events, (Events{on(3, 4, 10), off(5, 6, 2)}));
  EXPECT_EQ(read("a,b,c,d\n1,4,3,10\n", settings).events, (Events{on(3, 4, 10)}));
  settings.columns = *columns_of("txyp");
  settings.unit = TimeUnit::nanoseconds;
  EXPECT_EQ(read("10499 3 4 1\n10500 5 6 0\n", settings).events,
            (Events{on(3, 4, 10), off(5, 6, 10)}));
  settings.unit = TimeUnit::seconds;
  EXPECT_EQ(read("10 3 4 1\n", settings).events, (Events{on(3, 4, 10'000'000)}));
  settings = {.columns = *columns_of("-t-xyp"), .unit = {}, .size = {}};
  expect_two({"7,10,a,3,4,1\n7,12,b,5,6,0\n"}, settings);
  for (const auto* const letters : {"", "txy", "txyy", "txyq", "txypt", "TXYP"})
    EXPECT_FALSE(columns_of(letters)) << letters;
}

TEST(Csv, UnitByTheNameOfTheColumn) {
  expect_two(
      {"t_ns,x,y,p\n10000,3,4,1\n12000,5,6,0\n", "x y p Timestamp_NS\n3 4 1 10999\n5 6 0 12000\n",
       "t_us,x,y,p\n10.0,3,4,1\n12.0,5,6,0\n", "time [us];x;y;p\n10;3;4;1\n12;5;6;0\n",
       "t(s),x,y,p\n0.00001,3,4,1\n0.000012,5,6,0\n", "time_ms,x,y,p\n0.01,3,4,1\n0.012,5,6,0\n",
       "t_\xc2\xb5s,x,y,p\n10,3,4,1\n12,5,6,0\n", "t (events),x,y,p\n10,3,4,1\n12,5,6,0\n"});
  EXPECT_EQ(read("t_s,x,y,p\n1,3,4,1\n2,5,6,0\n").events,
            (Events{on(3, 4, 1'000'000), off(5, 6, 2'000'000)}));
  EXPECT_EQ(read("t_ms,x,y,p\n1,3,4,1\n2,5,6,0\n" + std::string(200, '#')).events,
            (Events{on(3, 4, 1000), off(5, 6, 2000)}));
  // Settings take precedence.
  EXPECT_EQ(read("t_us,x,y,p\n10000,3,4,1\n", {.unit = TimeUnit::nanoseconds}).events,
            Events{on(3, 4, 10)});
  EXPECT_THROW(read("t_kg,x,y,p\n10,3,4,1\n"), UnsupportedFormat);
}

/// Lines t x y p whose times are multiples of `step`, with gaps of up to `gap` steps.
std::string lines(std::int64_t first, std::int64_t step, unsigned gap, std::string_view separator) {
  std::mt19937 random(1);
  std::string text;
  for (int i = 0; i < 300; ++i, first += step * (random() % (gap + 1)))
    text += std::to_string(first) + std::string(separator) + std::to_string(i % 200) +
            std::string(separator) + "7" + std::string(separator) + "1\n";
  return text;
}

TEST(Csv, WholeNumbersBetweenBlanksTellTheirUnitOrAreRefused) {
  const auto first_of = [](const std::string& text) { return read(text).events.front().t; };
  // esim, of a camera with microseconds; and of DVS-Voltmeter.
  EXPECT_EQ(first_of(lines(5'000, 1000, 100, " ")), 5);
  EXPECT_EQ(first_of(lines(5'001, 1, 10, " ")), 5'001);
  // Only one of the units gives a plausible date.
  EXPECT_EQ(first_of(lines(1'468'939'993'067'416'019, 7, 100, " ")), 1'468'939'993'067'416);
  EXPECT_EQ(first_of(lines(1'468'939'993'067'416, 7, 100, " ")), 1'468'939'993'067'416);
  EXPECT_EQ(first_of(lines(1'468'939'993'067'416'019, 7, 100, ",")), 1'468'939'993'067'416);
  // Between commas, close times are microseconds.
  EXPECT_EQ(first_of(lines(5'001, 7, 100, ",")), 5'001);
  for (const auto& text :
       {lines(5'001, 7, 100, " "), lines(5'000, 0, 1, " "), lines(5'000, 1000, 100, ","),
        lines(5'001, 0, 1, "\t"), std::string("1000 3 4 1\n2000 3 4 1\n")}) {
    EXPECT_TRUE(mentions(error_of(text), "time-unit")) << text.substr(0, 40);
    EXPECT_EQ(read(text, {.unit = TimeUnit::nanoseconds}).events.front().t, text[0] - '0');
  }
}

TEST(Csv, FloatingPointMicroseconds) {
  expect_two({"1.000e+01 3.0e+00 4.0e+00 1.0e+00\n1.200e+01 5.0e+00 6.0e+00 0.0e+00\n",
              "10.000000 3.000000 4.000000 1.000000\n12.000000 5.000000 6.000000 0.000000\n",
              "t,x,y,p\n10.0,3,4,1\n12.0,5,6,0\n"});
  // Full seconds with all decimals.
  EXPECT_EQ(read("1.000000 3 4 1\n2.000000 5 6 0\n").events,
            (Events{on(3, 4, 1'000'000), off(5, 6, 2'000'000)}));
  EXPECT_THROW(read("1.0e+01 3.0e+00 4.0e+00 1.0e+00\n"), UnsupportedFormat);
}

TEST(Csv, IndexOfPandas) {
  expect_two({",t,x,y,p\n0,10,3,4,1\n1,12,5,6,0\n",
              "\"\",\"t\",\"x\",\"y\",\"p\"\n\"0\",10,3,4,1\n\"1\",12,5,6,0\n",
              " t x y p\n0 10 3 4 1\n1 12 5 6 0\n", "0,10,3,4,1\n1,12,5,6,0\n",
              "0,3,4,1,10\n1,5,6,0,12\n"});
  EXPECT_THROW(read("5,10,3,4,1\n9,12,5,6,0\n"), UnsupportedFormat);
}

TEST(Csv, SecondsAreExact) {
  // Also in long files, which take the fast path.
  std::string text;
  Events expected;
  for (int i = 0; i < 1000; ++i) {
    char line[64];
    std::snprintf(line, sizeof line, "1468939993.%06d%03d %d 2 1\n", i * 991 % 1'000'000, i % 1000,
                  i % 100);
    text += line;
    const int next = i % 1000 >= 750 ? 1 : 0;
    expected.push_back(on(i % 100, 2, 1'468'939'993'000'000 + i * 991 % 1'000'000 + next));
  }
  EXPECT_EQ(read(text).events, expected);
  const std::string fill(200, '#');
  EXPECT_EQ(read("0.0 1 1 1\n0.12345678949999 1 1 1\n0.1234565 1 1 1\n1 1 1 1\n2.5 1 1 0\n" + fill)
                .events,
            (Events{on(1, 1, 0), on(1, 1, 123457), on(1, 1, 123456), on(1, 1, 1'000'000),
                    off(1, 1, 2'500'000)}));
  // A double that is just below its microsecond, printed with all its digits.
  EXPECT_EQ(read("1.00000299999999995 1 1 1\n1.99999999999999978 1 1 1\n2.5 1 1 0\n" + fill).events,
            (Events{on(1, 1, 1'000'003), on(1, 1, 2'000'000), off(1, 1, 2'500'000)}));
  EXPECT_EQ(read("t_ns,x,y,p\n999,1,1,1\n1999,1,1,1\n2000,1,1,0\n" + fill).events,
            (Events{on(1, 1, 0), on(1, 1, 1), off(1, 1, 2)}));
}

TEST(Csv, CorruptionIsSkippedAndCounted) {
  std::string text = "t,x,y,p\n1,1,1,1\n2,2,2\n6,70000,6,1\n7,7,40000,1\n8,-1,8,1\n3,9,9,0\n";
  Events expected = {on(1, 1, 1), off(9, 9, 3)};
  for (const auto* const line :
       {"3,3,3,1,1\n", "four,4,4,1\n", "5,5,5,2\n", "99999999999999999999,1,1,1\n"}) {
    for (int i = 0; i < 250; ++i) {
      text += "10,10,10,1\n";
      expected.push_back(on(10, 10, 10));
    }
    text += line;
  }
  const auto found = read(text);
  EXPECT_EQ(found.events, expected);
  EXPECT_EQ(found.corruption.places, 5U);
  EXPECT_EQ(found.corruption.first_at, 16U);
  EXPECT_EQ(found.corruption.outside, 3U);
  events_however_split([] { return make_csv_decoder(); }, bytes_of(text));

  const auto outside = read("t,x,y,p\n1,9,7,1\n1,10,7,1\n1,9,8,1\n", {.size = {10, 8}});
  EXPECT_EQ(outside.events.size(), 1U);
  EXPECT_EQ(outside.corruption.outside, 2U);
}

TEST(Csv, MoreThanOneBadLineInAHundredIsRefused) {
  const auto lines = [](int good, int bad) {
    std::string text = "t,x,y,p\n";
    for (int i = 0; i < good; ++i) text += std::to_string(i) + ",1,1,1\n";
    for (int i = 0; i < bad; ++i) text += "bad,1,1,1\n";
    return text + "5000,1,1,1\n";
  };
  EXPECT_EQ(read(lines(100, 1)).corruption.places, 1U);
  EXPECT_EQ(read(lines(10'000, 100)).corruption.places, 100U);
  EXPECT_TRUE(mentions(error_of(lines(3, 1)), "line 5: \"bad,1,1,1\""));
  EXPECT_TRUE(mentions(error_of(lines(1000, 15)), "line 1002: "));
  EXPECT_TRUE(mentions(error_of(lines(10'000, 150)), "line 10002: "));
  // Separators of thousands, a decimal comma between commas, and rows with more fields than names.
  EXPECT_TRUE(mentions(error_of("t,x,y,p\n100,10,20,1\n1,300,11,21,0\n1,000,400,12,22,1\n"),
                       "line 3: \"1,300,11,21,0\" (fields: 5, expected: 4)"));
  EXPECT_NE(error_of("t,x,y,p\n0,000100,10,20,1\n0,001300,11,21,0\n"), "none");
  EXPECT_NE(error_of("t,x,y,p\n100,10,20,1,5\n200,11,21,0,5\n"), "none");
  // A last line may be cut off.
  EXPECT_EQ(read("t,x,y,p\n1,1,1,1\n2,1,").events.size(), 1U);
}

TEST(Csv, NumbersAsSpreadsheetsWriteThem) {
  const Events expected = {on(10, 20, 100), off(11, 21, 200), on(12, 22, 1300),
                           on(13, 23, 1'000'400)};
  for (const auto* const text : {
           "t;x;y;p\n0,000100;10;20;1\n0,000200;11;21;0\n0,001300;12;22;1\n1,000400;13;23;1\n",
           "t\tx\ty\tp\n0,0001\t10\t20\t1\n0,0002\t11\t21\t0\n0,0013\t12\t22\t1\n1,0004\t13\t23\t"
           "1\n",
           "0,0001 10 20 1\n0,0002 11 21 0\n0,0013 12 22 1\n1,0004 13 23 1\n",
           "t,x,y,p\n\"0,0001\",10,20,1\n\"0,0002\",11,21,0\n\"0,0013\",12,22,1\n\"1,0004\",13,23,"
           "1\n",
           "t;x;y;p\n100,0;10,0;20,0;1,0\n200,0;11,0;21,0;0,0\n1.300,0;12,0;22,0;1,0\n1.000.400,0;"
           "13,0;"
           "23,0;1,0\n",
           "t;x;y;p\n100;10;20;1\n200;11;21;0\n1,300;12;22;1\n1,000,400;13;23;1\n",
           "t,x,y,p\n100,10,20,1\n200,11,21,0\n\"1,300\",12,22,1\n\"1,000,400\",13,23,1\n",
           "t;x;y;p\n100;10;20;1\n200;11;21;0\n1'300;12;22;1\n1'000'400;13;23;1\n",
           "\"t\",\"x\",\"y\",\"p\"\n\"100\",\"10\",\"20\",\"1\"\n\"200\",\"11\",\"21\",\"0\"\n"
           "\"1300\",\"12\",\"22\",\"1\"\n\"1000400\",\"13\",\"23\",\"1\"\n",
           "t,x,y,p,\n100,10,20,1,\n200,11,21,0,\n1300,12,22,1,\n1000400,13,23,1,\n",
       })
    EXPECT_EQ(read(text).events, expected) << text;
  EXPECT_TRUE(mentions(error_of("t;x;y;p\n1,300;12;22;1\n1,400;13;23;1\n"), "decimal point"));
  EXPECT_NE(error_of("t;x;y;p\n1.300;12;22;1\n1.000.400;13;23;1\n"), "none");
}

TEST(Csv, PolaritiesOfAnyTool) {
  expect_two(
      {"t,x,y,p\n10,3,4,2\n12,5,6,1\n", "10,3,4,2\n12,5,6,1\n", "t,x,y,p\n10,3,4,ON\n12,5,6,OFF\n",
       "t,x,y,p\n10,3,4,pos\n12,5,6,neg\n", "t,x,y,p\n10,3,4,1\n12,5,6,4294967295\n",
       "t,x,y,p\n10,3,4,1.0\n12,5,6,-1.0\n", "10 3 4 on\n12 5 6 off\n# end\n"},
      {.unit = TimeUnit::microseconds});
  // Also in long files, where 1 is read fast elsewhere.
  std::string text = "t,x,y,p\n";
  for (int i = 0; i < 1000; ++i) text += std::to_string(i) + (i % 4 == 0 ? ",3,4,2\n" : ",3,4,1\n");
  EXPECT_EQ(std::ranges::count(read(text).events, Polarity::on, &AbsoluteEvent::polarity), 250);
  EXPECT_TRUE(mentions(error_of("t,x,y,p\n1,1,1,0\n2,1,1,1\n3,1,1,2\n4,1,1,3\n"), "are 0 1 2 3;"));
  EXPECT_TRUE(mentions(error_of("t,x,y,p\n1,1,1,0\n2,1,1,255\n"), "unsigned"));
}

TEST(Csv, ImplausibleTimesAreRefused) {
  const auto table = [](const auto& time) {
    std::string text = "t,x,y,p\n";
    for (int i = 0; i < 1000; ++i) text += time(i) + ",3,4," + (i % 2 == 0 ? "1\n" : "-1\n");
    return text;
  };
  // Nanoseconds, microseconds with fractions, frame numbers, nanoseconds since boot, milliseconds
  // since 1970.
  const std::string texts[] = {
      table([](int i) { return std::to_string(5000 + i * 1234); }),
      table([](int i) { return std::to_string(i * 10) + ".25"; }),
      table([](int i) { return std::to_string(i / 100); }),
      table([](int i) { return std::to_string(5'000'000'000'000 + i * 200); }),
      table([](int i) { return std::to_string(1'600'000'000'000 + i / 10); }),
      "t,x,y,p\n100007,1,1,1\n200007,1,1,-1\n1300007,1,1,1\n1000400007,1,1,1\n",
      "t,x,y,p\n100.5,1,1,1\n200.5,1,1,-1\n20000.5,1,1,1\n1000400.5,1,1,1\n",
  };
  for (const auto& text : texts) {
    EXPECT_TRUE(mentions(error_of(text), "time-unit")) << text.substr(0, 60);
    EXPECT_FALSE(read(text, {.unit = TimeUnit::nanoseconds}).events.empty());
  }
  // A day's pause, and frames at their times, are plausible.
  EXPECT_EQ(read(table([](int i) {
              return std::to_string(i * 50 + i / 500 * 86'400'000'000);
            })).events.size(),
            1000U);
  EXPECT_EQ(read(table([](int i) { return std::to_string(i / 50 * 33'333); })).events.size(),
            1000U);
}

TEST(Csv, NamesOfAnyTool) {
  expect_two(
      {"event_timestamp,x,y,polarity\n10,3,4,1\n12,5,6,0\n", "row,col,t,p\n4,3,10,1\n6,5,12,0\n",
       "x_coords,y_coords,timestamps,polarities\n3,4,10,1\n5,6,12,0\n",
       "timestamp_microseconds,x,y,p\n10,3,4,1\n12,5,6,0\n",
       "t_\xce\xbcs,x,y,p\n10,3,4,1\n12,5,6,0\n", "TD.x TD.y TD.p TD.ts\n3 4 1 10\n5 6 0 12\n",
       "'t','x','y','p'\n10,3,4,1\n12,5,6,0\n", "# y x p t\n4 3 1 10\n6 5 0 12\n",
       "#y,x,p,t\n4,3,1,10\n6,5,0,12\n", "# y [px] x [px] p t [us]\n4 3 1 10\n6 5 0 12\n",
       "% columns: y, x, p, t\n4,3,1,10\n6,5,0,12\n"},
      {.unit = TimeUnit::microseconds});
  // The last two: names that do not fit the lines, and comments with other words.
  expect_two({"# t [ns] y x p\n10000 4 3 1\n12000 6 5 0\n", "# t x y p label\n10,3,4,1\n12,5,6,0\n",
              "# the events: t, x, y and p\n3,4,1,10\n5,6,0,12\n"});
}

TEST(Csv, Utf16IsReadAsUtf8) {
  for (const bool is_big : {false, true}) {
    Bytes bytes = is_big ? Bytes{0xfe, 0xff} : Bytes{0xff, 0xfe};
    for (const unsigned unit : u"t_\u03bcs;x;y;p;\U0001f600\r\n10;3;4;1;a\r\n12;5;6;0;b\r\n") {
      if (unit == 0) continue;
      bytes.push_back(static_cast<std::uint8_t>(is_big ? unit >> 8 : unit));
      bytes.push_back(static_cast<std::uint8_t>(is_big ? unit : unit >> 8));
    }
    EXPECT_EQ(events_however_split([] { return make_csv_decoder(); }, bytes), two);
  }
  EXPECT_THROW(read("5"), UnsupportedFormat);
}

TEST(Csv, ALongLineIsSkippedWithoutBeingKept) {
  std::string text = "t,x,y,p\n1,1,1,1\n";
  for (int i = 0; i < 300; ++i) text += "2,1,1,1\n";
  const auto at = text.size();
  text += "3,1,1,";
  text.append(1'000'000, '1');
  text += "\n4,1,1,1\n";
  text += "5,1,1,1" + std::string(4089, ' ') + "\n";  // maximum length
  text += "6,1,1,1" + std::string(4090, ' ') + "\n";
  text += "7,1,1,1\n";
  const auto found = read(text);
  EXPECT_EQ(found.events.size(), 304U);
  EXPECT_EQ(found.corruption.places, 2U);
  EXPECT_EQ(found.corruption.first_at, at);
  events_however_split([] { return make_csv_decoder(); }, bytes_of(text));
}

TEST(Csv, WhatIsNoTextOfEventsIsRefused) {
  std::string noise;
  std::mt19937 random(3);
  for (int i = 0; i < 200'000; ++i) noise += static_cast<char>(random());
  for (const std::string& text :
       {std::string("hello\n"), std::string("{\"a\": 1}\n"), std::string("1 2 3\n4 5 6\n7 8 9\n"),
        std::string("% evt 3.0\n% end\n\x01\x02\x03\n"), std::string(100'000, '1'),
        std::string(100'000, '\0'), noise, std::string("5,6,7,8\n9,10,11,12\n"),
        std::string("5,6,7,1\n3,6,6,1\n")})
    EXPECT_THROW(read(text), UnsupportedFormat) << text.substr(0, 40);
}

TEST(Csv, AHeaderAloneOrNothingIsARecordingWithoutEvents) {
  for (const std::string text :
       {"t,x,y,p\n", "t,x,y,p", "# t,x,y,p\n", "%geometry:640,480\n", "\n", ""}) {
    const auto found = read(text);
    EXPECT_TRUE(found.events.empty()) << text;
    EXPECT_EQ(found.corruption.places, 0U) << text;
  }
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
  encoder->encode(Events{on(1, 2, 3)}, bytes);  // without
  encoder->label(labels);
  encoder->encode(Events{on(4, 5, 6)}, bytes);
  encoder->encode(Events{on(7, 8, 9)}, bytes);
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
        events.insert(events.begin(), {on(0, 0, -3'000'001), on(0, 0, -1)});
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
