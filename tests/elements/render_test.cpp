// SPDX-License-Identifier: LGPL-2.1-or-later
// eventrender: number, times and content of pictures.
#include <algorithm>

#include "gst/drawing/drawn_video.hpp"
#include "src/core/event.hpp"
#include "src/render/accumulator.hpp"
#include "tests/elements/pipeline.hpp"

namespace {

using namespace harness;
using eventcamera::Event;

constexpr int width = 32;
constexpr int height = 24;
constexpr GstClockTime ms = GST_MSECOND;
const std::string events_caps =
    "application/x-event-camera, format=XYTP, width=32, height=24, framerate=25/1";

std::string grey_at(const std::string& framerate) {
  return "video/x-raw, format=GRAY8, framerate=" + framerate;
}

/// ON in a column, halfway through an interval of 40 ms.
std::vector<Event> column(int x) {
  std::vector<Event> events;
  for (int y = 0; y < height; ++y) events.push_back(on(x, y, 20'000));
  return events;
}

std::string accumulated(const std::vector<Event>& events) {
  eventcamera::Accumulator accumulator(width, height);
  eventcamera::ThreadPool threads;
  accumulator.add(events);
  std::string picture(width * height, '\0');
  accumulator.draw(eventcamera::palette(eventcamera::PaletteName::dark), {},
                   reinterpret_cast<std::byte*>(picture.data()), width, threads);
  return picture;
}

class Render : public testing::Test {
 protected:
  explicit Render(const std::string& launch = "eventrender") : h(launch) {
    gst_harness_set_live(h.get(), FALSE);
  }

  void begin(const std::string& video, const std::string& events = events_caps) {
    gst_harness_set_sink_caps_str(h.get(), video.c_str());
    gst_harness_set_src_caps_str(h.get(), events.c_str());
  }

  GstFlowReturn push(GstClockTime pts, const std::vector<Event>& events,
                     GstClockTime duration = 40 * ms) {
    return h.push(buffer_of(pts, events, duration));
  }

  /// Ends the stream and returns all pictures.
  std::vector<Buffer> finish() {
    push_eos(h.get());
    return pull_until_eos(h.get());
  }

  Buffer wait_for_picture() { return Buffer(gst_harness_pull(h.get())); }

  Harness h;
};

bool shows(const Buffer& picture, const std::vector<Event>& events) {
  return picture && bytes_of(picture.get()) == accumulated(events);
}

struct Picture {
  GstClockTime pts;
  GstClockTime duration;
  std::vector<Event> events;  ///< that it shows
};

void expect(const std::vector<Buffer>& found, const std::vector<Picture>& expected) {
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(GST_BUFFER_PTS(found[i].get()), expected[i].pts) << i;
    EXPECT_EQ(GST_BUFFER_DURATION(found[i].get()), expected[i].duration) << i;
    EXPECT_EQ(GST_BUFFER_DTS(found[i].get()), GST_CLOCK_TIME_NONE) << i;
    EXPECT_TRUE(shows(found[i], expected[i].events)) << i;
  }
}

TEST_F(Render, DrawsWindowsThatAreLongerThanPictures) {
  g_object_set(h.element(), "accumulation-time", 60 * ms, nullptr);
  begin(grey_at("50/1"));
  push(0, column(5));
  push(40 * ms, column(6));
  auto both = column(5);
  for (const auto& event : column(6)) both.push_back(event);
  // (0, 60] and so on: column 5 fires at 20 ms, column 6 at 60 ms.
  expect(finish(), {{0, 20 * ms, column(5)},
                    {20 * ms, 20 * ms, column(5)},
                    {40 * ms, 20 * ms, both},
                    {60 * ms, 20 * ms, column(6)}});
}

TEST_F(Render, Makes30PicturesASecondWhereNobodyAsks) {
  begin("video/x-raw");
  push(0, column(1), GST_SECOND);
  EXPECT_EQ(finish().size(), 30U);
  EXPECT_TRUE(contains(h.out_caps(), "framerate=(fraction)30/1"));
  EXPECT_TRUE(contains(h.out_caps(), "format=(string)BGRx"));
}

TEST_F(Render, MakesAPictureOfEachBufferWhereTheFramerateVaries) {
  begin(grey_at("0/1"));
  push(7, column(1), 20 * ms);
  push(20 * ms + 7, column(2), 100 * ms);
  push_gap(h.get(), 120 * ms + 7, 5 * ms);
  expect(finish(),
         {{7, 20 * ms, column(1)}, {20 * ms + 7, 100 * ms, column(2)}, {120 * ms + 7, 5 * ms, {}}});
}

TEST_F(Render, SkipsThePicturesOfLongPauses) {
  begin(grey_at("25/1"));
  constexpr GstClockTime day = 24 * 3600 * GST_SECOND;
  for (guint64 i = 0; i < 3; ++i) {
    push(i * day, column(1));
    push_gap(h.get(), i * day + 40 * ms, day - 40 * ms);
  }
  push(3 * day, column(2));
  const auto pictures = finish();
  EXPECT_EQ(pictures.size(), 3U * 26 + 1);
  EXPECT_TRUE(shows(pictures[25], {}));
  EXPECT_EQ(GST_BUFFER_PTS(pictures[26].get()), day);
  EXPECT_TRUE(GST_BUFFER_IS_DISCONT(pictures[26].get()));
  EXPECT_TRUE(shows(pictures.back(), column(2)));
  EXPECT_TRUE(contains(h.warning(), "pause for more than a minute"));
  EXPECT_EQ(h.warning(), "");
}

TEST_F(Render, DrawsThroughSilencesButNotThroughLeaps) {
  begin(grey_at("25/1"));
  push(0, column(1));
  push(120 * ms, column(2));
  const GstClockTime far = 100 * 3600 * GST_SECOND;
  push(far, column(3));
  const auto pictures = finish();
  expect(pictures, {{0, 40 * ms, column(1)},
                    {40 * ms, 40 * ms, {}},
                    {80 * ms, 40 * ms, {}},
                    {120 * ms, 40 * ms, column(2)},
                    {far, 40 * ms, column(3)}});
  EXPECT_TRUE(GST_BUFFER_IS_DISCONT(pictures.back().get()));
}

TEST_F(Render, DrawsWhatThereIsAtTheEndOfASegment) {
  begin(grey_at("10/1"));
  push(0, column(1));
  end_segment(h.get(), 40 * ms);
  const Buffer picture(gst_harness_pull(h.get()));
  EXPECT_TRUE(shows(picture, column(1)));
  EXPECT_TRUE(finish().empty());
}

TEST_F(Render, TakesBuffersWithoutDuration) {
  begin(grey_at("50/1"));
  push(0, column(1), GST_CLOCK_TIME_NONE);
  push(40 * ms, column(2), GST_CLOCK_TIME_NONE);
  expect(finish(),
         {{0, 20 * ms, column(1)}, {20 * ms, 20 * ms, {}}, {40 * ms, 20 * ms, column(2)}});
}

TEST_F(Render, IsDiscontinuousAfterTwoFlushes) {
  begin(grey_at("25/1"));
  push(0, column(1));
  wait_for_picture();
  for (int i = 0; i < 2; ++i) flush({h.get()});
  push_segment(h.get());
  push(0, column(2));
  EXPECT_TRUE(GST_BUFFER_IS_DISCONT(wait_for_picture().get()));
}

TEST_F(Render, DrainsAndBeginsAnewInAnotherSegment) {
  begin(grey_at("10/1"));
  push(0, column(1));
  push_segment(h.get());  // the same
  push(40 * ms, column(1));
  push_segment(h.get(), {.start = 5 * GST_SECOND, .time = 5 * GST_SECOND, .base = 100 * ms});
  push(5 * GST_SECOND, column(2), 100 * ms);
  expect(finish(), {{0, 100 * ms, column(1)}, {5 * GST_SECOND, 100 * ms, column(2)}});
}

TEST_F(Render, ShowsNothingFromOutsideTheSegment) {
  begin(grey_at("25/1"));
  push_segment(h.get(), {.start = 100 * ms, .time = 100 * ms, .stop = 180 * ms});
  push(0, column(1));
  push(80 * ms, column(2));  // begins before, and fires at the very start
  push(120 * ms, column(3));
  push(160 * ms, column(4));
  const auto pictures = finish();
  auto first = column(2);
  std::ranges::copy(column(3), std::back_inserter(first));
  expect(pictures, {{100 * ms, 40 * ms, first}, {140 * ms, 40 * ms, column(4)}});
}

TEST_F(Render, DrawsShorterIntervalsWhenPlayedSlower) {
  begin(grey_at("25/1"));
  push_segment(h.get(), {.rate = 0.1});
  push(0, column(5));  // at 20 ms
  std::vector<Picture> pictures;
  for (int i = 0; i < 10; ++i)
    pictures.push_back({i * 4 * ms, 4 * ms, i == 4 ? column(5) : std::vector<Event>{}});
  expect(finish(), pictures);
}

TEST_F(Render, PlaysOnAfterASeekThatUpstreamRefuses) {
  begin(grey_at("25/1"));
  push(0, column(1));
  for (const auto format : {GST_FORMAT_TIME, GST_FORMAT_BYTES})
    EXPECT_FALSE(gst_element_seek(h.element(), 1, format, GST_SEEK_FLAG_FLUSH, GST_SEEK_TYPE_SET, 0,
                                  GST_SEEK_TYPE_NONE, -1));
  push(40 * ms, column(2));
  expect(finish(), {{0, 40 * ms, column(1)}, {40 * ms, 40 * ms, column(2)}});
}

TEST_F(Render, DrainsWhenTheSensorChanges) {
  begin(grey_at("10/1"));
  push(0, column(1));
  gst_harness_set_src_caps_str(
      h.get(), "application/x-event-camera, format=XYTP, width=16, height=8, framerate=25/1");
  push(100 * ms, {on(15, 7, 5)}, 100 * ms);
  const auto pictures = finish();
  ASSERT_EQ(pictures.size(), 2U);
  EXPECT_TRUE(shows(pictures[0], column(1)));
  EXPECT_EQ(gst_buffer_get_size(pictures[1].get()), 16U * 8U);
  EXPECT_EQ(h.warning(), "");
}

TEST_F(Render, TakesSettingsWhilePlaying) {
  begin(grey_at("25/1"));
  push(0, column(1));
  EXPECT_TRUE(shows(wait_for_picture(), column(1)));
  gst_util_set_object_arg(G_OBJECT(h.element()), "mode", "count");
  gst_util_set_object_arg(G_OBJECT(h.element()), "palette", "grey");
  g_object_set(h.element(), "full-scale", 1.0, nullptr);
  push(40 * ms, column(2));
  const auto bytes = bytes_of(wait_for_picture().get());
  EXPECT_EQ(static_cast<guint8>(bytes[1]), 128);
  EXPECT_EQ(static_cast<guint8>(bytes[2]), 255);
}

TEST_F(Render, KeepsTheLastEventsUntilOthersCome) {
  g_object_set(h.element(), "event-count", 24U, nullptr);
  begin(grey_at("25/1"));
  push(0, column(1));
  push_gap(h.get(), 40 * ms, 40 * ms);
  push(80 * ms, column(2));
  expect(finish(),
         {{0, 40 * ms, column(1)}, {40 * ms, 40 * ms, column(1)}, {80 * ms, 40 * ms, column(2)}});
}

TEST_F(Render, LeavesOutPicturesThatComeTooLate) {
  begin(grey_at("25/1"));
  push(0, column(1));
  wait_for_picture();
  gst_harness_push_upstream_event(
      h.get(), gst_event_new_qos(GST_QOS_TYPE_UNDERFLOW, 2, static_cast<gint64>(20 * ms), 40 * ms));
  for (int i = 1; i < 4; ++i) push(i * 40 * ms, column(i));
  const auto pictures = finish();
  expect(pictures, {{80 * ms, 40 * ms, column(2)}, {120 * ms, 40 * ms, column(3)}});
  EXPECT_TRUE(GST_BUFFER_IS_DISCONT(pictures.front().get()));
  while (Owned<GstEvent> event{gst_harness_try_pull_upstream_event(h.get())})
    EXPECT_NE(GST_EVENT_TYPE(event.get()), GST_EVENT_QOS);
  const auto skipped = h.message(GST_MESSAGE_QOS);
  ASSERT_TRUE(skipped);
  guint64 time = 0;
  guint64 drawn = 0;
  guint64 dropped = 0;
  gst_message_parse_qos(skipped.get(), nullptr, &time, nullptr, nullptr, nullptr);
  gst_message_parse_qos_stats(skipped.get(), nullptr, &drawn, &dropped);
  EXPECT_EQ(time, 40 * ms);
  EXPECT_EQ(drawn, 1U);
  EXPECT_EQ(dropped, 1U);
}

/// Live source, and a clock controlled by the test.
class RenderLive : public Render {
 protected:
  RenderLive() {
    gst_harness_set_live(h.get(), TRUE);
    gst_harness_use_testclock(h.get());
    gst_harness_set_upstream_latency(h.get(), 10 * ms);
  }

  /// Sets the clock to a time for which the element must be waiting.
  void pass(GstClockTime time) {
    EXPECT_TRUE(gst_harness_wait_for_clock_id_waits(h.get(), 1, 10));
    gst_harness_set_time(h.get(), time);
    gst_harness_crank_single_clock_wait(h.get());
  }
};

TEST_F(RenderLive, DrawsByTheClockWhereNothingComes) {
  begin(grey_at("25/1"));
  push(0, column(1));
  EXPECT_TRUE(shows(wait_for_picture(), column(1)));
  Buffer picture;
  for (const GstClockTime start : {40, 80}) {
    pass((start + 50) * ms);  // at its end and the latency
    picture = wait_for_picture();
    ASSERT_TRUE(picture);
    EXPECT_EQ(GST_BUFFER_PTS(picture.get()), start * ms);
    EXPECT_TRUE(shows(picture, {}));
  }
  // Late, but shown.
  push(40 * ms, column(2));
  push(120 * ms, column(3));
  picture = wait_for_picture();
  ASSERT_TRUE(picture);
  EXPECT_EQ(GST_BUFFER_PTS(picture.get()), 120 * ms);
  EXPECT_FALSE(shows(picture, column(3)));
}

TEST_F(RenderLive, BeginsWithoutAnyEvent) {
  begin(grey_at("25/1"));
  pass(300 * ms);
  pass(400 * ms);
  const auto picture = wait_for_picture();
  EXPECT_TRUE(shows(picture, {}));
}

TEST_F(RenderLive, IsOnePictureLate) {
  begin(grey_at("25/1"));
  push(0, column(1));
  wait_for_picture();
  EXPECT_EQ(gst_harness_query_latency(h.get()), 50 * ms);
}

/// Pool that has at least 3 buffers, and refuses a configuration until it is told so.
struct PickyPool {
  GstBufferPool parent;
};

gboolean take_picky_config(GstBufferPool* pool, GstStructure* config) {
  GstCaps* caps = nullptr;
  guint size = 0;
  guint min = 0;
  guint max = 0;
  gst_buffer_pool_config_get_params(config, &caps, &size, &min, &max);
  const bool is_enough = min >= 3;
  if (!is_enough) gst_buffer_pool_config_set_params(config, caps, size, 3, max);
  auto* const parent = GST_BUFFER_POOL_CLASS(g_type_class_peek(GST_TYPE_BUFFER_POOL));
  return parent->set_config(pool, config) && is_enough ? TRUE : FALSE;
}

GstBufferPool* new_picky_pool() {
  static const GType type = g_type_register_static_simple(
      GST_TYPE_BUFFER_POOL, "PickyPool", sizeof(GstBufferPoolClass),
      +[](gpointer klass, gpointer) {
        static_cast<GstBufferPoolClass*>(klass)->set_config = take_picky_config;
      },
      sizeof(PickyPool), nullptr, static_cast<GTypeFlags>(0));
  return GST_BUFFER_POOL(gst_object_ref_sink(g_object_new(type, nullptr)));
}

TEST_F(Render, DrawsIntoBuffersOfDownstreamAsItsPoolWants) {
  GstBufferPool* const pool = new_picky_pool();
  gst_pad_add_probe(
      h->sinkpad, GST_PAD_PROBE_TYPE_QUERY_DOWNSTREAM,
      [](GstPad*, GstPadProbeInfo* info, gpointer offered) {
        auto* const query = GST_PAD_PROBE_INFO_QUERY(info);
        if (GST_QUERY_TYPE(query) != GST_QUERY_ALLOCATION) return GST_PAD_PROBE_OK;
        gst_query_add_allocation_pool(query, GST_BUFFER_POOL(offered), width * height, 0, 0);
        return GST_PAD_PROBE_HANDLED;
      },
      pool, nullptr);
  begin(grey_at("25/1"));
  push(0, column(1));
  const auto picture = wait_for_picture();
  ASSERT_TRUE(picture);
  EXPECT_EQ(picture->pool, pool);
  EXPECT_TRUE(shows(picture, column(1)));
  gst_object_unref(pool);
}

TEST(RenderPipeline, SaysWhatToDoIfDownstreamWantsAnotherSize) {
  Pipeline pipeline(
      "videotestsrc num-buffers=3 ! eventsim-diff ! eventrender ! "
      "video/x-raw,width=32 ! fakesink");
  EXPECT_FALSE(pipeline.play());
  EXPECT_TRUE(contains(pipeline.error, "the sensor has 320x240 pixels"));
}

class Reconstruct : public Render {
 protected:
  Reconstruct() : Render("eventreconstruct smoothing=0") {}
};

TEST_F(Reconstruct, ShowsBrightnessInGrey) {
  begin("video/x-raw, framerate=25/1");
  push(0, {on(1, 1, 0), off(2, 1, 1)});
  const auto picture = wait_for_picture();
  ASSERT_TRUE(picture);
  EXPECT_TRUE(contains(h.out_caps(), "format=(string)GRAY8"));
  const auto bytes = bytes_of(picture.get());
  const auto grey = [&bytes](int x) {
    return static_cast<unsigned char>(bytes[static_cast<std::size_t>(width + x)]);
  };
  EXPECT_EQ(grey(0), 128);
  EXPECT_GT(grey(1), 160);
  EXPECT_LT(grey(2), 96);
}

}  // namespace
