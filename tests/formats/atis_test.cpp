// SPDX-License-Identifier: LGPL-2.1-or-later
// Files of N-MNIST, made byte by byte.
#include "src/formats/atis/atis_bin.hpp"

#include <gtest/gtest.h>

#include "tests/formats/recognise.hpp"
#include "tests/formats/recordings.hpp"

namespace {

using namespace eventcamera;
using recordings::decode;
using Bytes = std::vector<std::uint8_t>;

constexpr SensorSize n_mnist{34, 34};

TEST(AtisBin, ReadsEventsOfFortyBits) {
  const auto decoder = make_atis_bin_decoder({});
  const auto decoded = decode(*decoder, Bytes{
                                            10, 30, 0x00, 0x03, 0xb7,   // OFF at 951 us
                                            0, 0, 0x81, 0x00, 0x00,     // ON at 65536 us
                                            255, 239, 0x7f, 0xff, 0xff  // the last time
                                        });
  EXPECT_EQ(decoded.events, (std::vector{AbsoluteEvent::at(10, 30, 951, Polarity::off),
                                         AbsoluteEvent::at(0, 0, 65536, Polarity::on),
                                         AbsoluteEvent::at(255, 239, 0x7fffff, Polarity::off)}));
  EXPECT_EQ(decoder->size(), SensorSize{});
}

TEST(AtisBin, AddsOverflowsAndWraps) {
  const auto decoder = make_atis_bin_decoder(n_mnist);
  const auto decoded = decode(*decoder, Bytes{1, 2,   0x80, 0,    1,     //
                                              0, 240, 0,    0,    0,     // an overflow
                                              1, 2,   0x80, 0,    2,     //
                                              1, 2,   0xff, 0xff, 0xf0,  //
                                              1, 2,   0x80, 0,    5});   // a wrap
  constexpr Microseconds overflow = 8192;
  EXPECT_EQ(decoded.events,
            (std::vector{AbsoluteEvent::at(1, 2, 1, Polarity::on),
                         AbsoluteEvent::at(1, 2, overflow + 2, Polarity::on),
                         AbsoluteEvent::at(1, 2, overflow + 0x7ffff0, Polarity::on),
                         AbsoluteEvent::at(1, 2, overflow + 0x800005, Polarity::on)}));
}

TEST(AtisBin, KeepsDisorderAcrossAWrap) {
  const auto decoder = make_atis_bin_decoder(n_mnist);
  const auto decoded = decode(*decoder, Bytes{1, 2,   0xff, 0xff, 0xff,  //
                                              1, 2,   0x80, 0,    2,     // a wrap
                                              1, 2,   0xff, 0xff, 0xfe,  // from before it
                                              0, 240, 0,    0,    0,     // an overflow
                                              1, 2,   0x80, 0,    3});
  constexpr Microseconds overflow = 8192;
  std::vector<Microseconds> times;
  for (const auto& event : decoded.events) times.push_back(event.t);
  EXPECT_EQ(times, (std::vector<Microseconds>{0x7fffff, 0x800002, 0x7ffffe, overflow + 0x800003}));
}

TEST(AtisBin, CountsEventsOutsideTheSensorAndATruncatedOne) {
  const auto decoder = make_atis_bin_decoder(n_mnist);
  const auto decoded =
      decode(*decoder, Bytes{34, 0, 0x80, 0, 1, 0, 34, 0, 0, 1, 0, 0, 0, 0, 2, 9, 9});
  EXPECT_EQ(decoded.events, (std::vector{AbsoluteEvent::at(0, 0, 2, Polarity::off)}));
  EXPECT_EQ(decoder->corruption().outside, 2U);
  EXPECT_EQ(decoder->corruption().places, 1U);
}

Bytes some_file() {
  recordings::Random random(1);
  Bytes bytes;
  std::uint32_t t = 400;
  for (int i = 0; i < 1000; ++i) {
    t += static_cast<std::uint32_t>(recordings::below(random, 300));
    const auto polarity = static_cast<std::uint8_t>(recordings::below(random, 2) << 7);
    bytes.insert(bytes.end(), {static_cast<std::uint8_t>(recordings::below(random, 34)),
                               static_cast<std::uint8_t>(recordings::below(random, 34)),
                               static_cast<std::uint8_t>(t >> 16 | polarity),
                               static_cast<std::uint8_t>(t >> 8), static_cast<std::uint8_t>(t)});
  }
  return bytes;
}

TEST(AtisBin, IsRecognisedByTheOrderOfItsTimes) {
  const auto file = some_file();
  EXPECT_EQ(recognise(file), (Recognised{"application/x-atis-bin", Likelihood::high}));
  EXPECT_EQ(recognise(std::span(file).first(500)), Recognised{}) << "too few events";

  auto shifted = file;
  shifted.erase(shifted.begin());
  EXPECT_EQ(recognise(shifted), Recognised{});
  EXPECT_EQ(recognise(Bytes(5000)), Recognised{});
  recordings::Random random(1);
  for (int i = 0; i < 200; ++i) {
    Bytes noise(5000);
    for (auto& byte : noise) byte = static_cast<std::uint8_t>(random());
    EXPECT_EQ(recognise(noise), Recognised{});
    for (std::size_t at = 0; at < noise.size(); ++at)
      noise[at] = static_cast<std::uint8_t>(at / static_cast<std::size_t>(1 + i % 7));
    EXPECT_EQ(recognise(noise), Recognised{});
  }
}

}  // namespace
