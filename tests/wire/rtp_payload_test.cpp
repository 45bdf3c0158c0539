// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gtest/gtest.h>

#include <set>

#include "src/wire/rtp_packer.hpp"
#include "tests/wire/rtp_packets.hpp"

namespace eventcamera {
namespace {

using namespace rtp_packets;

constexpr SensorSize davis{346, 260};

/// Payload sizes of MTUs of 576, 1500 and 9000 bytes, and the minimum.
// The last is more than an interval needs, and than any memory.
constexpr std::size_t max_sizes[] = {RtpPacker::min_size, 576 - 40, 1500 - 40, 9000 - 40,
                                     SIZE_MAX / 2};

/// A receiver, and the intervals that it got.
struct Receiver {
  explicit Receiver(SensorSize size, RtpEventFormat format) : unpacker(size, format) {}

  void push(const RtpPacket& packet) {
    unpacker.push(packet, [this](const RtpInterval& interval) { take(interval); });
  }
  void push(const Packet& packet) { push(packet.view()); }
  void push(const std::vector<Packet>& packets) {
    for (const auto& packet : packets) push(packet);
  }
  void finish() {
    unpacker.flush([this](const RtpInterval& interval) { take(interval); });
  }

  void take(const RtpInterval& interval) {
    intervals.push_back(
        {interval.start, interval.duration, {interval.events.begin(), interval.events.end()}});
    discontinuities += interval.is_discontinuous ? 1 : 0;
  }

  RtpUnpacker unpacker;
  std::vector<Interval> intervals;
  int discontinuities = 0;
};

std::vector<AbsoluteEvent> events_of(const std::vector<Interval>& intervals) {
  std::vector<AbsoluteEvent> events;
  for (const auto& [start, duration, some] : intervals)
    for (const auto& event : some) events.push_back({start / 1000 + event.t, event.x, event.y_p});
  return events;
}

/// True if all of `some` are in `all`, in the same order.
bool is_part(const std::vector<AbsoluteEvent>& some, const std::vector<AbsoluteEvent>& all) {
  auto next = all.begin();
  for (const auto& event : some) {
    next = std::find(next, all.end(), event);
    if (next == all.end()) return false;
    ++next;
  }
  return true;
}

class EveryPayload : public testing::TestWithParam<RtpEventFormat> {};
INSTANTIATE_TEST_SUITE_P(, EveryPayload,
                         testing::Values(RtpEventFormat::evt3, RtpEventFormat::xytp),
                         [](const auto& param) {
                           return param.param == RtpEventFormat::evt3 ? "Evt3" : "Xytp";
                         });

TEST_P(EveryPayload, GivesBackEveryIntervalOfAnySensorInPacketsOfAnySize) {
  unsigned seed = 0;
  for (const SensorSize size :
       {SensorSize{1, 1}, {7, 3}, {31, 2}, {33, 1}, davis, {1280, 720}, {2048, 2048}}) {
    for (const auto max_size : max_sizes) {
      const auto intervals = random_intervals(size, 20, ++seed);
      RtpPacker packer(size, GetParam());
      const auto packets = packets_of(intervals, packer, max_size, 65500);
      for (const auto& packet : packets) ASSERT_LE(packet.payload.size(), max_size);
      Receiver receiver(size, GetParam());
      receiver.push(packets);
      ASSERT_EQ(receiver.intervals, intervals) << size.width << "x" << size.height;
      EXPECT_EQ(receiver.discontinuities, 1);  // the first
      const auto& statistics = receiver.unpacker.statistics();
      EXPECT_EQ(statistics.packets, packets.size());
      EXPECT_EQ(statistics.events, packer.next_event());
      EXPECT_EQ(statistics.lost_events + statistics.lost_packets + statistics.rejected_packets, 0U);
    }
  }
}

TEST_P(EveryPayload, CountsWhatIsLostReorderedOrDuplicated) {
  for (unsigned seed = 0; seed < 40; ++seed) {
    std::mt19937 random(seed);
    const auto happens = [&](int percent) { return static_cast<int>(random() % 100) < percent; };
    const auto intervals = random_intervals(davis, 30, seed);
    RtpPacker packer(davis, GetParam());
    const auto sent = packets_of(intervals, packer, 536, 65000);
    const int loss = std::array{0, 1, 5, 20}[seed % 4];
    std::vector<Packet> arriving;
    std::set<std::uint16_t> arrived;
    for (std::size_t i = 0; i + 1 < sent.size(); ++i) {
      if (i > 0 && happens(loss)) continue;
      arriving.push_back(sent[i]);
      if (happens(5)) arriving.push_back(sent[i]);
      if (i > 0 && arriving.size() > 9 && happens(5))
        std::swap(arriving.back(), arriving[arriving.size() - 2 - random() % 6]);
    }
    arriving.push_back(sent.back());
    Receiver receiver(davis, GetParam());
    receiver.push(arriving);
    const auto& statistics = receiver.unpacker.statistics();
    const auto events = events_of(receiver.intervals);
    ASSERT_TRUE(is_part(events, events_of(intervals)));
    EXPECT_EQ(statistics.events, events.size());
    const auto first = RtpPayloadHeader::read(arriving.front().payload)->first_event;
    EXPECT_EQ(packer.next_event() - first - events.size(), statistics.lost_events);
    EXPECT_EQ(statistics.packets + statistics.late_packets, arriving.size());
    EXPECT_EQ(statistics.rejected_packets, 0U);
    EXPECT_EQ(receiver.discontinuities > 1, statistics.lost_packets > 0);
  }
}

TEST_P(EveryPayload, FollowsASenderThatRestarts) {
  const auto intervals = random_intervals(davis, 60, 6);
  for (const std::uint32_t ssrc : {1U, 2U}) {
    RtpPacker first(davis, GetParam());
    RtpPacker second(davis, GetParam());
    Receiver receiver(davis, GetParam());
    receiver.push(packets_of(intervals, first, 536, 30000));
    const auto before = receiver.unpacker.statistics();
    const auto again = packets_of(intervals, second, 536, 10000);
    ASSERT_GT(again.size(), 30U);
    for (const auto& packet : again) receiver.push(packet.view(ssrc));
    // With a new SSRC at once, else after a few packets that look late.
    const auto& after = receiver.unpacker.statistics();
    EXPECT_EQ(after.late_packets, ssrc == 1 ? 15U : 0U);
    EXPECT_EQ(after.packets - before.packets, again.size() - after.late_packets);
    EXPECT_EQ(after.lost_events, 0U);
    EXPECT_EQ(receiver.discontinuities, 2);
  }
}

/// Two senders whose packets arrive in turn every 5 ms.
class TwoSenders {
 public:
  explicit TwoSenders(RtpEventFormat format) : receiver_(davis, format) {
    for (unsigned i = 0; i < 2; ++i) {
      RtpPacker packer(davis, format);
      packets_[i] = packets_of(random_intervals(davis, 60, i + 1), packer, 536, 0);
    }
  }

  void send(std::uint32_t sender, std::size_t packet) {
    auto view = packets_[sender].at(packet).view(sender);
    view.arrival = now += 5'000'000;
    receiver_.push(view);
  }

  const RtpStatistics& statistics() const { return receiver_.unpacker.statistics(); }

  std::uint64_t now = 0;

 private:
  std::array<std::vector<Packet>, 2> packets_;
  Receiver receiver_;
};

TEST_P(EveryPayload, KeepsTheFirstOfTwoSenders) {
  TwoSenders senders(GetParam());
  for (std::size_t i = 0; i < 50; ++i)
    for (const std::uint32_t sender : {0, 1}) senders.send(sender, i);
  // The second could have been the first, restarted.
  EXPECT_EQ(senders.statistics().packets, 51U);
  EXPECT_EQ(senders.statistics().rejected_packets, 49U);
  EXPECT_EQ(senders.statistics().second_sender_packets, 49U);
  EXPECT_EQ(senders.statistics().lost_packets + senders.statistics().lost_events, 0U);
}

TEST_P(EveryPayload, FollowsTheSecondSenderWhenTheFirstIsSilent) {
  TwoSenders senders(GetParam());
  senders.send(0, 0);
  senders.send(1, 0);
  senders.send(0, 1);
  senders.now += 900'000'000;
  senders.send(1, 1);
  EXPECT_EQ(senders.statistics().rejected_packets, 1U);
  senders.now += 100'000'000;
  for (std::size_t i = 2; i < 30; ++i) senders.send(1, i);
  EXPECT_EQ(senders.statistics().rejected_packets, 1U);
  EXPECT_EQ(senders.statistics().packets, 31U);
}

TEST_P(EveryPayload, FollowsARestartedSenderDespiteALatePacket) {
  TwoSenders senders(GetParam());
  senders.send(0, 0);
  senders.send(0, 2);
  senders.send(1, 0);
  senders.send(0, 1);
  for (std::size_t i = 1; i < 30; ++i) senders.send(1, i);
  EXPECT_EQ(senders.statistics().rejected_packets, 0U);
}

TEST_P(EveryPayload, AFloodOfRandomPacketsDisturbsNothing) {
  const auto intervals = random_intervals(davis, 20, 8);
  RtpPacker packer(davis, GetParam());
  Receiver receiver(davis, GetParam());
  std::mt19937 random(1);
  std::uint64_t flood = 0;
  for (const auto& packet : packets_of(intervals, packer, 536, 7)) {
    for (int i = 0; i < 100; ++i, ++flood) {
      Packet noise{static_cast<std::uint16_t>(random()), random() % 2 == 0, {}};
      noise.payload.resize(random() % 600);
      for (auto& byte : noise.payload) byte = static_cast<std::uint8_t>(random());
      // Half of it has a valid header.
      if (i % 2 == 0 && noise.payload.size() >= RtpPayloadHeader::size)
        std::copy_n(packet.payload.begin(), RtpPayloadHeader::size, noise.payload.begin());
      receiver.push(noise.view(i % 4 == 0 ? 1 : random()));
    }
    receiver.push(packet);
  }
  const auto& statistics = receiver.unpacker.statistics();
  EXPECT_EQ(receiver.intervals, intervals);
  EXPECT_EQ(statistics.rejected_packets + statistics.late_packets, flood);
  EXPECT_EQ(statistics.lost_events, 0U);
}

TEST_P(EveryPayload, RejectsTruncatedPacketsUnlessTheyAreWhole) {
  const auto intervals = random_intervals(davis, 4, 9);
  RtpPacker packer(davis, GetParam());
  for (const auto& packet : packets_of(intervals, packer, 536, 7)) {
    Receiver whole(davis, GetParam());
    whole.push(packet);
    whole.finish();
    for (std::size_t size = 0; size < packet.payload.size(); ++size) {
      Receiver receiver(davis, GetParam());
      auto view = packet.view();
      view.payload = view.payload.first(size);
      receiver.push(view);
      receiver.finish();
      // The last word of a vector may have no events.
      if (receiver.intervals != whole.intervals) {
        ASSERT_TRUE(receiver.intervals.empty());
        ASSERT_EQ(receiver.unpacker.statistics().rejected_packets, 1U) << size;
      }
    }
  }
}

TEST_P(EveryPayload, RejectsEventsOutsideItsSensorOrInterval) {
  const std::vector<Event> events = {Event::at(5, 6, 10, Polarity::on)};
  const auto rejected = [&](SensorSize receiver, std::size_t byte, std::uint8_t value) {
    RtpPacker packer(davis, GetParam());
    std::vector<std::uint8_t> payload;
    packer.pack(0, 20'000, events, 536,
                [&](auto bytes, bool) { payload.assign(bytes.begin(), bytes.end()); });
    if (byte > 0) payload[byte] = value;
    RtpUnpacker unpacker(receiver, GetParam());
    unpacker.push({1, 2, true, payload}, [](const RtpInterval&) {});
    return unpacker.statistics().rejected_packets;
  };
  EXPECT_EQ(rejected(davis, 0, 0), 0U);
  EXPECT_EQ(rejected({6, 7}, 0, 0), 0U);
  EXPECT_EQ(rejected({5, 7}, 0, 0), 1U);
  EXPECT_EQ(rejected({6, 6}, 0, 0), 1U);
  EXPECT_EQ(rejected(davis, 1, 1), 1U);      // reserved
  EXPECT_EQ(rejected(davis, 3, 2), 1U);      // number of events
  EXPECT_EQ(rejected(davis, 8, 0x80), 1U);   // start
  EXPECT_EQ(rejected(davis, 16, 0x01), 1U);  // duration
  EXPECT_EQ(rejected(davis, 26, 0x01), 1U);  // base
}

/// Payloads written from docs/rtp-payload-format.md alone, with 4 events of an interval.
struct Capture {
  RtpEventFormat format;
  std::vector<std::uint8_t> payload;
};

const Capture captures[] = {
    {RtpEventFormat::evt3,
     {0x10, 0x00, 0x00, 0x04,                          // version 1, EVT3; 4 events
      0x00, 0x00, 0x00, 0x07,                          // from number 7 on
      0x00, 0x00, 0x00, 0x00, 0x3b, 0x9a, 0xca, 0x01,  // start 1'000'000'001
      0x00, 0x00, 0x00, 0x00, 0x00, 0x98, 0x96, 0x80,  // duration 10'000'000
      0x00, 0x00, 0x03, 0xe8,                          // base 1000
      0x00, 0x80, 0x00, 0x60, 0x05, 0x00,              // TIME_HIGH 0, TIME_LOW 0, ADDR_Y 5
      0x23, 0x29,                                      // ADDR_X 0x123, ON
      0x01, 0x80, 0x64, 0x60, 0x06, 0x00,              // TIME_HIGH 1, TIME_LOW 100, ADDR_Y 6
      0x20, 0x30,                                      // VECT_BASE_X 32, OFF
      0x01, 0x48, 0x00, 0x40, 0x80, 0x50}},            // bits 0, 11; none; 7
    {RtpEventFormat::xytp,
     {0x11, 0x00, 0x00, 0x04,                          //
      0x00, 0x00, 0x00, 0x07,                          //
      0x00, 0x00, 0x00, 0x00, 0x3b, 0x9a, 0xca, 0x01,  //
      0x00, 0x00, 0x00, 0x00, 0x00, 0x98, 0x96, 0x80,  //
      0x00, 0x00, 0x00, 0x00,                          // base 0
      0xe8, 0x03, 0x00, 0x00, 0x23, 0x01, 0x05, 0x80,  // t 1000, x 0x123, y 5, ON
      0x4c, 0x14, 0x00, 0x00, 0x20, 0x00, 0x06, 0x00,  // t 5196, x 32, y 6, OFF
      0x4c, 0x14, 0x00, 0x00, 0x2b, 0x00, 0x06, 0x00,  // x 43
      0x4c, 0x14, 0x00, 0x00, 0x3f, 0x00, 0x06, 0x00}}};

TEST(RtpUnpacker, ReadsPacketsWrittenFromTheSpecification) {
  const std::vector events{
      Event::at(0x123, 5, 1000, Polarity::on), Event::at(32, 6, 5196, Polarity::off),
      Event::at(43, 6, 5196, Polarity::off), Event::at(63, 6, 5196, Polarity::off)};
  for (const auto& [format, payload] : captures) {
    RtpUnpacker unpacker({346, 260}, format);
    int intervals = 0;
    unpacker.push({1, 0, true, payload}, [&](const RtpInterval& interval) {
      ++intervals;
      EXPECT_EQ(interval.start, 1'000'000'001);
      EXPECT_EQ(interval.duration, 10'000'000);
      EXPECT_TRUE(std::ranges::equal(interval.events, events));
    });
    EXPECT_EQ(intervals, 1);
  }
}

TEST(RtpPacker, RefusesWhatItCannotSend) {
  EXPECT_THROW(RtpPacker({2049, 1}, RtpEventFormat::evt3), std::invalid_argument);
  RtpPacker packer({16384, 16384}, RtpEventFormat::xytp);
  EXPECT_THROW(packer.pack(0, 1, {}, RtpPacker::min_size - 1, [](auto, bool) {}),
               std::invalid_argument);
}

TEST(PendingInterval, LeavesOutWhatIsOutsideOrUnsorted) {
  PendingInterval pending(davis);
  const std::vector events = {
      Event::at(0, 0, 5, Polarity::on),   Event::at(346, 0, 5, Polarity::on),
      Event::at(0, 260, 5, Polarity::on), Event::at(0, 0, 4, Polarity::on),
      Event::at(1, 0, 10, Polarity::on),  Event::at(1, 0, 11, Polarity::on)};
  const auto rejected = pending.add(0, 10'000, events, [] { FAIL(); });
  EXPECT_EQ(rejected.outside, 2U);
  EXPECT_EQ(rejected.unsorted, 2U);
  const std::vector expected = {events[0], events[4]};
  EXPECT_TRUE(std::ranges::equal(pending.events(), expected));
}

TEST(PendingInterval, SplitsLongIntervals) {
  constexpr std::size_t count = 2 * max_rtp_interval_events + 5;
  std::vector<Event> events;
  for (std::size_t i = 0; i < count; ++i)
    events.push_back(
        Event::at(static_cast<int>(i % 346), 1, static_cast<std::uint32_t>(i / 100), Polarity::on));
  PendingInterval pending(davis);
  std::vector<Interval> intervals;
  const auto flush = [&] {
    intervals.push_back({pending.start(),
                         pending.end() - pending.start(),
                         {pending.events().begin(), pending.events().end()}});
    pending.clear();
  };
  const Interval whole{700, 40'000'000, events};
  pending.add(whole.start, whole.start + whole.duration, events, flush);
  flush();
  EXPECT_EQ(intervals.size(), 3U);
  EXPECT_EQ(events_of(intervals), events_of({whole}));
  Nanoseconds end = whole.start;
  for (const auto& interval : intervals) {
    EXPECT_EQ(interval.start, end);
    EXPECT_LE(interval.events.size(), max_rtp_interval_events);
    end += interval.duration;
  }
  EXPECT_EQ(end, whole.start + whole.duration);
}

}  // namespace
}  // namespace eventcamera
