// SPDX-License-Identifier: LGPL-2.1-or-later
// What a live camera sends, found among padding, old bytes and losses: every event once, with its
// time, or counted as lost.
#include "src/formats/evt/word_scanner.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "src/formats/decoder.hpp"
#include "tests/formats/recordings.hpp"

namespace {

using namespace eventcamera;
using recordings::below;
using recordings::Bytes;
using recordings::Events;
using recordings::Random;
using Piece = WordScanner::Piece;

constexpr SensorSize sensor{320, 320};

struct Format {
  const char* name;
  EvtFormat format;
  std::size_t word;  ///< bytes
  Bytes end_marker;
};

void PrintTo(const Format& format, std::ostream* out) {
  *out << format.name;
}

const Format formats[] = {
    {"evt2", EvtFormat::evt2, 4, {0x19, 0x00, 0x00, 0xe0}},
    {"evt21", EvtFormat::evt21, 8, {0, 0, 0, 0, 0x19, 0x00, 0x00, 0xe0}},
    {"evt21_legacy", EvtFormat::evt21_legacy, 8, {0x19, 0x00, 0x00, 0xe0, 0, 0, 0, 0}},
    {"evt3", EvtFormat::evt3, 2, {0x19, 0xe0}},
    {"evt4", EvtFormat::evt4, 4, {0x19, 0x00, 0x00, 0x60}},
};

/// Events 37 us apart on average, each second one in the row of the one before.
Events some_events(std::size_t count, Microseconds start, unsigned seed = 1) {
  Random random(seed);
  Events events;
  auto t = start;
  for (std::size_t i = 0; i < count; ++i) {
    t += below(random, 75);
    const int y = i % 2 == 0 ? below(random, 320) : events.back().y();
    events.push_back(AbsoluteEvent::at(below(random, 320), y, t,
                                       below(random, 2) == 0 ? Polarity::off : Polarity::on));
  }
  return events;
}

/// Encodes events in transfers of 10 ms, as a camera that goes on.
class Camera {
 public:
  explicit Camera(const Format& format) : encoder_(make_evt_encoder(format.format, sensor)) {}

  Bytes transfer_of(std::span<const AbsoluteEvent> events) {
    Bytes bytes;
    encoder_->encode(events, bytes);
    return bytes;
  }

 private:
  std::unique_ptr<Encoder> encoder_;
};

std::vector<Events> in_transfers(const Events& events, Microseconds length = 10'000) {
  std::vector<Events> transfers;
  for (const auto& event : events) {
    const auto index = static_cast<std::size_t>((event.t - events.front().t) / length);
    if (transfers.size() <= index) transfers.resize(index + 1);
    transfers[index].push_back(event);
  }
  return transfers;
}

/// A scanner, and the decoder after it, which starts over after a gap, as evtdec does.
class Reader {
 public:
  Reader(const Format& format, Framing framing)
      : format_(format), scanner_(make_word_scanner(format.format, sensor, framing)) {}

  void scan(std::span<const std::uint8_t> bytes, bool is_discontinuous = false,
            std::optional<Microseconds> elapsed = std::nullopt) {
    // In memory of its own, so that sanitizers detect reads past its end.
    const Bytes copy(bytes.begin(), bytes.end());
    scanner_->scan({copy, is_discontinuous, elapsed}, pieces);
    decode();
  }

  void scan_pieces(const Bytes& bytes, std::size_t length) {
    for (const auto piece : recordings::pieces_of(bytes, length)) scan(piece);
    finish();
  }

  void finish() {
    scanner_->finish(pieces);
    decode();
    EXPECT_EQ(events.size(), counts().events);
  }

  const WordScanner::Counts& counts() const { return scanner_->counts(); }

  std::vector<Piece> pieces;
  Events events;

 private:
  void decode() {
    for (; decoded_ < pieces.size(); ++decoded_) {
      const auto& piece = pieces[decoded_];
      if (piece.is_discontinuous) {
        const auto order =
            format_.format == EvtFormat::evt21_legacy ? EvtFormat::evt21 : format_.format;
        decoder_ = make_evt_decoder(order, sensor);
        shift_.reset();
      } else {
        ASSERT_EQ(piece.start, pieces[decoded_ - 1].end);
      }
      ASSERT_LE(piece.start, piece.end);
      Decoded decoded;
      decoder_->decode(piece.words, decoded);
      for (auto event : decoded.events) {
        if (!shift_) {
          // As RecordingReader does.
          constexpr Microseconds range = Microseconds{1} << 24;
          const auto into = ((event.t - piece.start) % range + range) % range;
          ASSERT_LE(into, piece.end - piece.start) << "the first event is within its interval";
          shift_ = piece.start + into - event.t;
        }
        event.t += *shift_;
        events.push_back(event);
      }
    }
  }

  Format format_;
  std::unique_ptr<WordScanner> scanner_;
  std::unique_ptr<EventDecoder> decoder_;
  std::optional<Microseconds> shift_;
  std::size_t decoded_ = 0;
};

/// Events that were read beyond `sent`, each with its time, and those of `sent` that were not.
struct Comparison {
  std::size_t missing = 0;
  std::size_t wrong = 0;
};

Comparison compare(Events sent, Events read) {
  const auto before = [](const AbsoluteEvent& a, const AbsoluteEvent& b) {
    return std::tie(a.t, a.x, a.y_p) < std::tie(b.t, b.x, b.y_p);
  };
  std::ranges::sort(sent, before);
  std::ranges::sort(read, before);
  Events both;
  std::ranges::set_intersection(sent, read, std::back_inserter(both), before);
  return {sent.size() - both.size(), read.size() - both.size()};
}

class EveryFormat : public testing::TestWithParam<Format> {
 protected:
  const Format& format = GetParam();

  const Events sent = some_events(8'000, 1'000'000);

  Bytes sent_bytes() const { return Camera(format).transfer_of(sent); }

  /// A transfer as in a padded buffer: words, an end marker and old bytes.
  Bytes padded(Bytes words) const {
    words.insert(words.end(), format.end_marker.begin(), format.end_marker.end());
    Random random(3);
    while (words.size() < 8192) words.push_back(static_cast<std::uint8_t>(random()));
    return words;
  }

  /// Scans the transfers of a camera; the first one arrives after `elapsed`, if it is known.
  void scan_padded(Reader& reader, const Events& events, bool is_discontinuous = false,
                   std::optional<Microseconds> elapsed = std::nullopt) const {
    Camera camera(format);
    for (const auto& some : in_transfers(events)) {
      reader.scan(padded(camera.transfer_of(some)), std::exchange(is_discontinuous, false),
                  elapsed);
      if (elapsed) elapsed = 10'000;
    }
  }
};
INSTANTIATE_TEST_SUITE_P(, EveryFormat, testing::ValuesIn(formats),
                         [](const auto& tested) { return std::string(tested.param.name); });

TEST_P(EveryFormat, ReadsPaddedTransfers) {
  Reader reader(format, Framing::padded);
  scan_padded(reader, sent);
  reader.finish();
  EXPECT_EQ(reader.events, sent);
  EXPECT_EQ(reader.counts().events, sent.size());
  EXPECT_EQ(reader.counts().lost_bytes, 0U);
  EXPECT_EQ(reader.counts().gaps, 0U);
}

TEST_P(EveryFormat, ReadsBytesInPiecesOfAnySize) {
  const auto bytes = sent_bytes();
  for (const std::size_t length : {1, 3, 64, 4096, 1'000'000}) {
    SCOPED_TRACE(length);
    Reader reader(format, Framing::loose);
    reader.scan_pieces(bytes, length);
    EXPECT_EQ(reader.events, sent);
    EXPECT_EQ(reader.counts().lost_bytes, 0U);
    EXPECT_EQ(reader.counts().bytes, bytes.size());
  }
  // Full buffers have no end marker, and words are torn between them.
  Reader reader(format, Framing::padded);
  reader.scan_pieces(bytes, 64 * format.word + format.word / 2);
  EXPECT_EQ(reader.events, sent);
  EXPECT_EQ(reader.counts().lost_bytes, 0U);
}

TEST_P(EveryFormat, SkipsZerosAfterALostEndMarker) {
  Camera camera(format);
  Reader reader(format, Framing::padded);
  for (const auto& events : in_transfers(sent)) {
    auto bytes = camera.transfer_of(events);
    bytes.resize(16384);
    reader.scan(bytes);
  }
  reader.finish();
  EXPECT_EQ(reader.events, sent);
}

TEST_P(EveryFormat, CountsLostTransfers) {
  const auto transfers = in_transfers(sent);
  Camera camera(format);
  Reader reader(format, Framing::padded);
  Events kept;
  std::size_t dropped = 0;
  bool after_loss = false;
  for (std::size_t i = 0; i < transfers.size(); ++i) {
    const auto bytes = padded(camera.transfer_of(transfers[i]));
    if (i % 7 == 3) {
      dropped += transfers[i].size();
      after_loss = true;
      continue;
    }
    reader.scan(bytes, std::exchange(after_loss, false));
  }
  reader.finish();
  const auto [missing, wrong] = compare(sent, reader.events);
  EXPECT_EQ(wrong, 0U);
  EXPECT_EQ(missing, dropped + reader.counts().lost_events);
  EXPECT_LT(reader.counts().lost_events, sent.size() / 10);
  EXPECT_GE(reader.counts().gaps, transfers.size() / 7 - 1);
}

TEST_P(EveryFormat, DropsTransfersThatComeAgain) {
  Camera camera(format);
  Reader reader(format, Framing::padded);
  std::size_t again = 0;
  int number = 0;
  for (const auto& events : in_transfers(sent)) {
    const auto bytes = padded(camera.transfer_of(events));
    reader.scan(bytes);
    if (++number % 5 != 0) continue;
    for (int i = 0; i < 3; ++i) reader.scan(bytes);
    again += 3 * events.size();
  }
  reader.finish();
  const auto [missing, wrong] = compare(sent, reader.events);
  EXPECT_EQ(wrong, 0U);
  EXPECT_EQ(missing + again, reader.counts().lost_events);
  EXPECT_LT(missing, sent.size() / 10);
}

/// A transfer that ends early shows the words of an earlier one past its end.
TEST_P(EveryFormat, DropsOldWordsPastATornTransfer) {
  Camera camera(format);
  Reader reader(format, Framing::padded);
  Bytes buffer(8192);
  int number = 0;
  std::size_t old = 0;
  for (const auto& events : in_transfers(sent)) {
    auto bytes = camera.transfer_of(events);
    const bool is_torn = ++number % 6 == 0;
    if (!is_torn) bytes.insert(bytes.end(), format.end_marker.begin(), format.end_marker.end());
    std::ranges::copy(bytes, buffer.begin());
    reader.scan(buffer);
    old += is_torn ? 1 : 0;
  }
  reader.finish();
  const auto [missing, wrong] = compare(sent, reader.events);
  EXPECT_LE(missing, reader.counts().lost_events);
  EXPECT_LT(missing, sent.size() / 5);
  // Old words without a time, up to the end of the transfer, cannot be told from new ones.
  EXPECT_LE(wrong, old * (format.format == EvtFormat::evt3 ? 50 : 4));
}

TEST_P(EveryFormat, FindsWordsAgainAfterLostBytes) {
  const auto bytes = sent_bytes();
  Random random(7);
  Reader reader(format, Framing::loose);
  for (std::size_t at = 0; at < bytes.size();) {
    const auto length = std::min<std::size_t>(bytes.size() - at, 2000 + random() % 3000);
    reader.scan(std::span(bytes).subspan(at, length));
    at += length + 1 + random() % 40;
  }
  reader.finish();
  const auto [missing, wrong] = compare(sent, reader.events);
  // What is between two times is lost; in EVT3, 4 ms.
  EXPECT_LT(missing, sent.size() / 5);
  // Bytes lost between two times, in whole words, cannot be told from none in EVT3, where they may
  // include a row or a time.
  EXPECT_LT(wrong, sent.size() / 100);
  EXPECT_GT(reader.counts().gaps, 2U);
  EXPECT_LE(reader.counts().bytes + reader.counts().lost_bytes, bytes.size());
}

TEST_P(EveryFormat, KeepsTheTimeAcrossWraps) {
  // EVT3 wraps after 16 s, the others after 4.7 h.
  const Microseconds wrap =
      format.format == EvtFormat::evt3 ? Microseconds{1} << 24 : Microseconds{1} << 34;
  const auto events = some_events(8'000, wrap - 300'000);
  Reader reader(format, Framing::padded);
  scan_padded(reader, events);
  reader.finish();
  ASSERT_EQ(reader.events.size(), events.size());
  const auto shift = events.front().t - reader.events.front().t;
  EXPECT_EQ(shift % (Microseconds{1} << 24), 0);
  for (std::size_t i = 0; i < events.size(); ++i)
    ASSERT_EQ(reader.events[i].t + shift, events[i].t) << i;
  EXPECT_EQ(reader.counts().gaps, 0U);
}

TEST_P(EveryFormat, CountsTheWrapsOfALongGap) {
  auto events = some_events(2'000, 1'000'000);
  const auto later = some_events(2'000, events.back().t + 100'000'000, 2);
  Reader reader(format, Framing::padded);
  scan_padded(reader, events, false, 10'000);
  scan_padded(reader, later, true, 100'010'000);
  reader.finish();
  std::ranges::copy(later, std::back_inserter(events));
  const auto [missing, wrong] = compare(events, reader.events);
  EXPECT_EQ(wrong, 0U);
  EXPECT_LT(missing, 300U);
}

TEST_P(EveryFormat, FollowsACameraThatStartsOver) {
  const auto first = some_events(5'000, 9'000'000);
  const auto second = some_events(5'000, 1'000, 2);
  Reader reader(format, Framing::padded);
  for (const auto* events : {&first, &second}) scan_padded(reader, *events, false, 10'000);
  reader.finish();
  EXPECT_EQ(reader.events.size() + reader.counts().lost_events, first.size() + second.size());
  EXPECT_LT(reader.counts().lost_events, 700U);
  EXPECT_EQ(reader.counts().gaps, 1U);
  EXPECT_TRUE(std::ranges::is_sorted(reader.events, {}, &AbsoluteEvent::t));
  EXPECT_EQ(reader.events.back().t % (Microseconds{1} << 24), second.back().t);
}

/// A flipped bit costs what is between the times beside it, or the rest of a transfer.
TEST_P(EveryFormat, SurvivesFlippedBits) {
  const auto bytes = sent_bytes();
  Random random(5);
  for (const auto framing : {Framing::loose, Framing::padded}) {
    auto flipped = bytes;
    for (int i = 0; i < 8; ++i)
      flipped[random() % flipped.size()] ^= static_cast<std::uint8_t>(1 << below(random, 8));
    Reader reader(format, framing);
    reader.scan_pieces(flipped, 1024);
    const auto [missing, wrong] = compare(sent, reader.events);
    EXPECT_LT(missing, sent.size() / 4);
    EXPECT_LT(wrong, sent.size() / 10);
  }
}

/// The cameras of Lucid fill their packets, within vectors, too.
TEST(WordScanner, KeepsThePaddingOfLucid) {
  const auto sent = some_events(5'000, 1'000'000);
  const auto& evt3 = formats[3];
  const auto bytes = Camera(evt3).transfer_of(sent);
  Bytes padded;
  for (std::size_t at = 0; at < bytes.size(); at += 2) {
    padded.insert(padded.end(), {bytes[at], bytes[at + 1]});
    if (at / 2 % 7 == 0) padded.insert(padded.end(), 2 * (1 + at % 3), 0x99);
  }
  Reader reader(evt3, Framing::loose);
  reader.scan_pieces(padded, padded.size());
  EXPECT_EQ(reader.events, sent);
  EXPECT_EQ(reader.counts().lost_bytes, 0U);
}

}  // namespace
