// SPDX-License-Identifier: LGPL-2.1-or-later
// Events in datagrams of other tools: packed, unpacked, and beside hostile ones.
#include <gst/net/gstnetaddressmeta.h>

#include <random>
#include <string>
#include <tuple>
#include <vector>

#include "tests/elements/pipeline.hpp"

namespace {

using namespace harness;
using namespace eventcamera;

constexpr int width = 640;
constexpr int height = 480;
constexpr auto events_caps =
    "application/x-event-camera, format=XYTP, width=640, height=480, framerate=0/1";
constexpr auto depay_size = " width=640 height=480";

/// Sorted events, 10 us apart, from 1 s on.
std::vector<AbsoluteEvent> stream(int count) {
  std::vector<AbsoluteEvent> events;
  for (int i = 0; i < count; ++i)
    events.push_back(AbsoluteEvent::at(i % width, i / width % height, 1'000'000 + 10 * i,
                                       i % 3 == 0 ? Polarity::off : Polarity::on));
  return events;
}

/// An element that unpacks, as after udpsrc.
struct Depay : Harness {
  explicit Depay(const std::string& properties)
      : Harness("eventdatagramdepay width=640 height=480 " + properties) {
    gst_harness_set_src_caps_str(get(), "application/x-event-datagram");
  }
};

/// A received datagram.
GstBuffer* datagram(const std::vector<guint8>& bytes, GstClockTime arrival) {
  GstBuffer* buffer = gst_buffer_new_memdup(bytes.data(), bytes.size());
  GST_BUFFER_PTS(buffer) = arrival;
  return buffer;
}

/// One of faery, with an event of pixel (1, y).
GstBuffer* t32(guint32 t, guint8 y, GstClockTime arrival) {
  std::vector<guint8> bytes(8);
  GST_WRITE_UINT32_LE(bytes.data(), t);
  bytes[4] = 1;
  bytes[6] = static_cast<guint8>(y << 1);
  return datagram(bytes, arrival);
}

/// One of jAER, with an event.
GstBuffer* jaer(guint32 number, guint32 t, GstClockTime arrival) {
  std::vector<guint8> bytes(12);
  GST_WRITE_UINT32_BE(bytes.data(), number);
  GST_WRITE_UINT32_BE(bytes.data() + 8, t);
  return datagram(bytes, arrival);
}

class EveryFormat : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(, EveryFormat,
                         testing::Values("format=spif", "format=spif byte-order=big-endian",
                                         "format=spif-timestamps",
                                         "format=spif-timestamps byte-order=big-endian",
                                         "format=t64-x16-y16-on8", "format=t32-x16-y15-on1",
                                         "format=es", "format=jaer",
                                         "format=jaer sequence-number=false"));

TEST_P(EveryFormat, BringsEveryEvent) {
  const std::string properties = GetParam();
  const bool has_times = !properties.starts_with("format=spif") || contains(properties, "stamps");
  Harness h("eventdatagrampay " + properties + " ! eventdatagramdepay " + properties + depay_size);
  h.caps(events_caps);
  const auto sent = stream(50'000);
  push_events(h, sent);
  push_eos(h.get());
  const auto received = pull_events(h);
  ASSERT_EQ(received.size(), sent.size());
  for (std::size_t i = 0; i < sent.size(); ++i) {
    ASSERT_EQ(received[i].x, sent[i].x);
    ASSERT_EQ(received[i].y_p, sent[i].y_p);
    // Without times, it is that of the datagram.
    const auto earliest = has_times ? sent[i].t : sent[i].t - 5000;
    ASSERT_LE(received[i].t, sent[i].t);
    ASSERT_GE(received[i].t, earliest);
  }
  EXPECT_EQ(h.out_caps(),
            "application/x-event-camera, format=(string)XYTP, width=(int)640, height=(int)480, "
            "framerate=(fraction)0/1");
  EXPECT_EQ(stat_of(h.element(), "events"), sent.size());
}

/* payloader */

/// One of successive buffers with 10 events each.
GstBuffer* ten_events(int number, GstClockTime duration = 200 * GST_MSECOND) {
  std::vector<Event> events;
  for (guint64 i = 0; i < 10; ++i)
    events.push_back(
        on(static_cast<int>(i), 2, static_cast<std::uint32_t>(duration / GST_USECOND * i / 10)));
  return buffer_of(static_cast<GstClockTime>(number) * duration, events, duration);
}

/// So long that no timer interferes.
constexpr auto patient = "eventdatagrampay format=t32-x16-y15-on1 max-latency=1000000000";

TEST(Payloader, LetsNoEventWaitIfNoBufferComes) {
  Harness h("eventdatagrampay format=t32-x16-y15-on1 max-latency=30000000");
  h.caps(events_caps, "application/x-event-datagram");
  for (int i = 0; i < 2; ++i) {
    const auto start = g_get_monotonic_time();
    h.push(buffer_of(static_cast<GstClockTime>(i) * GST_SECOND, {on(1, 2, 3)}, GST_MSECOND));
    const Buffer buffer(gst_harness_pull(h.get()));
    ASSERT_TRUE(buffer);
    EXPECT_EQ(gst_buffer_get_size(buffer.get()), 8);
    EXPECT_GE(g_get_monotonic_time() - start, 30'000);
  }
}

TEST(Payloader, SendsDuringGapsAndBeforeSegmentsStartOrEnd) {
  Harness h(patient);
  h.caps(events_caps, "application/x-event-datagram");
  const auto sends = [&](const auto& push) {
    h.push(ten_events(0));
    push();
    return static_cast<bool>(h.pull());
  };
  EXPECT_TRUE(sends([&] { push_segment(h.get()); }));
  EXPECT_TRUE(sends([&] { end_segment(h.get()); }));
  EXPECT_TRUE(sends([&] { push_gap(h.get(), 0, GST_SECOND * 2); }));
  EXPECT_FALSE(sends([&] { push_gap(h.get(), 0, GST_SECOND / 5); }));
}

TEST(Latency, IsAddedAndAnnounced) {
  for (const auto& [element, caps, property] :
       {std::tuple{"eventdatagrampay", events_caps, "max-latency"},
        {"rtpeventpay", events_caps, "max-latency"},
        {"eventdatagramdepay width=640 height=480", "application/x-event-datagram", "latency"}}) {
    Harness h(std::string(element) + " " + property + "=7000000");
    h.caps(caps, "ANY");
    gst_harness_set_upstream_latency(h.get(), 40 * GST_MSECOND);
    EXPECT_EQ(gst_harness_query_latency(h.get()), 47 * GST_MSECOND) << element;
    while (h.message(GST_MESSAGE_LATENCY)) continue;
    g_object_set(h.element(), property, 9 * GST_MSECOND, nullptr);
    EXPECT_EQ(bool(h.message(GST_MESSAGE_LATENCY)), property == std::string("max-latency"));
  }
}

/* depayloader */

TEST(Depayloader, NeedsTheSensorSize) {
  for (const std::string settings :
       {"", "width=640", "height=480", "format=jaer width=1280 height=720"}) {
    Pipeline pipeline("eventdatagramdepay " + settings + " ! fakesink");
    EXPECT_FALSE(pipeline.play());
    EXPECT_TRUE(contains(pipeline.error, "width and height")) << settings;
  }
}

TEST(Depayloader, MapsTheSendersTimeToTheArrival) {
  Depay h("format=t32-x16-y15-on1");
  h.push(t32(5'000'000, 0, 2 * GST_SECOND));
  h.push(t32(5'000'500, 1, 2 * GST_SECOND + 700 * GST_USECOND));
  const auto first = h.pull();
  const auto second = h.pull();
  EXPECT_EQ(GST_BUFFER_PTS(first.get()), 5 * GST_SECOND);
  EXPECT_EQ(GST_BUFFER_PTS(second.get()), 5 * GST_SECOND);
  EXPECT_EQ(GST_BUFFER_DURATION(second.get()), 500 * GST_USECOND);
  const auto event = h.pull_event(GST_EVENT_SEGMENT);
  ASSERT_TRUE(event);
  const GstSegment* segment = nullptr;
  gst_event_parse_segment(event.get(), &segment);
  EXPECT_EQ(gst_segment_to_running_time(segment, GST_FORMAT_TIME, 5 * GST_SECOND), 2 * GST_SECOND);
  EXPECT_EQ(gst_segment_to_stream_time(segment, GST_FORMAT_TIME, 5 * GST_SECOND), 5 * GST_SECOND);
  EXPECT_FALSE(h.pull_event(GST_EVENT_SEGMENT));
}

GstBuffer* from_port(guint16 port, GstBuffer* datagram) {
  GInetAddress* host = g_inet_address_new_loopback(G_SOCKET_FAMILY_IPV4);
  GSocketAddress* address = g_inet_socket_address_new(host, port);
  gst_buffer_add_net_address_meta(datagram, address);
  g_object_unref(address);
  g_object_unref(host);
  return datagram;
}

TEST(Depayloader, ReceivesOneOfTwoSenders) {
  Depay h("format=t32-x16-y15-on1");
  const auto send = [&](guint16 port, guint32 t, GstClockTime arrival) {
    h.push(from_port(port, t32(t, 0, arrival)));
  };
  for (guint i = 0; i < 10; ++i) {
    send(1000, 5'000'000 + 10'000 * i, (2000 + 10 * i) * GST_MSECOND);
    send(2000, 9'000'000 + 10'000 * i, (2001 + 10 * i) * GST_MSECOND);
  }
  EXPECT_EQ(gst_harness_buffers_received(h.get()), 10U);
  EXPECT_EQ(stat_of(h.element(), "rejected-packets"), 10U);
  EXPECT_TRUE(contains(h.warning(), "second sender"));
  EXPECT_EQ(h.warning(), "");
  send(2000, 9'500'000, 4000 * GST_MSECOND);  // the first one has left
  EXPECT_EQ(gst_harness_buffers_received(h.get()), 11U);
}

TEST(Depayloader, IsNotHeldByASenderOfInvalidDatagrams) {
  Depay h("format=t32-x16-y15-on1");
  for (guint i = 0; i < 10; ++i) {
    GstBuffer* const broken = gst_buffer_new_memdup("x", 1);
    GST_BUFFER_PTS(broken) = 10 * i * GST_MSECOND;
    h.push(from_port(2000, broken));
    h.push(from_port(1000, t32(5'000'000 + 10'000 * i, 0, (10 * i + 1) * GST_MSECOND)));
  }
  EXPECT_EQ(gst_harness_buffers_received(h.get()), 10U);
  EXPECT_EQ(stat_of(h.element(), "rejected-packets"), 10U);
  EXPECT_TRUE(contains(h.warning(), "Set format, width and height"));
  EXPECT_EQ(h.error(), "");
}

TEST(Depayloader, FillsSilenceWithGaps) {
  Depay h("format=t32-x16-y15-on1");
  h.push(t32(5'000'000, 0, 2 * GST_SECOND));
  h.push(t32(5'300'000, 1, 2 * GST_SECOND + 300 * GST_MSECOND));
  ASSERT_TRUE(h.pull());
  const auto buffer = h.pull();
  const auto gap = h.pull_event(GST_EVENT_GAP);
  ASSERT_TRUE(gap);
  EXPECT_EQ(gap_of(gap.get()), (Gap{5 * GST_SECOND, 299'999 * GST_USECOND}));
  EXPECT_EQ(GST_BUFFER_PTS(buffer.get()), 5 * GST_SECOND + 299'999 * GST_USECOND);
  EXPECT_FALSE(GST_BUFFER_IS_DISCONT(buffer.get()));
  EXPECT_EQ(events_of(buffer.get()).at(0).t, 1);
}

TEST(Depayloader, TellsOfLosses) {
  Depay h("format=jaer");
  for (const guint32 number : {1, 2, 5, 4, 6})
    h.push(jaer(number, 1000 * number, number * GST_MSECOND));
  for (const bool discont : {true, false, true, false}) {
    const auto buffer = h.pull();
    ASSERT_TRUE(buffer);
    EXPECT_EQ(GST_BUFFER_IS_DISCONT(buffer.get()), discont);
  }
  EXPECT_FALSE(h.pull());
  const auto gap = h.pull_event(GST_EVENT_GAP);
  ASSERT_TRUE(gap);
  GstGapFlags flags{};
  gst_event_parse_gap_flags(gap.get(), &flags);
  EXPECT_EQ(flags, GST_GAP_FLAG_MISSING_DATA);
  EXPECT_EQ(stat_of(h.element(), "lost-packets"), 2);
  EXPECT_EQ(stat_of(h.element(), "late-packets"), 1);
  EXPECT_EQ(stat_of(h.element(), "packets"), 4);
  const auto told = h.message(GST_MESSAGE_ELEMENT);
  ASSERT_TRUE(told);
  EXPECT_TRUE(gst_message_has_name(told.get(), "event-packets-lost"));
  EXPECT_EQ(h.warning(), "");
}

TEST(Depayloader, SaysThatItHearsNothing) {
  for (const char* receiver :
       {"eventdatagramdepay format=jaer width=64 height=48",
        "application/x-rtp,media=application,clock-rate=1000000,encoding-name=X-EVENT-CAMERA,"
        "width=64,height=48 ! rtpeventdepay"}) {
    Pipeline pipeline(std::string("udpsrc address=127.0.0.1 port=0 ! ") + receiver +
                      " ! fakesink async=false");
    pipeline.set(GST_STATE_PLAYING);
    const Owned<GstBus> bus(gst_element_get_bus(pipeline.get()));
    const Owned<GstMessage> message(
        gst_bus_timed_pop_filtered(bus.get(), 60 * GST_SECOND, GST_MESSAGE_WARNING));
    ASSERT_TRUE(message) << receiver;
    EXPECT_TRUE(contains(text_of(message.get()), "No packets for 3 seconds"));
  }
}

TEST(Depayloader, NeedsArrivalTimesForEventsWithoutTimes) {
  Depay h("format=spif");
  EXPECT_EQ(h.push(datagram({1, 0, 2, 0x80}, GST_CLOCK_TIME_NONE)), GST_FLOW_ERROR);
  EXPECT_TRUE(contains(h.error(), "do-timestamp=true"));
}

TEST(Depayloader, SegmentsHaveTheSequenceNumberOfUpstream) {
  Depay h("format=t32-x16-y15-on1");
  push_segment(h.get());
  const Owned<GstEvent> segment(gst_pad_get_sticky_event(h->srcpad, GST_EVENT_SEGMENT, 0));
  const auto number = gst_event_get_seqnum(segment.get());
  h.push(t32(5'000'000, 0, GST_SECOND));
  h.push(t32(0, 0, 2 * GST_SECOND));
  for (int i = 0; i < 2; ++i) {
    const auto sent = h.pull_event(GST_EVENT_SEGMENT);
    ASSERT_TRUE(sent);
    EXPECT_EQ(gst_event_get_seqnum(sent.get()), number);
  }
}

TEST(Depayloader, StartsOverAfterAFlush) {
  Depay h("format=jaer");
  h.push(jaer(70, 9'000'000, GST_SECOND));
  flush({h.get()});
  push_segment(h.get());
  h.push(jaer(2, 8'999'999, 2 * GST_SECOND));
  ASSERT_TRUE(h.pull());
  EXPECT_TRUE(h.pull());
  EXPECT_EQ(stat_of(h.element(), "rejected-packets"), 0);
}

}  // namespace
