// SPDX-License-Identifier: LGPL-2.1-or-later
// Files of N-MNIST, made byte by byte.
#include "src/formats/atis/atis_bin.hpp"

#include <gtest/gtest.h>

#include "tests/formats/recordings.hpp"

namespace {

using namespace eventcamera;
using recordings::Bytes;
using recordings::decode;

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
                                              1, 2,   0xff, 0xff, 0xff,  //
                                              1, 2,   0x80, 0,    2,     // a wrap
                                              1, 2,   0xff, 0xff, 0xfe,  // from before it
                                              0, 240, 0,    0,    0,     // an overflow
                                              1, 2,   0x80, 0,    3});
  constexpr Microseconds overflow = 8192;
  std::vector<Microseconds> times;
  for (const auto& event : decoded.events) times.push_back(event.t);
  EXPECT_EQ(times,
            (std::vector<Microseconds>{1, overflow + 2, overflow + 0x7fffff, overflow + 0x800002,
                                       overflow + 0x7ffffe, 2 * overflow + 0x800003}));
}

TEST(AtisBin, CountsEventsOutsideTheSensorAndATruncatedOne) {
  const auto decoder = make_atis_bin_decoder(n_mnist);
  const auto decoded =
      decode(*decoder, Bytes{34, 0, 0x80, 0, 1, 0, 34, 0, 0, 1, 0, 0, 0, 0, 2, 9, 9});
  EXPECT_EQ(decoded.events, (std::vector{AbsoluteEvent::at(0, 0, 2, Polarity::off)}));
  EXPECT_EQ(decoder->corruption().outside, 2U);
  EXPECT_EQ(decoder->corruption().places, 1U);
}

}  // namespace
