// SPDX-License-Identifier: LGPL-2.1-or-later
// eventstats and eventcompare: which events count, when statistics are posted, and what is written.
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#include <cmath>
#include <filesystem>
#include <optional>
#include <string>

#include "src/core/event.hpp"
#include "tests/elements/pipeline.hpp"

namespace {

using namespace harness;
using eventcamera::Event;

constexpr GstClockTime ms = GST_MSECOND;
const std::string small_sensor = "application/x-event-camera, format=XYTP, width=8, height=4";

const GstStructure* structure_of(const Owned<GstMessage>& message) {
  return message ? gst_message_get_structure(message.get()) : nullptr;
}

guint64 count_in(const GstStructure* figures, const char* field = "events") {
  guint64 value = G_MAXUINT64;
  EXPECT_TRUE(gst_structure_get_uint64(figures, field, &value)) << field;
  return value;
}

double number_in(const GstStructure* figures, const char* field) {
  double value = -1;
  EXPECT_TRUE(gst_structure_get_double(figures, field, &value)) << field;
  return value;
}

gint64 time_in(const GstStructure* figures, const char* field) {
  gint64 value = -1;
  EXPECT_TRUE(gst_structure_get_int64(figures, field, &value)) << field;
  return value;
}

/// Nested structure.
const GstStructure* within(const GstStructure* structure, const char* field) {
  const GValue* value = gst_structure_get_value(structure, field);
  return value != nullptr ? gst_value_get_structure(value) : nullptr;
}

class MeasureTest : public testing::Test {
 protected:
  std::string path(const std::string& name) const { return folder / name; }

  const TemporaryFolder folder;
};

/// Events of 10 ms: one at this place.
GstBuffer* one_event(GstClockTime pts, int x = 1, int y = 1) {
  return buffer_of(pts, {on(x, y, 5)}, 10 * ms);
}

/// One event per millisecond for 100 ms, those of the first half caused by light.
GstBuffer* hundred_events(GstClockTime pts) {
  std::vector<Event> events;
  std::vector<GstEventCameraLabel> labels;
  for (std::uint32_t t = 0; t < 100'000; t += 1000) {
    events.push_back(on(1, 0, t));
    labels.push_back({0, t < 50'000 ? guint8{1} : guint8{3}, 0});
  }
  GstBuffer* const buffer = buffer_of(pts, events, 100 * ms);
  gst_buffer_add_event_camera_label_meta(buffer, labels.data(), labels.size());
  return buffer;
}

constexpr SegmentFields from_50_to_80{.start = 50 * ms, .time = 50 * ms, .stop = 80 * ms};

/* eventstats */

class StatsTest : public MeasureTest {};

TEST_F(StatsTest, PassesEventsAndPostsFiguresOfIntervalsAndOfEverything) {
  Harness h("eventstats interval=" + std::to_string(50 * ms) +
            " location=" + in_quotes(path("f.json")) + " map=" + in_quotes(path("map.png")));
  h.caps(small_sensor);
  h.push(buffer_of(1000 * ms, {on(1, 0, 0), off(1, 0, 30), on(2, 3, 40)}, 40 * ms));
  EXPECT_EQ(bytes_of(h.pull().get()).size(), 24U);
  EXPECT_FALSE(h.message(GST_MESSAGE_ELEMENT));
  push_gap(h.get(), 1040 * ms, 20 * ms);
  auto message = h.message(GST_MESSAGE_ELEMENT);
  const auto* recent = structure_of(message);
  ASSERT_TRUE(recent);
  EXPECT_TRUE(gst_structure_has_name(recent, "eventstats"));
  EXPECT_EQ(count_in(recent), 3U);
  EXPECT_EQ(time_in(recent, "start"), gint64{1000 * ms});
  EXPECT_EQ(time_in(recent, "end"), gint64{1060 * ms});
  EXPECT_NEAR(number_in(recent, "rate"), 50, 1e-9);
  EXPECT_NEAR(number_in(recent, "on-share"), 2.0 / 3, 1e-9);
  EXPECT_NEAR(number_in(recent, "mean"), 3 / 32.0 / 0.06, 1e-9);
  EXPECT_EQ(count_in(recent, "interval-p50"), 30 * GST_USECOND);

  h.push(buffer_of(1060 * ms, {on(2, 3, 40)}, 40 * ms));
  push_eos(h.get());
  message = h.message(GST_MESSAGE_ELEMENT);
  const auto* cumulative = structure_of(message);
  ASSERT_TRUE(cumulative);
  EXPECT_EQ(count_in(cumulative), 4U);
  EXPECT_EQ(time_in(cumulative, "end"), gint64{1100 * ms});
  EXPECT_NEAR(number_in(cumulative, "rate"), 40, 1e-9);
  // Two pixels with 2 events each, and 30 with none, in a tenth of a second.
  EXPECT_NEAR(number_in(cumulative, "std-dev"), std::sqrt(8 / 32.0 - 1 / 64.0) * 10, 1e-9);
  EXPECT_TRUE(contains(text_in(path("f.json")), "\"events\" : 4"));
  EXPECT_TRUE(contains(text_in(path("f.json")), "\"cumulative\" : true"));
  EXPECT_EQ(text_in(path("map.png")).substr(1, 3), "PNG");
}

struct Figures {
  guint64 events;
  double rate;
  GstClockTime start;
  GstClockTime end;
};

struct Stream {
  const char* name;
  void (*push)(Harness& h);
  std::vector<Figures> figures;
};

const Stream streams[] = {
    {"silence, which counts as time",
     [](Harness& h) {
       for (const GstClockTime start : {0, 90}) h.push(one_event(start * ms));
     },
     {{2, 20, 0, 100 * ms}}},
    {"events past the end of their buffer",
     [](Harness& h) {
       for (const GstClockTime start : {0, 10, 20})
         h.push(buffer_of(start * ms, {on(1, 0, 5), on(2, 0, 900'000)}, 10 * ms));
     },
     {{3, 100, 0, 30 * ms}}},
    {"a flush",
     [](Harness& h) {
       h.push(one_event(0));
       flush({h.get()});
       push_segment(h.get());
       h.push(one_event(20 * ms));
     },
     {{1, 100, 20 * ms, 30 * ms}}},
    {"segments that end",
     [](Harness& h) {
       for (const GstClockTime base : {0, 10}) {
         push_segment(h.get(), {.base = base * ms});
         h.push(one_event(base * ms));
         end_segment(h.get());
       }
     },
     {{1, 100, 0, 10 * ms}, {1, 100, 10 * ms, 20 * ms}}},
    {"events outside a segment",
     [](Harness& h) {
       push_segment(h.get(), from_50_to_80);
       h.push(hundred_events(0));
       h.push(hundred_events(100 * ms));
       push_gap(h.get(), 200 * ms, 100 * ms);
     },
     {{30, 1000, 50 * ms, 80 * ms}}},
    {"two sensors",
     [](Harness& h) {
       h.push(one_event(0, 7, 3));
       h.caps("application/x-event-camera, format=XYTP, width=4, height=2");
       h.push(one_event(10 * ms, 3, 1));
       h.push(one_event(20 * ms, 7, 3));
     },
     {{1, 100, 0, 10 * ms}, {1, 50, 10 * ms, 30 * ms}}},
    {"time that goes back, and a buffer without PTS",
     [](Harness& h) {
       h.push(one_event(500 * ms));
       h.push(one_event(0));
       h.push(one_event(GST_CLOCK_TIME_NONE));
     },
     {{2, 100, 500 * ms, 10 * ms}}},
};

TEST_F(StatsTest, PostsTheFiguresOfEachPartOfAStream) {
  for (const auto& stream : streams) {
    SCOPED_TRACE(stream.name);
    Harness h("eventstats interval=0");
    h.caps(small_sensor);
    stream.push(h);
    push_eos(h.get());
    for (const auto& expected : stream.figures) {
      const auto message = h.message(GST_MESSAGE_ELEMENT);
      const auto* found = structure_of(message);
      ASSERT_TRUE(found);
      EXPECT_EQ(count_in(found), expected.events);
      EXPECT_NEAR(number_in(found, "rate"), expected.rate, 1e-9);
      EXPECT_EQ(time_in(found, "start"), static_cast<gint64>(expected.start));
      EXPECT_EQ(time_in(found, "end"), static_cast<gint64>(expected.end));
      if (expected.events == 30) {
        EXPECT_EQ(count_in(found, "light-events"), 0U);
      }
    }
    EXPECT_FALSE(h.message(GST_MESSAGE_ELEMENT));
  }
}

TEST_F(StatsTest, WritesAtAStopWhatHasComeSinceTheEnd) {
  for (const bool has_ended : {false, true}) {
    Harness h("eventstats location=" + in_quotes(path("f.json")) +
              " map=" + in_quotes(path("map.png")));
    h.caps(small_sensor);
    h.push(one_event(0));
    if (has_ended) {
      push_eos(h.get());
      EXPECT_TRUE(std::filesystem::remove(path("f.json")));
    }
    gst_element_set_state(h.element(), GST_STATE_READY);
    EXPECT_EQ(text_in(path("f.json")).find("\"events\" : 1") != std::string::npos, !has_ended);
    EXPECT_EQ(text_in(path("map.png")).substr(1, 3), "PNG");
    EXPECT_TRUE(h.message(GST_MESSAGE_ELEMENT));
  }
}

TEST_F(StatsTest, WritesToALinkAPipeAndADevice) {
  const auto measure = [](const std::string& location) {
    Harness h("eventstats location=" + in_quotes(location));
    h.caps(small_sensor);
    h.push(one_event(0));
    push_eos(h.get());
    return h.error();
  };
  const auto file = path("f.json");
  std::filesystem::create_symlink("f.json", path("link"));
  for (int times = 0; times < 2; ++times) {
    EXPECT_EQ(measure(path("link")), "");
    EXPECT_TRUE(std::filesystem::is_symlink(path("link")));
    EXPECT_TRUE(std::filesystem::remove(file));
  }
  const auto pipe = path("pipe");
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  const int reader = open(pipe.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  ASSERT_GE(reader, 0);
  EXPECT_EQ(measure(pipe), "");
  EXPECT_TRUE(std::filesystem::is_fifo(pipe));
  char first = 0;
  EXPECT_EQ(read(reader, &first, 1), 1);
  EXPECT_EQ(first, '{');
  close(reader);
  EXPECT_NE(measure("/dev/full"), "");
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/full"));
}

TEST_F(StatsTest, SaysBeforehandThatAFolderIsMissing) {
  for (const std::string element : {"eventstats", "eventcompare"})
    for (const auto& [setting, error] :
         {std::pair{"location=" + in_quotes(path("nowhere/file")), "No such folder"},
          {"map=" + in_quotes(path("nowhere/file")), "No such folder"},
          {"location=" + in_quotes(path("")), "is a folder"}}) {
      Pipeline pipeline(element + " " + setting + "  fakesink");
      EXPECT_FALSE(pipeline.play());
      EXPECT_TRUE(contains(pipeline.error, error));
      EXPECT_NE(pipeline.error.find(setting.substr(setting.find('"') + 1, 20)), std::string::npos);
    }
}

/* eventcompare */

class CompareTest : public MeasureTest {
 protected:
  void make(const std::string& properties = "") {
    compare.emplace("eventcompare " + properties, "candidate", "reference");
    candidate = compare->first.get();
    reference = compare->second.get();
    for (auto* h : {reference, candidate}) gst_harness_set_src_caps_str(h, small_sensor.c_str());
  }

  void push_both(std::initializer_list<GstClockTime> starts) {
    for (const auto start : starts)
      for (auto* h : {reference, candidate}) gst_harness_push(h, one_event(start));
  }

  /// Ends both streams, collects the buffers that pass, and returns the statistics.
  const GstStructure* conclude() {
    compare->end();
    passed = pull_until_eos(candidate);
    message_ = compare->message(GST_MESSAGE_ELEMENT);
    return structure_of(message_);
  }

  /// Expects comparisons of as many events of both streams each, up to this time.
  void expect_comparisons(std::initializer_list<std::pair<guint64, GstClockTime>> expected) {
    const auto* figures = conclude();
    for (const auto& [count, end] : expected) {
      ASSERT_TRUE(figures);
      EXPECT_EQ(time_in(figures, "end"), static_cast<gint64>(end));
      for (const char* role : {"reference", "candidate"})
        EXPECT_EQ(count_in(within(figures, role)), count) << role;
      message_ = compare->message(GST_MESSAGE_ELEMENT);
      figures = structure_of(message_);
    }
    EXPECT_FALSE(message_);
  }

  std::optional<TwoInputs> compare;
  Owned<GstMessage> message_;
  GstHarness* reference = nullptr;
  GstHarness* candidate = nullptr;
  std::vector<Buffer> passed;
};

TEST_F(CompareTest, ComparesWhatBothCoverAndPassesTheCandidate) {
  make("location=" + in_quotes(path("f.json")) + " map=" + in_quotes(path("map.png")));
  // The candidate starts 10 ms later; earlier events of the reference do not count.
  gst_harness_push(reference,
                   buffer_of(0, {on(1, 1, 5'000), on(1, 1, 15'000), off(6, 1, 18'000)}, 20 * ms));
  gst_harness_push(candidate, buffer_of(10 * ms, {on(2, 2, 1'000), on(6, 1, 8'500)}, 10 * ms));
  gst_harness_push(reference, buffer_of(20 * ms, {on(5, 1, 1'000)}, 20 * ms));
  push_gap(candidate, 20 * ms, 20 * ms);
  gst_harness_push(reference, buffer_of(40 * ms, {on(5, 1, 1'000)}, 20 * ms));
  const auto* figures = conclude();
  ASSERT_TRUE(figures);
  EXPECT_TRUE(gst_structure_has_name(figures, "eventcompare"));
  EXPECT_EQ(time_in(figures, "start"), gint64{10 * ms});
  EXPECT_EQ(time_in(figures, "end"), gint64{40 * ms});
  EXPECT_EQ(count_in(within(figures, "reference")), 3U);
  EXPECT_EQ(count_in(within(figures, "candidate")), 2U);
  const auto* of_reference = within(figures, "reference-matches");
  EXPECT_NEAR(number_in(of_reference, "within-1ms"), 0, 1e-9);
  EXPECT_NEAR(number_in(of_reference, "within-5ms"), 2 / 3.0, 1e-9);
  EXPECT_NEAR(number_in(within(figures, "candidate-matches"), "within-5ms"), 1, 1e-9);
  const GValue* curve = gst_structure_get_value(within(figures, "rate-curve"), "reference");
  ASSERT_TRUE(curve);
  EXPECT_EQ(gst_value_array_get_size(curve), 30U);
  EXPECT_EQ(g_value_get_uint64(gst_value_array_get_value(curve, 5)), 1U);

  ASSERT_EQ(passed.size(), 1U);
  EXPECT_EQ(events_of(passed[0].get()).size(), 2U);
  EXPECT_EQ(GST_BUFFER_PTS(passed[0].get()), 10 * ms);
  EXPECT_TRUE(next_event(candidate, GST_EVENT_GAP));
  const auto json = text_in(path("f.json"));
  for (const char* field : {"map-correlation", "candidate-matches", "rate-curve", "std-dev"})
    EXPECT_TRUE(contains(json, field)) << field;
  EXPECT_EQ(text_in(path("map.png")).substr(1, 3), "PNG");
}

TEST_F(CompareTest, PassesTheCandidateOnWhereTheReferenceHasEnded) {
  make();
  gst_harness_push(reference, one_event(0));
  push_eos(reference);
  for (const GstClockTime t : {0 * ms, 10 * ms, 20 * ms}) gst_harness_push(candidate, one_event(t));
  expect_comparisons({{1, 10 * ms}});
  EXPECT_EQ(passed.size(), 3U);
}

TEST_F(CompareTest, ComparesEachSegment) {
  make();
  for (const GstClockTime base : {0 * ms, 10 * ms}) {
    for (auto* h : {reference, candidate}) {
      push_segment(h, {.base = base});
      gst_harness_push(h, one_event(0));
      end_segment(h);
    }
    ASSERT_TRUE(next_event(candidate, GST_EVENT_SEGMENT_DONE));
  }
  expect_comparisons({{1, 10 * ms}, {1, 10 * ms}});
}

TEST_F(CompareTest, StartsOverOnceTimeGoesBackInBothStreams) {
  make();
  push_both({0 * ms, 10 * ms});
  gst_harness_push(reference, one_event(20 * ms));
  gst_harness_push(candidate, one_event(0));
  gst_harness_push(reference, one_event(30 * ms));
  gst_harness_push(reference, one_event(0));
  expect_comparisons({{2, 20 * ms}, {1, 10 * ms}});
  EXPECT_EQ(passed.size(), 3U);
}

TEST_F(CompareTest, StartsOverAfterAFlush) {
  make();
  push_both({0});
  compare->start_over();
  push_both({10 * ms});
  expect_comparisons({{1, 20 * ms}});
}

TEST_F(CompareTest, ComparesOnlyWhatIsInTheSegments) {
  make();
  for (auto* h : {reference, candidate}) {
    push_segment(h, from_50_to_80);
    gst_harness_push(h, hundred_events(0));
  }
  expect_comparisons({{30, 80 * ms}});
  ASSERT_EQ(passed.size(), 1U);
  EXPECT_EQ(events_of(passed[0].get()).size(), 100U);
}

TEST_F(CompareTest, ClassifiesTheEventsThatAreLeft) {
  make();
  const auto push_caused = [](GstHarness* h, guint lights, guint leaks) {
    std::vector<GstEventCameraLabel> labels(lights, {0, GST_EVENT_CAMERA_CAUSE_LIGHT, 0});
    labels.resize(lights + leaks, {0, GST_EVENT_CAMERA_CAUSE_LEAK, 0});
    GstBuffer* const buffer = buffer_of(0, std::vector<Event>(labels.size()), 10 * ms);
    gst_buffer_add_event_camera_label_meta(buffer, labels.data(), labels.size());
    gst_harness_push(h, buffer);
  };
  push_caused(reference, 3, 4);
  push_caused(candidate, 2, 1);
  const auto* figures = conclude();
  ASSERT_TRUE(figures);
  const auto* classification = within(figures, "classification");
  ASSERT_TRUE(classification);
  for (const auto& [name, count] : {std::pair("true-positives", 2U),
                                    {"false-positives", 1U},
                                    {"false-negatives", 1U},
                                    {"true-negatives", 3U}})
    EXPECT_EQ(count_in(classification, name), count) << name;
  EXPECT_DOUBLE_EQ(number_in(classification, "true-positive-rate"), 2 / 3.0);
  EXPECT_DOUBLE_EQ(number_in(classification, "false-positive-rate"), 1 / 4.0);
}

TEST_F(CompareTest, WritesAtAStopWhatHasComeSinceTheEnd) {
  for (const bool has_ended : {false, true}) {
    make("location=" + in_quotes(path("f.json")));
    push_both({0, 10 * ms});
    EXPECT_TRUE(Buffer(gst_harness_pull(candidate)));  // both have been compared
    if (has_ended) {
      EXPECT_TRUE(conclude());
      EXPECT_TRUE(std::filesystem::remove(path("f.json")));
    }
    gst_element_set_state(compare->element.get(), GST_STATE_READY);
    EXPECT_EQ(text_in(path("f.json")).empty(), has_ended);
  }
}

/// At once, because a source whose size changes may wait for one of the streams itself.
TEST_F(CompareTest, ReportsAndRefusesAChangeOfSize) {
  make();
  push_both({0});
  gst_harness_set_src_caps_str(reference,
                               "application/x-event-camera, format=XYTP, width=9, height=4");
  EXPECT_TRUE(contains(compare->error(), "9 x 4"));
}

}  // namespace
