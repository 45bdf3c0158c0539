// SPDX-License-Identifier: LGPL-2.1-or-later
// rtpeventpay and rtpeventdepay: what arrives, when, and what is counted.
#include <gst/rtp/gstrtpbuffer.h>
#include <gst/rtp/gstrtphdrext.h>
#include <gst/rtp/gstrtpmeta.h>

#include <algorithm>
#include <array>
#include <optional>

#include "src/wire/rtp_payload.hpp"
#include "tests/elements/event_buffer.hpp"
#include "tests/wire/rtp_packets.hpp"

namespace {

using namespace harness;
using namespace eventcamera;
using rtp_packets::Interval;

constexpr GstClockTime ms = GST_MSECOND;
constexpr SensorSize davis{346, 260};
const std::string davis_caps = "application/x-event-camera, format=XYTP, width=346, height=260";
const std::string rtp_caps =
    "application/x-rtp, media=application, clock-rate=1000000, encoding-name=X-EVENT-CAMERA";

void push(Harness& h, const Interval& interval) {
  const auto start = static_cast<GstClockTime>(interval.start);
  const auto duration = static_cast<GstClockTime>(interval.duration);
  if (interval.events.empty())
    push_gap(h.get(), start, duration);
  else
    ASSERT_EQ(h.push(buffer_of(start, interval.events, duration)), GST_FLOW_OK);
}

/// Output of a depayloader: its buffers and GAP events, in the order of time.
struct Output {
  std::vector<Interval> intervals;
  std::vector<GstSegment> segments;
  int discontinuities = 0;

  explicit Output(Harness& h) {
    while (const auto buffer = h.pull()) {
      Interval interval{static_cast<Nanoseconds>(GST_BUFFER_PTS(buffer.get())),
                        static_cast<Nanoseconds>(GST_BUFFER_DURATION(buffer.get())),
                        {}};
      for (const auto& event : events_of(buffer.get()))
        interval.events.push_back({event.t, event.x, event.y_p});
      intervals.push_back(interval);
      EXPECT_EQ(GST_BUFFER_DTS(buffer.get()), GST_BUFFER_PTS(buffer.get()));
      discontinuities += GST_BUFFER_IS_DISCONT(buffer.get()) ? 1 : 0;
    }
    while (const Owned<GstEvent> event{gst_harness_try_pull_event(h.get())}) {
      if (GST_EVENT_TYPE(event.get()) == GST_EVENT_GAP) {
        const auto gap = gap_of(event.get());
        intervals.push_back(
            {static_cast<Nanoseconds>(gap.start), static_cast<Nanoseconds>(gap.duration), {}});
      } else if (GST_EVENT_TYPE(event.get()) == GST_EVENT_SEGMENT) {
        gst_event_copy_segment(event.get(), &segments.emplace_back());
      }
    }
    std::ranges::stable_sort(intervals, {}, &Interval::start);
  }
};

std::vector<AbsoluteEvent> absolute(const std::vector<Interval>& intervals) {
  std::vector<AbsoluteEvent> events;
  for (const auto& [start, duration, some] : intervals)
    for (const auto& event : some) events.push_back({start / 1000 + event.t, event.x, event.y_p});
  return events;
}

/// Fields of an RTP packet.
struct Fields {
  guint32 timestamp;
  bool marker;
  std::optional<RtpPayloadHeader> header;

  explicit Fields(GstBuffer* packet) {
    GstRTPBuffer rtp = GST_RTP_BUFFER_INIT;
    EXPECT_TRUE(gst_rtp_buffer_map(packet, GST_MAP_READ, &rtp));
    timestamp = gst_rtp_buffer_get_timestamp(&rtp);
    marker = gst_rtp_buffer_get_marker(&rtp) != FALSE;
    header =
        RtpPayloadHeader::read({static_cast<const std::uint8_t*>(gst_rtp_buffer_get_payload(&rtp)),
                                gst_rtp_buffer_get_payload_len(&rtp)});
    gst_rtp_buffer_unmap(&rtp);
  }
};

/// Packets of a stream, one per buffer.
std::vector<Buffer> packets_of(const std::vector<Interval>& intervals,
                               const std::string& properties = "") {
  Harness pay("rtpeventpay max-latency=0 mtu=576 " + properties);
  pay.caps(davis_caps, "application/x-rtp");
  for (const auto& interval : intervals) push(pay, interval);
  std::vector<Buffer> packets;
  while (auto packet = pay.pull()) packets.push_back(std::move(packet));
  EXPECT_EQ(stat_of(pay.element(), "packets"), packets.size());
  EXPECT_EQ(stat_of(pay.element(), "events"), absolute(intervals).size());
  return packets;
}

struct Depayloader : Harness {
  explicit Depayloader(const std::string& format = "EVT3") : Harness("rtpeventdepay") {
    caps(rtp_caps + ", width=346, height=260, format=" + format);
  }

  void take(GstBuffer* packet) { EXPECT_EQ(push(gst_buffer_ref(packet)), GST_FLOW_OK); }
  void take(GstBuffer* packet, GstClockTime arrival) {
    GstBuffer* copy = gst_buffer_copy(packet);
    GST_BUFFER_PTS(copy) = arrival;
    GST_BUFFER_DTS(copy) = arrival;  // as udpsrc does
    EXPECT_EQ(push(copy), GST_FLOW_OK);
  }
};

class EveryFormat : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(, EveryFormat, testing::Values("EVT3", "XYTP"));

TEST_P(EveryFormat, GivesBackEveryBufferAndGap) {
  unsigned seed = 0;
  for (const auto mtu : {576, 1500, 9000}) {
    Harness h("rtpeventpay max-latency=0 format=" + std::string(GetParam()) +
              " mtu=" + std::to_string(mtu) + " ! rtpeventdepay");
    h.caps(davis_caps);
    const auto intervals = rtp_packets::random_intervals(davis, 40, ++seed);
    for (const auto& interval : intervals) push(h, interval);
    push_eos(h.get());
    const Output output(h);
    EXPECT_EQ(output.intervals, intervals);
    EXPECT_EQ(output.discontinuities, 1);
    EXPECT_EQ(output.segments.size(), 1U);
    EXPECT_TRUE(contains(h.out_caps(), "width=(int)346, height=(int)260"));
  }
}

TEST_P(EveryFormat, GivesTheEventsOfAnIntervalThatTheEndCutsOff) {
  Interval interval{0, 20'000'000, {}};
  for (std::uint32_t t = 0; t < 2000; ++t)
    interval.events.push_back(on(static_cast<int>(t * 7 % 346), 9, 10 * t));
  auto packets = packets_of({interval}, "format=" + std::string(GetParam()));
  const auto cut_off = Fields(packets.back().get()).header.value().event_count;
  packets.pop_back();
  Depayloader h(GetParam());
  for (const auto& packet : packets) h.take(packet.get());
  push_eos(h.get());
  interval.events.resize(interval.events.size() - cut_off);
  EXPECT_TRUE(absolute(Output(h).intervals) == absolute({interval}));
}

TEST_P(EveryFormat, KeepsToTheMtuWithSourcesAndHeaderExtensions) {
  const auto intervals = rtp_packets::random_intervals(davis, 20, 5);
  constexpr guint mtu = 576;
  // An extension of the receiver, with a header of one byte, and one of the application, of two.
  for (const std::string receiver : {", extmap-3=(string)http://www.ietf.org/id/"
                                     "draft-holmer-rmcat-transport-wide-cc-extensions-01",
                                     ""}) {
    Harness h("rtpeventpay max-latency=0 source-info=true mtu=576 timestamp-offset=7 format=" +
              std::string(GetParam()));
    if (receiver.empty()) {
      GstElement* mid = gst_element_factory_make("rtphdrextmid", nullptr);
      g_object_set(mid, "mid", "0123456789abcdef", nullptr);
      gst_rtp_header_extension_set_id(GST_RTP_HEADER_EXTENSION(mid), 200);
      g_signal_emit_by_name(h.element(), "add-extension", mid);
      gst_object_unref(mid);
    }
    h.caps(davis_caps, "application/x-rtp" + receiver);
    for (const auto& interval : intervals) {
      if (interval.events.empty()) continue;
      GstBuffer* buffer = buffer_of(static_cast<GstClockTime>(interval.start), interval.events,
                                    static_cast<GstClockTime>(interval.duration));
      const guint32 ssrc = 7;
      const std::array<guint32, 9> csrcs = {1, 2, 3, 4, 5, 6, 7, 8, 9};
      gst_buffer_add_rtp_source_meta(buffer, &ssrc, csrcs.data(), csrcs.size());
      ASSERT_EQ(h.push(buffer), GST_FLOW_OK);
    }
    gsize largest = 0;
    std::optional<Fields> last;
    while (const auto packet = h.pull()) {
      largest = std::max(largest, gst_buffer_get_size(packet.get()));
      const Fields fields(packet.get());
      EXPECT_EQ(fields.timestamp, static_cast<guint32>(fields.header.value().start / 1000 + 7));
      if (last) {  // the last packet of an interval is marked
        EXPECT_EQ(last->marker, last->timestamp != fields.timestamp);
      }
      last = fields;
      GstRTPBuffer rtp = GST_RTP_BUFFER_INIT;
      ASSERT_TRUE(gst_rtp_buffer_map(packet.get(), GST_MAP_READ, &rtp));
      EXPECT_EQ(gst_rtp_buffer_get_csrc_count(&rtp), 10);
      EXPECT_TRUE(gst_rtp_buffer_get_extension(&rtp));
      gst_rtp_buffer_unmap(&rtp);
    }
    EXPECT_LE(largest, mtu);
    EXPECT_GT(largest, mtu - 20);
    EXPECT_TRUE(last && last->marker);
  }
}

TEST_P(EveryFormat, CountsLossAndDuplication) {
  const auto intervals = rtp_packets::random_intervals(davis, 60, 1);
  const auto sent = packets_of(intervals, std::string("format=") + GetParam());
  Depayloader h(GetParam());
  std::size_t lost = 0;
  for (std::size_t i = 0; i < sent.size(); ++i) {
    if (i % 20 == 10 && i + 1 < sent.size()) {
      ++lost;
      continue;
    }
    h.take(sent[i].get());
    if (i % 20 == 5) h.take(sent[i].get());
  }
  push_eos(h.get());
  const Output output(h);
  const auto received = absolute(output.intervals).size();
  EXPECT_GT(lost, 2U);
  EXPECT_EQ(stat_of(h.element(), "events"), received);
  EXPECT_EQ(stat_of(h.element(), "lost-events"), absolute(intervals).size() - received);
  EXPECT_EQ(stat_of(h.element(), "lost-packets"), lost);
  EXPECT_EQ(stat_of(h.element(), "packets"), sent.size() - lost);
  EXPECT_GT(stat_of(h.element(), "late-packets"), 2U);
  EXPECT_TRUE(h.message(GST_MESSAGE_ELEMENT));
  EXPECT_FALSE(h.message(GST_MESSAGE_ELEMENT)) << "one is enough";
  EXPECT_GT(output.discontinuities, 2);
}

TEST(RtpEventPay, JoinsBuffersWithTriggersAndImuSamplesBetweenThem) {
  Harness h("rtpeventpay max-latency=1000000000");
  h.caps(davis_caps, "application/x-rtp");
  const std::array names = {"GstEventCameraTriggers", "GstEventCameraImu"};
  for (int i = 0; i < 10; ++i) {
    for (const auto* name : names) push_custom(h.get(), name);
    push(h, {i * 1'000'000, 1'000'000, {on(i, 2, 500)}});
  }
  EXPECT_FALSE(h.pull());
  for (int i = 0; i < 10; ++i) {
    for (const auto* name : names) {
      const auto event = h.pull_event(GST_EVENT_CUSTOM_DOWNSTREAM);
      ASSERT_TRUE(event);
      EXPECT_TRUE(gst_event_has_name(event.get(), name));
    }
  }
  // Other events stay between the buffers around them.
  push_custom(h.get(), "other");
  const auto packet = h.pull();
  ASSERT_TRUE(packet);
  EXPECT_EQ(Fields(packet.get()).header->event_count, 10);
}

TEST(RtpEventPay, SendsWaitingEventsAtTheEndAndBeforeAGap) {
  Harness h("rtpeventpay max-latency=1000000000");
  h.caps(davis_caps, "application/x-rtp");
  push(h, {0, 1'000'000, {on(1, 2, 3)}});
  EXPECT_FALSE(h.pull());
  push(h, {5'000'000, 1'000'000, {on(1, 2, 3)}});  // not the next interval
  EXPECT_TRUE(h.pull());
  push_eos(h.get());
  EXPECT_TRUE(h.pull());
}

TEST(RtpEventPay, TellsOfSilenceOfUnknownDuration) {
  Harness h("rtpeventpay max-latency=1000000000");
  h.caps(davis_caps, "application/x-rtp");
  push(h, {0, 1'000'000, {on(1, 2, 3)}});
  for (const GstClockTime start : {ms, 5 * ms}) {
    push_gap(h.get(), start, GST_CLOCK_TIME_NONE);
    const auto packet = h.pull();
    ASSERT_TRUE(packet);
    EXPECT_EQ(Fields(packet.get()).header->event_count, start == ms ? 1 : 0);
    EXPECT_EQ(Fields(packet.get()).header->start, start == ms ? 0 : 5'000'000);
    EXPECT_FALSE(h.pull());
  }
}

TEST(RtpEventPay, CountsTheEventsOfBuffersThatItCannotSend) {
  Harness h("rtpeventpay max-latency=1000000000");
  h.caps(davis_caps, "application/x-rtp");
  const std::vector events(3, on(1, 2, 3));
  guint64 rejected = 0;
  const auto skips = [&](GstBuffer* buffer, const char* reason) {
    EXPECT_EQ(h.push(buffer), GST_FLOW_OK);
    const auto warning = h.warning();
    EXPECT_TRUE(contains(warning, reason));
    EXPECT_EQ(stat_of(h.element(), "rejected-events"), rejected += 3) << reason;
  };
  skips(buffer_of(GST_CLOCK_TIME_NONE, events, ms), "has no PTS");
  skips(buffer_of(static_cast<GstClockTime>(max_rtp_start) + 1, events, ms), "292 years");
  skips(gst_buffer_append(buffer_of(0, events, ms), gst_buffer_new_memdup("12345", 5)),
        "not a multiple of 8 bytes");
  EXPECT_EQ(h.push(buffer_of(0, {on(346, 2, 3), events[0], on(1, 2, 2)}, ms)), GST_FLOW_OK);
  EXPECT_TRUE(contains(h.warning(), "outside the sensor"));
  EXPECT_EQ(stat_of(h.element(), "rejected-events"), rejected += 2);
  flush({h.get()});  // drops the valid one
  EXPECT_EQ(stat_of(h.element(), "rejected-events"), rejected + 1);
  EXPECT_EQ(stat_of(h.element(), "events"), 0U);
  push_segment(h.get());
  push_eos(h.get());
  EXPECT_FALSE(h.pull());
}

TEST(RtpEventPay, RefusesWhatItCannotSend) {
  Harness small("rtpeventpay mtu=40");
  small.caps(davis_caps, "application/x-rtp");
  EXPECT_EQ(small.push(buffer_of(0, {on(1, 2, 3)}, 10 * ms)), GST_FLOW_ERROR);
  EXPECT_TRUE(contains(small.error(), "set mtu to at least 56"));

  Harness xytp("rtpeventpay format=XYTP");  // EVT3 cannot hold it
  xytp.caps("application/x-event-camera, format=XYTP, width=2049, height=1", "application/x-rtp");
  push(xytp, {0, 10'000'000, {on(2048, 0, 3)}});
  EXPECT_TRUE(xytp.pull());
}

TEST(RtpEventPay, KeepsTheFormatOfItsStream) {
  Harness h("rtpeventpay max-latency=0");
  h.caps(davis_caps, "application/x-rtp");
  g_object_set(h.element(), "format", 1, nullptr);
  gst_harness_set_src_caps_str(h.get(), (davis_caps + ", framerate=30/1").c_str());
  push(h, {0, 1'000'000, {on(1, 2, 3)}});
  const auto packet = h.pull();
  ASSERT_TRUE(packet);
  EXPECT_EQ(Fields(packet.get()).header->format, RtpEventFormat::evt3);
  EXPECT_TRUE(contains(h.out_caps(), "format=(string)EVT3"));
}

TEST(RtpEventDepay, MapsTheSendersTimesToTheTimeOfArrival) {
  std::vector<Interval> intervals;
  for (int i = 0; i < 30; ++i)
    intervals.push_back({7'000'000'000 + i * 10'000'000, 10'000'000, {on(i, 2, 500)}});
  const auto packets = packets_of(intervals);
  Depayloader h;
  for (int i = 0; i < 30; ++i) {
    // Jitter of 3 ms, and a delay of 20 ms more after a while.
    const int jitter = i % 3 + (i < 15 ? 0 : 20);
    h.take(packets[static_cast<std::size_t>(i)].get(),
           static_cast<GstClockTime>(i * 10 + jitter) * ms);
  }
  const Output output(h);
  EXPECT_EQ(output.intervals, intervals);
  ASSERT_EQ(output.segments.size(), 2U);
  const auto running = [&](std::size_t segment, std::size_t interval) {
    return gst_segment_to_running_time(&output.segments[segment], GST_FORMAT_TIME,
                                       static_cast<GstClockTime>(intervals[interval].start));
  };
  EXPECT_EQ(running(0, 0), 0U);
  EXPECT_EQ(running(0, 14), 140 * ms);
  EXPECT_EQ(running(1, 15), 170 * ms);
  EXPECT_EQ(output.segments[1].time, 170 * ms);
}

TEST(RtpEventDepay, StartsOverWithItsSender) {
  const std::vector<Interval> intervals = {{5'000'000'000, 10'000'000, {on(1, 2, 500)}},
                                           {5'010'000'000, 10'000'000, {on(2, 2, 500)}}};
  const std::vector<Interval> again = {{0, 10'000'000, {on(3, 2, 500)}}};
  Depayloader h;
  for (const auto& packet : packets_of(intervals)) h.take(packet.get(), 10 * ms);
  for (const auto& packet : packets_of(again)) h.take(packet.get(), 500 * ms);
  const Output output(h);
  ASSERT_EQ(output.intervals.size(), 3U);
  EXPECT_EQ(output.intervals.front(), again.front());
  EXPECT_EQ(output.segments.back().start, 0U);
  EXPECT_EQ(output.segments.back().base, 500 * ms);
  EXPECT_EQ(output.discontinuities, 2);
  EXPECT_EQ(stat_of(h.element(), "lost-events"), 0U);
}

TEST(RtpEventDepay, WarnsOnceOfASecondSender) {
  std::vector<Interval> intervals;
  for (int i = 0; i < 20; ++i) intervals.push_back({i * 10'000'000, 10'000'000, {on(i, 2, 500)}});
  const auto first = packets_of(intervals, "ssrc=1 seqnum-offset=100");
  const auto second = packets_of(intervals, "ssrc=2 seqnum-offset=95");
  Depayloader h;
  for (std::size_t i = 0; i < first.size(); ++i) {
    h.take(first[i].get(), i * 10 * ms);
    h.take(second[i].get(), i * 10 * ms + ms);
  }
  EXPECT_EQ(stat_of(h.element(), "packets"), 21U);  // the second could have been a restart
  EXPECT_EQ(stat_of(h.element(), "rejected-packets"), 19U);
  EXPECT_EQ(stat_of(h.element(), "late-packets"), 0U);
  EXPECT_TRUE(contains(h.warning(), "second sender"));
  EXPECT_EQ(h.warning(), "");
}

TEST(RtpEventDepay, CountsOnWithAnotherSensor) {
  Harness pay("rtpeventpay max-latency=0");
  pay.caps(davis_caps, "application/x-rtp");
  const Interval first{0, 10'000'000, {on(1, 2, 3)}};
  push(pay, first);
  Depayloader h;
  h.take(pay.pull().get());
  gst_harness_set_src_caps_str(pay.get(),
                               "application/x-event-camera, format=XYTP, width=640, height=480");
  h.caps(rtp_caps + ", width=640, height=480");
  push(pay, {10'000'000, 10'000'000, {on(639, 2, 3)}});
  EXPECT_TRUE(pay.pull());  // lost
  const Interval last{20'000'000, 10'000'000, {on(638, 2, 3)}};
  push(pay, last);
  h.take(pay.pull().get());
  EXPECT_EQ(Output(h).intervals, (std::vector{first, last}));
  EXPECT_EQ(stat_of(h.element(), "events"), 2U);
  EXPECT_EQ(stat_of(h.element(), "lost-events"), 1U);
  EXPECT_EQ(stat_of(pay.element(), "events"), 3U);
}

TEST(RtpEventDepay, NeedsTheSizeOfTheSensor) {
  for (const auto* caps :
       {"", ", width=346", ", width=0, height=260", ", width=(string)9x, height=1",
        ", width=16385, height=1", ", width=346, height=260, format=EVT9"}) {
    Harness h("rtpeventdepay");
    h.caps(rtp_caps + caps);
    EXPECT_TRUE(contains(h.error(), "set width, height and format")) << caps;
  }
}

}  // namespace
