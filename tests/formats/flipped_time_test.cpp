// SPDX-License-Identifier: LGPL-2.1-or-later
// A flipped bit in the time of EVT words costs the events up to the next TIME_HIGH, and no others.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "src/formats/evt/raw.hpp"
#include "tests/formats/pieces.hpp"
#include "tests/formats/random_events.hpp"

namespace {

using namespace eventcamera;
using Bytes = std::vector<std::uint8_t>;

constexpr SensorSize size{640, 480};

struct Words {
  EvtFormat format;
  std::size_t bytes;                   ///< of a word
  std::size_t upper_byte;              ///< of a word: its type and the upper bits of the time
  unsigned time_high;                  ///< type
  unsigned time_bits;                  ///< of a TIME_HIGH
  std::vector<unsigned> vectors = {};  ///< types that a mask of 32 bits follows
};

const std::vector<Words> all_words = {{EvtFormat::evt2, 4, 3, 0x8, 28},
                                      {EvtFormat::evt21, 8, 7, 0x8, 28},
                                      {EvtFormat::evt21_legacy, 8, 3, 0x8, 28},
                                      {EvtFormat::evt3, 2, 1, 0x8, 12},
                                      {EvtFormat::evt4, 4, 3, 0xe, 28, {0xc, 0xd}}};

/// Positions of the TIME_HIGH words.
std::vector<std::size_t> times_in(const Bytes& file, const Words& words) {
  std::vector<std::size_t> found;
  for (std::size_t at = 0; at < file.size(); at += words.bytes) {
    const unsigned type = file[at + words.upper_byte] >> 4;
    if (type == words.time_high) found.push_back(at);
    if (std::ranges::count(words.vectors, type) > 0) at += words.bytes;
  }
  return found;
}

std::vector<AbsoluteEvent> decode(const Bytes& file, EvtFormat format, Corruption& corruption) {
  const auto decoder = make_evt_decoder(format, size);
  auto events = pieces::decoded(*decoder, file).events;
  corruption = decoder->corruption();
  return events;
}

class FlippedTime : public testing::TestWithParam<Words> {
 protected:
  /// Flips a bit, and expects the same events but for those near the event that differs first: up
  /// to the next TIME_HIGH, or of the same row.
  void expect_few_differences(std::size_t byte, unsigned bit) {
    Bytes flipped = file_;
    flipped[byte] ^= static_cast<std::uint8_t>(1U << bit);
    Corruption corruption;
    const auto found = decode(flipped, GetParam().format, corruption);
    const auto first = std::ranges::mismatch(found, events_);
    if (first.in2 == events_.end()) return;
    const auto last = std::mismatch(found.rbegin(), found.rend(), events_.rbegin(), events_.rend());
    const auto different = last.second.base() - first.in2;
    const bool has_one_time =
        different <= 0 || first.in2->t / unit() == std::prev(last.second.base())->t / unit();
    EXPECT_TRUE(has_one_time || different < 40)
        << different << " events differ after bit " << bit << " of byte " << byte;
    const bool falls = !std::ranges::is_sorted(
        found, {}, [this](const AbsoluteEvent& event) { return event.t / unit(); });
    EXPECT_TRUE(corruption.places > 0 || !falls) << "bit " << bit << " of byte " << byte;
  }

  Microseconds unit() const { return GetParam().format == EvtFormat::evt3 ? 4096 : 64; }

  void record(Microseconds start) {
    events_ = random_events::make(size, 20'000, 4, start, {100'000});
    file_.clear();
    const auto encoder = make_evt_encoder(GetParam().format, size);
    encoder->encode(events_, file_);
    encoder->finish(file_);
  }

  std::vector<AbsoluteEvent> events_;
  Bytes file_;
};

TEST_P(FlippedTime, CostsTheEventsUpToTheNextTime) {
  const Words& words = GetParam();
  std::mt19937 random(3);
  for (const Microseconds start : {Microseconds{0}, Microseconds{3'600'000'000}}) {
    record(start);
    const auto times = times_in(file_, words);
    for (int i = 0; i < 60; ++i) {
      const auto at = times[random() % (times.size() - 2)];
      const auto bit = static_cast<unsigned>(random()) % words.time_bits;
      expect_few_differences(at + words.upper_byte - (words.time_bits + 3) / 8 + bit / 8, bit % 8);
    }
  }
}

TEST_P(FlippedTime, OrTypeCostsFewEvents) {
  const Words& words = GetParam();
  std::mt19937 random(5);
  record(0);
  for (int i = 0; i < 120; ++i) {
    const auto word = random() % (file_.size() / words.bytes - 100);
    expect_few_differences(word * words.bytes + words.upper_byte, 4 + random() % 4);
  }
}

INSTANTIATE_TEST_SUITE_P(Evt, FlippedTime, testing::ValuesIn(all_words));

}  // namespace
