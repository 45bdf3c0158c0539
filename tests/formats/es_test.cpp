// SPDX-License-Identifier: LGPL-2.1-or-later
// Hand-made Event Streams.
#include "src/formats/es/es.hpp"

#include <gtest/gtest.h>

#include "tests/formats/recordings.hpp"

namespace {

using namespace eventcamera;
using recordings::Bytes;
using recordings::decode;

Bytes file(std::uint8_t type, const Bytes& body, std::uint8_t version = 2) {
  // Of 320x240 pixels.
  Bytes bytes{'E', 'v', 'e',     'n', 't', ' ',  'S',  't',  'r',  'e',
              'a', 'm', version, 0,   0,   type, 0x40, 0x01, 0xf0, 0};
  for (const auto byte : body) bytes.push_back(byte);
  return bytes;
}

TEST(EventStream, ReadsDvsEventsWithRowsFromTheBottom) {
  const auto decoder = make_event_stream_decoder();
  const auto decoded = decode(*decoder, file(1, {5 << 1 | 1, 0x3f, 0x01, 0,   0,  //
                                                 0xff,       0xff, 0xfe,          //
                                                 126 << 1,   0,    0,    239, 0,  //
                                                 0,          0x40, 0x01, 0,   0,  //
                                                 0,          0,    0,    240, 0}));
  EXPECT_EQ(decoded.events, (std::vector{AbsoluteEvent::at(319, 239, 5, Polarity::on),
                                         AbsoluteEvent::at(0, 0, 5 + 254 + 126, Polarity::off)}));
  EXPECT_EQ(decoder->size(), (SensorSize{320, 240}));
  EXPECT_EQ(decoder->corruption().outside, 2U);
  EXPECT_EQ(decoder->corruption().places, 0U);
}

TEST(EventStream, ReadsTheChangesAmongAtisEvents) {
  const auto decoder = make_event_stream_decoder();
  const auto decoded =
      decode(*decoder, file(2, {5 << 2 | 2,  1,    0,    239, 0,     // ON
                                1 << 2 | 1,  1,    0,    239, 0,     // an exposure starts
                                0xfc,        0xfd, 0xff,             // 0, 63 and 189 us
                                62 << 2 | 3, 1,    0,    239, 0,     // and ends
                                0,           2,    0,    238, 0}));  // OFF
  EXPECT_EQ(decoded.events,
            (std::vector{AbsoluteEvent::at(1, 0, 5, Polarity::on),
                         AbsoluteEvent::at(2, 1, 5 + 1 + 63 + 189 + 62, Polarity::off)}));
  EXPECT_EQ(decoder->corruption().outside, 0U);
  EXPECT_EQ(decoder->corruption().skipped, 2U);
}

TEST(EventStream, ReadsColourEventsWithoutTheirColours) {
  const auto decoder = make_event_stream_decoder();
  const auto decoded =
      decode(*decoder, file(4, {5,    1,    0,    239, 0, 255, 0, 128,        //
                                0xff, 0xfe, 253,  2,   0, 0,   0, 1,   2, 3,  // 254 us, a reset
                                0,    0x40, 0x01, 0,   0, 9,   9, 9}));       // outside
  EXPECT_EQ(decoded.events, (std::vector{AbsoluteEvent::at(1, 0, 5, Polarity::on),
                                         AbsoluteEvent::at(2, 239, 5 + 254 + 253, Polarity::on)}));
  EXPECT_EQ(decoder->corruption().skipped, 2U);
  EXPECT_EQ(decoder->corruption().outside, 1U);
}

TEST(EventStream, IsAnErrorThatSaysWhy) {
  const auto error = [](const Bytes& bytes) {
    return recordings::refusal(*make_event_stream_decoder(), bytes);
  };
  EXPECT_NE(error({}), "");
  EXPECT_NE(error({'E', 'v', 'e'}), "");
  EXPECT_NE(error({'E', 'v', 'i'}), "");
  EXPECT_NE(error(file(1, {}, 1)).find("1.0"), std::string::npos);
  EXPECT_NE(error(file(0, {})).find("Export them"), std::string::npos);
  EXPECT_NE(error(file(9, {})).find('9'), std::string::npos);
  auto no_rows = file(1, {});
  no_rows[18] = no_rows[19] = 0;
  EXPECT_NE(error(no_rows).find("320 x 0"), std::string::npos);
}

TEST(EventStream, IsWrittenByteByByte) {
  const auto encoder = make_event_stream_encoder({320, 240});
  const std::vector events{AbsoluteEvent::at(319, 239, 5, Polarity::on),
                           AbsoluteEvent::at(0, 0, 5 + 126, Polarity::off),
                           AbsoluteEvent::at(0, 0, 5 + 126 + 127, Polarity::off)};
  EXPECT_EQ(recordings::encode(*encoder, events),
            file(1, {5 << 1 | 1, 0x3f, 0x01, 0, 0, 126 << 1, 0, 0, 239, 0, 0xff, 0, 0, 0, 239, 0}));
  EXPECT_THROW(make_event_stream_encoder({16385, 1}), std::invalid_argument);
}

TEST(EventStream, CountsRowsFromTheTopWhereItIsTold) {
  const std::vector events{AbsoluteEvent::at(319, 239, 5, Polarity::on),
                           AbsoluteEvent::at(0, 0, 6, Polarity::off)};
  const auto encoder = make_event_stream_encoder({320, 240}, EsOrigin::top_left);
  const auto bytes = recordings::encode(*encoder, events);
  EXPECT_EQ(bytes, file(1, {5 << 1 | 1, 0x3f, 0x01, 239, 0, 1 << 1, 0, 0, 0, 0}));
  EXPECT_EQ(decode(*make_event_stream_decoder(EsOrigin::top_left), bytes).events, events);
}

TEST(EventStream, LeavesNothingOutOfALongRecordingWithoutPauses) {
  std::vector<AbsoluteEvent> events;
  const auto step = Microseconds{11} * 3'600'000'000;
  events.push_back(AbsoluteEvent::at(1, 2, 0, Polarity::on));
  // Steps without a byte of their own must count, too, before a pause.
  for (int i = 0; i < 1000; ++i)
    events.push_back(AbsoluteEvent::at(1, 2, events.back().t + 100, Polarity::on));
  events.push_back(AbsoluteEvent::at(1, 2, step, Polarity::on));
  const auto encoder = make_event_stream_encoder({320, 240});
  const auto decoder = make_event_stream_decoder();
  EXPECT_EQ(decode(*decoder, recordings::encode(*encoder, events)).events, events);
}

}  // namespace
