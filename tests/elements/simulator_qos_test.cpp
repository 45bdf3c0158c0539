// SPDX-License-Identifier: LGPL-2.1-or-later
// What simulators do where there is no time for all frames.
#include <algorithm>
#include <utility>
#include <vector>

#include "tests/elements/pipeline.hpp"

namespace {

using namespace harness;

constexpr GstClockTime ms = GST_MSECOND;
const std::string video = "video/x-raw, format=GRAY8, width=32, height=24, framerate=5/1";
const std::string pictures = "video/x-raw, format=GRAY8";

INSTANTIATE_TEST_SUITE_P(, EverySimulator, testing::ValuesIn(simulators));

constexpr GstClockTime frame_time(int i) {
  return static_cast<GstClockTime>(i) * 200 * ms;
}

GstBuffer* frame_at(const Harness& h, int i) {
  return h.frame(frame_time(i), [i](int x, int y) { return (x * 9 + y * 5 + i * 40) % 256; });
}

/// The sink reports how late the picture that starts at `start` was.
void report(Harness& h, GstClockTime start, GstClockTimeDiff lateness,
            GstQOSType type = GST_QOS_TYPE_UNDERFLOW) {
  gst_harness_push_upstream_event(h.get(), gst_event_new_qos(type, 2, lateness, start));
}

/// Elements downstream take frame 1 until frame 4 has arrived.
constexpr GstClockTime slow_until = frame_time(4) + 120 * ms;

/// Makes downstream take until `until` for the next buffer.
void be_slow(Harness& h, GstClockTime until) {
  const auto wait = [](GstPad*, GstPadProbeInfo*, gpointer data) {
    auto& [harness, time] = *static_cast<std::pair<GstHarness*, GstClockTime>*>(data);
    gst_harness_set_time(harness, time);
    return GST_PAD_PROBE_REMOVE;
  };
  gst_pad_add_probe(
      h->sinkpad, GST_PAD_PROBE_TYPE_BUFFER, wait, new std::pair(h.get(), until),
      [](gpointer data) { delete static_cast<std::pair<GstHarness*, GstClockTime>*>(data); });
}

/// The output of frames 0 to 8, where downstream is slow once; or where upstream does not send the
/// frames that are then skipped.
std::vector<std::string> output(Harness& h, bool is_slow) {
  std::vector<std::string> intervals;
  for (int i = 0; i <= 8; ++i) {
    if (!is_slow && i >= 2 && i < 5) continue;
    const bool is_late = is_slow && i < 5 && i >= 2;
    gst_harness_set_time(h.get(), is_late ? slow_until : frame_time(i));
    if (is_slow && i == 1) be_slow(h, slow_until);
    EXPECT_EQ(h.push(frame_at(h, i)), GST_FLOW_OK);
    if (is_slow && (i < 2 || i >= 5)) report(h, frame_time(i), (i == 1 ? 520 : 0) * ms);
    while (const auto buffer = h.pull())
      intervals.push_back(std::to_string(GST_BUFFER_PTS(buffer.get()) / ms) + "+" +
                          std::to_string(GST_BUFFER_DURATION(buffer.get()) / ms) + " " +
                          bytes_of(buffer.get()));
  }
  return intervals;
}

TEST_P(EverySimulator, SkipsWholeFramesWhereDownstreamIsLate) {
  for (const bool draws : {true, false}) {
    Harness h(std::string(GetParam()) + (draws ? "" : " qos=true"));
    h.caps(video, draws ? pictures_of(GetParam()) : GST_EVENT_CAMERA_MEDIA_TYPE);
    Harness expected(GetParam());
    expected.caps(video, draws ? pictures_of(GetParam()) : GST_EVENT_CAMERA_MEDIA_TYPE);
    EXPECT_TRUE(output(h, true) == output(expected, false));
    EXPECT_EQ(stat_of(h.element(), "skipped-frames"), 3U);
    EXPECT_EQ(stat_of(h.element(), "frames"), 6U);
    EXPECT_EQ(stat_of(expected.element(), "skipped-frames"), 0U);
    guint64 skipped = 0;
    while (const auto message = h.message(GST_MESSAGE_QOS)) {
      GstFormat format = GST_FORMAT_UNDEFINED;
      guint64 done = 0;
      guint64 dropped = 0;
      guint64 time = 0;
      gst_message_parse_qos_stats(message.get(), &format, &done, &dropped);
      gst_message_parse_qos(message.get(), nullptr, &time, nullptr, nullptr, nullptr);
      EXPECT_EQ(format, GST_FORMAT_BUFFERS);
      EXPECT_EQ(dropped, ++skipped);
      EXPECT_EQ(time, frame_time(static_cast<int>(skipped) + 1));
    }
    EXPECT_EQ(skipped, 3U);
  }
}

TEST_P(EverySimulator, SkipsNoFrameOfEventsOrWhereQosIsOff) {
  const std::string element = GetParam();
  for (const auto& [launch, out] : {std::pair{element + " qos=false", pictures_of(element)},
                                    {element, std::string(GST_EVENT_CAMERA_MEDIA_TYPE)}}) {
    Harness h(launch);
    h.caps(video, out);
    output(h, true);
    gboolean enabled = TRUE;
    g_object_get(h.element(), "qos", &enabled, nullptr);
    EXPECT_FALSE(enabled);
    EXPECT_EQ(stat_of(h.element(), "skipped-frames"), 0U);
  }
}

TEST_P(EverySimulator, SkipsNothingAfterAFlush) {
  Harness h(GetParam());
  h.caps(video, pictures_of(GetParam()));
  h.push(frame_at(h, 0));
  report(h, 0, 0);
  be_slow(h, slow_until);
  h.push(frame_at(h, 1));
  report(h, frame_time(1), 520 * ms);
  flush({h.get()});
  push_segment(h.get());
  for (int i = 2; i < 5; ++i) h.push(frame_at(h, i));
  EXPECT_EQ(stat_of(h.element(), "skipped-frames"), 0U);
}

TEST(Qos, CountsFromTheStart) {
  Harness h("eventsim-frame");
  h.caps(video, pictures);
  output(h, true);
  gst_element_set_state(h.element(), GST_STATE_READY);
  EXPECT_EQ(stat_of(h.element(), "frames"), 6U);
  gst_element_set_state(h.element(), GST_STATE_PAUSED);
  for (const char* count : {"frames", "skipped-frames", "processing-time"})
    EXPECT_EQ(stat_of(h.element(), count), 0U);
}

/// The view of a camera at 25 frames/s is at most 40 ms late again a second after it stood still
/// for 0.8 s, although frames waited in the meantime.
TEST_P(EverySimulator, ShowsRecentPicturesAgainAfterAPause) {
  Harness h(GetParam());
  h.caps("video/x-raw, format=GRAY8, width=32, height=24, framerate=25/1", pictures_of(GetParam()));
  GstClockTime now = 0;
  const auto late = [&](GstClockTime frame) { return static_cast<GstClockTimeDiff>(now - frame); };
  bool was_skipped = false;
  for (int i = 0; i < 100; ++i) {
    const GstClockTime frame = static_cast<GstClockTime>(i) * 40 * ms;
    now = std::max(now, frame);
    gst_harness_set_time(h.get(), now);
    if (i == 10) be_slow(h, now + 800 * ms);
    h.push(h.frame(frame, [i](int x, int y) { return (x * 9 + y * 5 + i * 40) % 256; }));
    if (i == 10) now += 800 * ms;
    const bool is_shown = h.pull() != nullptr;
    was_skipped |= !is_shown;
    if (is_shown && i > 0) report(h, frame, late(frame) - 20 * static_cast<gint64>(ms));
    if (now <= 2200 * ms) continue;
    EXPECT_TRUE(is_shown) << i;
    EXPECT_LE(late(frame), 40 * static_cast<gint64>(ms)) << i;
  }
  EXPECT_TRUE(was_skipped);
}

/// When pictures were shown, and how old they were then.
struct View {
  std::vector<GstClockTime> times;
  std::vector<GstClockTimeDiff> ages;
};

/// Plays a camera at 30 frames/s, in real time.
View show(const std::string& launch, int frames) {
  Pipeline pipeline("videotestsrc is-live=true pattern=ball num-buffers=" + std::to_string(frames) +
                    " ! video/x-raw,format=GRAY8,width=64,height=48,framerate=30/1 ! " + launch +
                    " ! fakesink name=sink sync=true qos=true signal-handoffs=true");
  View view;
  g_signal_connect(pipeline["sink"], "handoff",
                   G_CALLBACK(+[](GstElement* from, GstBuffer* buffer, GstPad*, View* to) {
                     to->times.push_back(gst_element_get_current_running_time(from));
                     to->ages.push_back(GST_CLOCK_DIFF(GST_BUFFER_PTS(buffer), to->times.back()));
                   }),
                   &view);
  EXPECT_TRUE(pipeline.play()) << pipeline.error;
  return view;
}

/// It takes 66 ms for each picture.
TEST(Qos, GivesASlowSinkRecentPictures) {
  const auto view =
      show("eventsim-frame ! video/x-raw,format=BGRx ! identity sleep-time=66000", 120);
  EXPECT_GE(view.times.size(), 30U);  // of 60 that it could take
  EXPECT_LE(*std::ranges::max_element(view.ages), 300 * static_cast<gint64>(ms));
  for (std::size_t i = 1; i < view.times.size(); ++i)
    EXPECT_LT(view.times[i] - view.times[i - 1], 400 * ms) << i;
}

TEST(Qos, ShowsEveryFrameOfALiveCamera) {
  EXPECT_EQ(show("eventsim-frame ! video/x-raw,format=BGRx", 60).times.size(), 60U);
  EXPECT_EQ(show("eventsim-frame ! eventrender ! video/x-raw,format=BGRx", 60).times.size(), 59U);
}

}  // namespace
