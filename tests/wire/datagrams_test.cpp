// SPDX-License-Identifier: LGPL-2.1-or-later
// Datagrams written byte by byte from the formats' descriptions, and what our own are like.
#include "tests/wire/datagrams.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <stdexcept>

#include "src/core/byte_order.hpp"

namespace eventcamera {
namespace {

using datagrams::Bytes;
using enum DatagramFormat;

constexpr auto on = Polarity::on;
constexpr auto off = Polarity::off;

void operator+=(Bytes& bytes, const Bytes& more) {
  bytes.insert(bytes.end(), more.begin(), more.end());
}

struct Receiver {
  explicit Receiver(const DatagramSettings& settings)
      : unpacker(make_datagram_unpacker(settings)) {}

  Reception take(const Bytes& bytes, std::optional<Microseconds> arrival = std::nullopt) {
    const auto reception = unpacker->unpack(bytes, arrival, events);
    all.insert(all.end(), events.begin(), events.end());
    return reception;
  }

  std::unique_ptr<DatagramUnpacker> unpacker;
  std::vector<AbsoluteEvent> events;  ///< of the last datagram
  std::vector<AbsoluteEvent> all;
};

/// A datagram as its format's description has it, and its events.
struct Capture {
  std::string name;
  DatagramSettings settings;
  Bytes bytes;
  std::vector<AbsoluteEvent> events;
};

constexpr Microseconds arrival = 5'000'000;

std::vector<Capture> captures() {
  return {
      // Bit 31: no time; x 0x123, ON, y 0x45; x 1, OFF, y 2.
      {"spif",
       {.format = spif, .width = 640, .height = 480},
       {0x45, 0x80, 0x23, 0x81, 0x02, 0x00, 0x01, 0x80},
       {AbsoluteEvent::at(0x123, 0x45, arrival, on), AbsoluteEvent::at(1, 2, arrival, off)}},
      {"spif_big_endian",
       {.format = spif, .width = 640, .height = 480, .byte_order = std::endian::big},
       {0x81, 0x23, 0x80, 0x45, 0x80, 0x01, 0x00, 0x02},
       {AbsoluteEvent::at(0x123, 0x45, arrival, on), AbsoluteEvent::at(1, 2, arrival, off)}},
      {"spif_timestamps",
       {.format = spif_timestamps, .width = 640, .height = 480},
       {0x45, 0x80, 0x23, 0x01, 0x78, 0x56, 0x34, 0x12,  //
        0x02, 0x00, 0x01, 0x00, 0x79, 0x56, 0x34, 0x12},
       {AbsoluteEvent::at(0x123, 0x45, 0x12345678, on), AbsoluteEvent::at(1, 2, 0x12345679, off)}},
      {"spif_timestamps_big_endian",
       {.format = spif_timestamps, .width = 640, .height = 480, .byte_order = std::endian::big},
       {0x01, 0x23, 0x80, 0x45, 0x12, 0x34, 0x56, 0x78},
       {AbsoluteEvent::at(0x123, 0x45, 0x12345678, on)}},
      {"t64",
       {.format = t64_x16_y16_on8, .width = 1280, .height = 720},
       {0x08, 0x07, 0x06, 0x05, 0x04, 0x03, 0x02, 0x00, 0xff, 0x04, 0xcf, 0x02, 0x01,  //
        0x09, 0x07, 0x06, 0x05, 0x04, 0x03, 0x02, 0x00, 0x00, 0x00, 0x01, 0x00, 0x00},
       {AbsoluteEvent::at(1279, 719, 0x0002030405060708, on),
        AbsoluteEvent::at(0, 1, 0x0002030405060709, off)}},
      {"t32",
       {.format = t32_x16_y15_on1, .width = 1280, .height = 720},
       {0x78, 0x56, 0x34, 0xf2, 0xff, 0x04, 0x9f, 0x05,  //
        0x78, 0x56, 0x34, 0xf2, 0x00, 0x00, 0x02, 0x00},
       {AbsoluteEvent::at(1279, 719, 0xf2345678, on), AbsoluteEvent::at(0, 1, 0xf2345678, off)}},
      // 126 µs after the base; 2 * 127 + 1 µs later. Row 0 of the format is the lowest.
      {"es",
       {.format = es, .width = 640, .height = 480},
       {0x40, 0x42, 0x0f, 0x00, 0x00, 0x00, 0x00, 0x00, 0xfd, 0x7f, 0x02, 0x00, 0x00,  //
        0xff, 0xff, 0x02, 0x00, 0x00, 0xdf, 0x01},
       {AbsoluteEvent::at(639, 479, 1'000'126, on), AbsoluteEvent::at(0, 0, 1'000'381, off)}},
      // A DAVIS346: y << 22, x << 12, bit 11 for ON; from the lower right corner.
      {"jaer",
       {.format = jaer, .width = 346, .height = 260},
       {0x00, 0x00, 0x00, 0x01,                          //
        0x40, 0xd5, 0x98, 0x00, 0x00, 0x00, 0x10, 0x00,  // y 259, x 345 from there, ON
        0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x10, 0x05},
       {AbsoluteEvent::at(0, 0, 0x1000, on), AbsoluteEvent::at(345, 259, 0x1005, off)}},
      // A DVS128: y << 8, x << 1, bit 0 for OFF.
      {"jaer_dvs128",
       {.format = jaer, .width = 128, .height = 128, .has_sequence_number = false},
       {0x00, 0x00, 0x7f, 0x02, 0x80, 0x00, 0x00, 0x00,  //
        0x00, 0x00, 0x00, 0xff, 0x80, 0x00, 0x00, 0x00},
       {AbsoluteEvent::at(126, 0, 0x80000000, on), AbsoluteEvent::at(0, 127, 0x80000000, off)}},
  };
}

class Captures : public testing::TestWithParam<Capture> {};
INSTANTIATE_TEST_SUITE_P(, Captures, testing::ValuesIn(captures()),
                         [](const auto& tested) { return tested.param.name; });

TEST_P(Captures, AreRead) {
  const auto& [name, settings, bytes, events] = GetParam();
  Receiver receiver(settings);
  const auto reception = receiver.take(bytes, arrival);
  EXPECT_EQ(reception.fault, nullptr);
  EXPECT_FALSE(reception.late || reception.restarted);
  EXPECT_EQ(receiver.events, events);
}

TEST_P(Captures, AreWritten) {
  const auto& [name, settings, bytes, events] = GetParam();
  const auto packets = datagrams::packets_of(settings, events);
  ASSERT_EQ(packets.size(), 1);
  if (name == "es") {
    // Ours have the time of the first event in the header.
    EXPECT_EQ(packets[0].bytes,
              (Bytes{0xbe, 0x42, 0x0f, 0, 0, 0,    0,   0, 0x01, 0x7f, 0x02, 0, 0,  //
                     0xff, 0xff, 0x02, 0, 0, 0xdf, 0x01}));
  } else {
    EXPECT_EQ(packets[0].bytes, bytes);
  }
  EXPECT_EQ(packets[0].events, events.size());
  EXPECT_EQ(packets[0].first, events.front().t);
  EXPECT_EQ(packets[0].last, events.back().t);
}

TEST_P(Captures, AreRejectedWhereCutOff) {
  const auto& [name, settings, bytes, events] = GetParam();
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    Receiver receiver(settings);
    const Bytes part(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size));
    const auto reception = receiver.take(part, arrival);
    ASSERT_LE(receiver.events.size(), events.size());
    EXPECT_TRUE(
        std::ranges::equal(receiver.events, std::span(events).first(receiver.events.size())));
    EXPECT_TRUE(reception.fault == nullptr || receiver.events.empty());
  }
  Receiver receiver(settings);
  EXPECT_NE(receiver.take({bytes.begin(), bytes.end() - 1}, arrival).fault, nullptr);
  EXPECT_EQ(receiver.take(bytes, arrival).fault, nullptr);
  EXPECT_EQ(receiver.events, events);
}

std::string name_of(const testing::TestParamInfo<datagrams::Variant>& tested) {
  auto name = tested.param.name;
  std::ranges::replace(name, '-', '_');
  return name;
}

class EveryFormat : public testing::TestWithParam<datagrams::Variant> {};
INSTANTIATE_TEST_SUITE_P(, EveryFormat, testing::ValuesIn(datagrams::all()), name_of);

TEST_P(EveryFormat, KeepsToItsSizes) {
  const auto& settings = GetParam().settings;
  std::vector<AbsoluteEvent> events(1000, AbsoluteEvent::at(1, 2, 1234, on));
  const auto packets = datagrams::packets_of(settings, events);
  // AEStream reads 512 bytes of spif, and spiffer 1024 with times.
  const std::map<DatagramFormat, std::size_t> sizes{
      {spif, 128},
      {spif_timestamps, 128},
      {t64_x16_y16_on8, 100},
      {t32_x16_y15_on1, 100},
      {es, 278},
      {jaer, settings.has_sequence_number ? 174 : 175}};
  const auto full = sizes.at(settings.format);
  ASSERT_EQ(packets.size(), (events.size() + full - 1) / full);
  auto left = events.size();
  for (const auto& packet : packets) {
    EXPECT_LE(packet.bytes.size(), 1400);
    EXPECT_EQ(packet.events, std::min(full, left));
    left -= packet.events;
  }
}

std::vector<AbsoluteEvent> events_at(std::initializer_list<Microseconds> times) {
  std::vector<AbsoluteEvent> events;
  for (const auto t : times) events.push_back(AbsoluteEvent::at(1, 2, t, on));
  return events;
}

TEST_P(EveryFormat, LetsNoEventWait) {
  const auto packer = make_datagram_packer(GetParam().settings);
  packer->set_max_span(1000);
  const auto packets = datagrams::packets_of(*packer, events_at({5000, 5999, 6000, 6001, 9000}));
  ASSERT_EQ(packets.size(), 3);
  EXPECT_EQ(packets[0].events, 3);
  EXPECT_EQ(packets[1].first, 6001);
  EXPECT_EQ(packets[2].first, 9000);
}

TEST_P(EveryFormat, SendsAFullDatagramAtOnce) {
  const auto packer = make_datagram_packer(GetParam().settings);
  const auto event = AbsoluteEvent::at(1, 2, 1234, on);
  std::size_t sent = 0;
  for (std::size_t given = 1; given <= 1000; ++given)
    packer->pack({&event, 1}, [&](const Datagram& datagram) {
      sent += datagram.events;
      EXPECT_EQ(sent, given);
    });
  EXPECT_GT(sent, 700);
  EXPECT_EQ(packer->waiting_since().has_value(), sent < 1000);
}

TEST_P(EveryFormat, StartsADatagramWhereTimeGoesBack) {
  const auto packets = datagrams::packets_of(GetParam().settings, events_at({9000, 8000}));
  ASSERT_EQ(packets.size(), 2);
  EXPECT_EQ(packets[1].first, 8000);
}

TEST_P(EveryFormat, RejectsEventsOutsideTheSensor) {
  auto settings = GetParam().settings;
  // In two corners, as jAER counts columns and rows from the far one.
  const std::vector events{AbsoluteEvent::at(0, 0, 9000, on),
                           AbsoluteEvent::at(639, 479, 9000, on)};
  const auto packets = datagrams::packets_of(settings, events);
  for (const auto& [width, height] : {std::pair{639, 480}, {640, 479}}) {
    settings.width = width;
    settings.height = height;
    Receiver receiver(settings);
    EXPECT_NE(receiver.take(packets.at(0).bytes, arrival).fault, nullptr);
    EXPECT_TRUE(receiver.events.empty());
  }
}

TEST_P(EveryFormat, DropsWhatIsLate) {
  const auto& settings = GetParam().settings;
  std::vector<AbsoluteEvent> events(2000, AbsoluteEvent::at(1, 2, 1000, on));
  for (int i = 0; i < 2000; ++i) events[static_cast<std::size_t>(i)].t += i;
  const auto packets = datagrams::packets_of(settings, events);
  Receiver receiver(settings);
  receiver.take(packets[0].bytes, 1);
  receiver.take(packets[2].bytes, 2);
  const auto late = receiver.take(packets[1].bytes, settings.format == spif ? 1 : 3);
  EXPECT_TRUE(late.late);
  EXPECT_EQ(late.fault, nullptr);
  EXPECT_TRUE(receiver.events.empty());
  EXPECT_FALSE(receiver.take(packets[3].bytes, 4).late);
  EXPECT_EQ(receiver.events.size(), packets[3].events);
}

TEST_P(EveryFormat, FollowsASenderThatStartsOver) {
  const auto& settings = GetParam().settings;
  if (settings.format == spif) return;  // it has no times
  Receiver receiver(settings);
  const auto packer = make_datagram_packer(settings);
  receiver.take(datagrams::packets_of(*packer, events_at({60'000'000})).at(0).bytes);
  const auto again = events_at({10});
  EXPECT_TRUE(receiver.take(datagrams::packets_of(*packer, again).at(0).bytes).restarted);
  EXPECT_EQ(receiver.events, again);
}

/// Times of 32 bits wrap.
TEST_P(EveryFormat, FollowsHoursOfSilence) {
  const auto& settings = GetParam().settings;
  if (settings.format == spif || settings.format == es) return;
  constexpr Microseconds hour = 3'600'000'000;
  Receiver receiver(settings);
  const auto packer = make_datagram_packer(settings);
  const auto sent = events_at({1000, hour, 4 * hour, 24 * hour});
  for (const auto& event : sent) {
    const auto packets = datagrams::packets_of(*packer, {&event, 1});
    EXPECT_FALSE(receiver.take(packets.at(0).bytes, 777 + event.t + event.t / 100'000).restarted);
  }
  EXPECT_TRUE(receiver.all == sent);
}

TEST(Datagrams, OfSpifMayStateTimesOfSomeEvents) {
  const Bytes mixed{0x01, 0x00, 0x01, 0x00, 0x10, 0x00, 0x00, 0x00,  //
                    0x02, 0x00, 0x02, 0x80};
  Receiver untimed({.format = spif, .width = 640, .height = 480});
  EXPECT_EQ(untimed.take(mixed, 77).fault, nullptr);
  EXPECT_EQ(untimed.events,
            (std::vector{AbsoluteEvent::at(1, 1, 77, off), AbsoluteEvent::at(2, 2, 77, off)}));
  Receiver timed({.format = spif_timestamps, .width = 640, .height = 480});
  EXPECT_NE(timed.take(mixed, 77).fault, nullptr);
}

TEST(Datagrams, WithImpossibleTimesAreRejected) {
  Receiver t64({.format = t64_x16_y16_on8, .width = 640, .height = 480});
  EXPECT_NE(t64.take({0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0}).fault, nullptr);
  EXPECT_NE(t64.take({0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2}).fault, nullptr);  // polarity
  Receiver stream({.format = es, .width = 640, .height = 480});
  EXPECT_NE(stream.take({0, 0, 0, 0, 0, 0, 0, 1}).fault, nullptr);
  // Steps of half an hour.
  Bytes leaps;
  for (std::uint8_t i = 0; i < 8; ++i)
    leaps += Bytes{0, 0, 0, static_cast<std::uint8_t>(i * 0x70), 1, 0, 2, 0};
  Receiver t32({.format = t32_x16_y15_on1, .width = 640, .height = 480});
  EXPECT_NE(t32.take(leaps).fault, nullptr);
}

Bytes jaer_packet(std::uint32_t number, std::uint32_t t) {
  Bytes bytes(12);
  store(number, bytes.data(), std::endian::big);
  store(t, bytes.data() + 8, std::endian::big);
  return bytes;
}

constexpr DatagramSettings davis{.format = jaer, .width = 346, .height = 260};

TEST(Jaer, CountsLosses) {
  Receiver receiver(davis);
  EXPECT_EQ(receiver.take(jaer_packet(7, 100)).lost, 0);
  EXPECT_EQ(receiver.take(jaer_packet(8, 200)).lost, 0);
  EXPECT_EQ(receiver.take(jaer_packet(12, 300)).lost, 3);
  EXPECT_TRUE(receiver.take(jaer_packet(10, 250)).late);
  EXPECT_TRUE(receiver.take(jaer_packet(12, 300)).late);  // a duplicate
  EXPECT_EQ(receiver.take(jaer_packet(13, 400)).lost, 0);
  EXPECT_EQ(receiver.all.size(), 4);
}

TEST(Jaer, FollowsNumbersPastTheLast) {
  Receiver receiver(davis);
  receiver.take(jaer_packet(0x7ffffffe, 100));
  EXPECT_EQ(receiver.take(jaer_packet(0x7fffffff, 101)).lost, 0);
  EXPECT_EQ(receiver.take(jaer_packet(0, 102)).lost, 0);
  EXPECT_EQ(receiver.take(jaer_packet(2, 103)).lost, 1);
  EXPECT_EQ(receiver.all.size(), 4);
}

TEST(Jaer, BelievesAJumpOnlyIfItGoesOn) {
  Receiver receiver(davis);
  receiver.take(jaer_packet(500'000, 100));
  EXPECT_NE(receiver.take(jaer_packet(40'000'000, 101)).fault, nullptr);
  EXPECT_EQ(receiver.take(jaer_packet(500'001, 102)).lost, 0);
  // The sender starts over.
  EXPECT_NE(receiver.take(jaer_packet(1, 10)).fault, nullptr);
  const auto reception = receiver.take(jaer_packet(2, 11));
  EXPECT_TRUE(reception.restarted);
  EXPECT_EQ(reception.lost, 0);
  EXPECT_EQ(receiver.take(jaer_packet(3, 12)).lost, 0);
  EXPECT_EQ(receiver.all.back().t, 12);
  EXPECT_EQ(receiver.all.size(), 4);
}

TEST(Jaer, SkipsSamplesAndExternalEvents) {
  Receiver receiver(davis);
  EXPECT_EQ(receiver
                .take({0,    0, 0,    1,                 //
                       0x80, 0, 0x01, 0x23, 0, 0, 0, 1,  //
                       0,    0, 0x04, 0,    0, 0, 0, 1})
                .fault,
            nullptr);
  EXPECT_TRUE(receiver.events.empty());
  EXPECT_EQ(receiver.take({0, 0, 0, 3}).lost, 1) << "a number only";
}

TEST(Jaer, HasAddressesForSomeSensorsOnly) {
  for (const auto& [width, height] : {std::pair{1280, 720}, {1025, 512}, {1024, 513}}) {
    const DatagramSettings settings{.format = jaer, .width = width, .height = height};
    EXPECT_THROW(make_datagram_packer(settings), std::invalid_argument);
    EXPECT_THROW(make_datagram_unpacker(settings), std::invalid_argument);
  }
  const DatagramSettings largest{.format = jaer, .width = 1024, .height = 512};
  const std::vector corners{AbsoluteEvent::at(0, 0, 1, on), AbsoluteEvent::at(1023, 511, 1, off)};
  Receiver receiver(largest);
  receiver.take(datagrams::packets_of(largest, corners).at(0).bytes);
  EXPECT_EQ(receiver.events, corners);
}

}  // namespace
}  // namespace eventcamera
