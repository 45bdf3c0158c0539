// SPDX-License-Identifier: LGPL-2.1-or-later
// eventstats and eventcompare: which events count, when statistics are posted, and what is written.
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <string>

#include "src/core/event.hpp"
#include "tests/elements/pipeline.hpp"

namespace {

using namespace harness;
using eventcamera::Event;
using eventcamera::Polarity;

constexpr GstClockTime ms = GST_MSECOND;
const std::string small_sensor = "application/x-event-camera, format=XYTP, width=8, height=4";

std::string text_in(const std::filesystem::path& path) {
  std::stringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

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
  MeasureTest() {
    std::filesystem::remove_all(folder);
    std::filesystem::create_directories(folder);
  }
  ~MeasureTest() override { std::filesystem::remove_all(folder); }

  /// Path as text for a launch line.
  std::string path(const std::string& name) const { return (folder / name).string(); }

  const std::filesystem::path folder =
      std::filesystem::temp_directory_path() /
      (std::string("measure_") + testing::UnitTest::GetInstance()->current_test_info()->name());
};

/* eventstats */

class StatsTest : public MeasureTest {};

TEST_F(StatsTest, PassesEventsAndPostsFiguresOfIntervalsAndOfEverything) {
  Harness h("eventstats interval=" + std::to_string(50 * ms) +
            " location=" + in_quotes(path("f.json")) + " map=" + in_quotes(path("map.png")));
  h.caps(small_sensor);
  const std::vector first = {Event::at(1, 0, 0, Polarity::on), Event::at(1, 0, 30, Polarity::off),
                             Event::at(2, 3, 40, Polarity::on)};
  h.push(buffer_of(1000 * ms, first, 40 * ms));
  EXPECT_EQ(bytes_of(h.pull().get()).size(), 24U);
  EXPECT_FALSE(h.message(GST_MESSAGE_ELEMENT));
  gst_harness_push_event(h.get(), gst_event_new_gap(1040 * ms, 20 * ms));
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

  h.push(buffer_of(1060 * ms, {Event::at(2, 3, 40, Polarity::on)}, 40 * ms));
  gst_harness_push_event(h.get(), gst_event_new_eos());
  message = h.message(GST_MESSAGE_ELEMENT);
  const auto* cumulative = structure_of(message);
  ASSERT_TRUE(cumulative);
  EXPECT_EQ(count_in(cumulative), 4U);
  EXPECT_EQ(time_in(cumulative, "end"), gint64{1100 * ms});
  EXPECT_NEAR(number_in(cumulative, "rate"), 40, 1e-9);
  // Two pixels with 2 events each, and 30 with none, in a tenth of a second.
  EXPECT_NEAR(number_in(cumulative, "std-dev"), std::sqrt(8 / 32.0 - 1 / 64.0) * 10, 1e-9);
  EXPECT_NE(text_in(path("f.json")).find("\"events\" : 4"), std::string::npos);
  EXPECT_NE(text_in(path("f.json")).find("\"cumulative\" : true"), std::string::npos);
  EXPECT_EQ(text_in(path("map.png")).substr(1, 3), "PNG");
}

TEST_F(StatsTest, DoesNotCountEventsPastTheEndOfTheirBuffer) {
  Harness h("eventstats interval=0");
  h.caps(small_sensor);
  for (const GstClockTime start : {0, 10, 20})
    h.push(buffer_of(start * ms,
                     {Event::at(1, 0, 5, Polarity::on), Event::at(2, 0, 900'000, Polarity::on)},
                     10 * ms));
  EXPECT_NE(h.warning().find("later than the end of their buffer"), std::string::npos);
  gst_harness_push_event(h.get(), gst_event_new_eos());
  const auto message = h.message(GST_MESSAGE_ELEMENT);
  const auto* figures = structure_of(message);
  ASSERT_TRUE(figures);
  EXPECT_EQ(count_in(figures), 3U);
  EXPECT_NEAR(static_cast<double>(count_in(figures, "interval-p50")), 10 * ms, 0.03 * 10 * ms);
}

TEST_F(StatsTest, WritesWhatHasComeWhereItIsStopped) {
  Harness h("eventstats location=" + in_quotes(path("f.json")) +
            " map=" + in_quotes(path("map.png")));
  h.caps(small_sensor);
  h.push(buffer_of(0, {Event::at(1, 0, 5, Polarity::on)}, 10 * ms));
  gst_element_set_state(h.element(), GST_STATE_READY);
  EXPECT_NE(text_in(path("f.json")).find("\"events\" : 1"), std::string::npos);
  EXPECT_EQ(text_in(path("map.png")).substr(1, 3), "PNG");
  const auto message = h.message(GST_MESSAGE_ELEMENT);
  ASSERT_TRUE(message);
  EXPECT_EQ(count_in(structure_of(message)), 1U);
}

TEST_F(StatsTest, WritesNothingAtAStopWhereNothingHasComeSinceItDid) {
  for (const bool with_events : {false, true}) {
    Harness h("eventstats location=" + in_quotes(path("f.json")));
    h.caps(small_sensor);
    if (with_events) {
      h.push(buffer_of(0, {Event::at(1, 0, 5, Polarity::on)}, 10 * ms));
      gst_harness_push_event(h.get(), gst_event_new_eos());
      EXPECT_TRUE(std::filesystem::remove(path("f.json")));
    }
    gst_element_set_state(h.element(), GST_STATE_READY);
    EXPECT_FALSE(std::filesystem::exists(path("f.json")));
  }
}

TEST_F(StatsTest, CountsASilenceBetweenBuffersAsTime) {
  Harness h("eventstats");
  h.caps(small_sensor);
  h.push(buffer_of(0, {Event::at(1, 0, 5, Polarity::on)}, 10 * ms));
  h.push(buffer_of(90 * ms, {Event::at(1, 0, 5, Polarity::on)}, 10 * ms));
  gst_harness_push_event(h.get(), gst_event_new_eos());
  const auto message = h.message(GST_MESSAGE_ELEMENT);
  ASSERT_TRUE(message);
  EXPECT_NEAR(number_in(structure_of(message), "rate"), 20, 1e-9);
}

TEST_F(StatsTest, ForgetsWhatLiesBeforeAFlush) {
  Harness h("eventstats");
  h.caps(small_sensor);
  h.push(buffer_of(0, {Event::at(1, 0, 5, Polarity::on)}, 10 * ms));
  flush({h.get()});
  push_segment(h.get());
  h.push(buffer_of(0, {Event::at(2, 0, 5, Polarity::off)}, 10 * ms));
  gst_harness_push_event(h.get(), gst_event_new_eos());
  const auto message = h.message(GST_MESSAGE_ELEMENT);
  ASSERT_TRUE(message);
  EXPECT_EQ(count_in(structure_of(message)), 1U);
  EXPECT_EQ(number_in(structure_of(message), "on-share"), 0);
}

TEST_F(StatsTest, MeasuresEachSegment) {
  Harness h("eventstats location=" + in_quotes(path("f.json")));
  h.caps(small_sensor);
  for (const GstClockTime base : {0 * ms, 10 * ms}) {
    play_on(h.get(), base);
    h.push(buffer_of(0, {Event::at(1, 0, 5, Polarity::on)}, 10 * ms));
    end_segment(h.get());
    const auto message = h.message(GST_MESSAGE_ELEMENT);
    ASSERT_TRUE(message);
    EXPECT_EQ(count_in(structure_of(message)), 1U);
    EXPECT_TRUE(std::filesystem::remove(path("f.json")));
  }
  gst_harness_push_event(h.get(), gst_event_new_eos());  // of nothing more
  EXPECT_FALSE(h.message(GST_MESSAGE_ELEMENT));
}

TEST_F(StatsTest, CountsOnlyWhatIsInTheSegment) {
  Harness h("eventstats");
  h.caps(small_sensor);
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  segment.start = segment.time = 50 * ms;
  segment.stop = 80 * ms;
  gst_harness_push_event(h.get(), gst_event_new_segment(&segment));
  std::vector<Event> events;
  std::vector<GstEventCameraLabel> labels;
  for (std::uint32_t t = 0; t < 100'000; t += 1000) {
    events.push_back(Event::at(1, 0, t, Polarity::on));
    labels.push_back(
        {.object_class = 0, .cause = t < 50'000 ? guint8{1} : guint8{3}, .reserved = 0});
  }
  GstBuffer* buffer = buffer_of(0, events, 100 * ms);
  gst_buffer_add_event_camera_label_meta(buffer, labels.data(), labels.size());
  h.push(buffer);
  h.push(buffer_of(100 * ms, events, 100 * ms));
  gst_harness_push_event(h.get(), gst_event_new_gap(200 * ms, 100 * ms));
  gst_harness_push_event(h.get(), gst_event_new_eos());
  const auto message = h.message(GST_MESSAGE_ELEMENT);
  const auto* figures = structure_of(message);
  ASSERT_TRUE(figures);
  EXPECT_EQ(count_in(figures), 30U);
  EXPECT_EQ(count_in(figures, "light-events"), 0U);
  EXPECT_EQ(time_in(figures, "start"), gint64{50 * ms});
  EXPECT_EQ(time_in(figures, "end"), gint64{80 * ms});
  EXPECT_FALSE(h.message(GST_MESSAGE_WARNING));
}

TEST_F(StatsTest, MeasuresEachSensorOnItsOwn) {
  Harness h("eventstats");
  h.caps(small_sensor);
  h.push(buffer_of(0, {Event::at(7, 3, 5, Polarity::on)}, 10 * ms));
  h.caps("application/x-event-camera, format=XYTP, width=4, height=2");
  auto message = h.message(GST_MESSAGE_ELEMENT);
  ASSERT_TRUE(message);
  EXPECT_EQ(count_in(structure_of(message)), 1U);
  h.push(buffer_of(10 * ms,
                   {Event::at(3, 1, 5, Polarity::on), Event::at(3, 1, 6, Polarity::on),
                    Event::at(7, 3, 7, Polarity::on)},
                   10 * ms));
  EXPECT_TRUE(h.message(GST_MESSAGE_WARNING));
  gst_harness_push_event(h.get(), gst_event_new_eos());
  message = h.message(GST_MESSAGE_ELEMENT);
  ASSERT_TRUE(message);
  EXPECT_EQ(count_in(structure_of(message)), 2U);
  EXPECT_NEAR(number_in(structure_of(message), "mean"), 2 / 8.0 / 0.01, 1e-9);
}

TEST_F(StatsTest, GoesOnWhereTimeGoesBackAndWherePtsAreMissing) {
  Harness h("eventstats");
  h.caps(small_sensor);
  h.push(buffer_of(500 * ms, {Event::at(1, 0, 5, Polarity::on)}, 10 * ms));
  h.push(buffer_of(0, {Event::at(1, 0, 5, Polarity::on)}, 10 * ms));
  h.push(buffer_of(GST_CLOCK_TIME_NONE, {Event::at(1, 0, 5, Polarity::on)}, 10 * ms));
  EXPECT_TRUE(h.message(GST_MESSAGE_WARNING));
  gst_harness_push_event(h.get(), gst_event_new_eos());
  const auto message = h.message(GST_MESSAGE_ELEMENT);
  ASSERT_TRUE(message);
  EXPECT_EQ(count_in(structure_of(message)), 2U);
  EXPECT_EQ(count_in(structure_of(message), "interval-p50"), 0U);
  EXPECT_NEAR(number_in(structure_of(message), "rate"), 100, 1e-9);
}

TEST_F(StatsTest, WritesToALinkAPipeAndADevice) {
  const auto measure = [](const std::string& location) {
    Harness h("eventstats location=" + in_quotes(location));
    h.caps(small_sensor);
    h.push(buffer_of(0, {Event::at(1, 0, 5, Polarity::on)}, 10 * ms));
    gst_harness_push_event(h.get(), gst_event_new_eos());
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

/// Sets an element to PAUSED and returns its error.
std::string refusal_of(const std::string& launch) {
  gst_init(nullptr, nullptr);
  Owned<GstElement> element(GST_ELEMENT(gst_object_ref_sink(
      gst_parse_launch_full(launch.c_str(), nullptr, GST_PARSE_FLAG_NONE, nullptr))));
  const Owned<GstBus> bus(gst_bus_new());
  gst_element_set_bus(element.get(), bus.get());
  EXPECT_EQ(gst_element_set_state(element.get(), GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE);
  const Owned<GstMessage> message(gst_bus_pop_filtered(bus.get(), GST_MESSAGE_ERROR));
  gst_element_set_state(element.get(), GST_STATE_NULL);
  gst_element_set_bus(element.get(), nullptr);
  return message ? text_of(message.get()) : "no error";
}

TEST_F(StatsTest, SaysBeforehandThatAFolderIsMissing) {
  for (const std::string element : {"eventstats", "eventcompare"}) {
    for (const std::string property : {"location", "map"}) {
      const auto text =
          refusal_of(element + " " + property + "=" + in_quotes(path("nowhere/file")));
      EXPECT_NE(text.find("No such folder"), std::string::npos) << text;
      EXPECT_NE(text.find("nowhere"), std::string::npos) << text;
    }
    const auto text = refusal_of(element + " location=" + in_quotes(folder.string()));
    EXPECT_NE(text.find("is a folder"), std::string::npos) << text;
  }
}

/* eventcompare */

class CompareTest : public MeasureTest {
 protected:
  void make(const std::string& properties = "") {
    compare.emplace("eventcompare " + properties, "candidate", "reference");
    candidate = compare->first.get();
    reference = compare->second.get();
  }

  void begin(const std::string& of_reference = small_sensor,
             const std::string& of_candidate = small_sensor) {
    gst_harness_set_src_caps_str(reference, of_reference.c_str());
    gst_harness_set_src_caps_str(candidate, of_candidate.c_str());
  }

  void end(GstHarness* h) { gst_harness_push_event(h, gst_event_new_eos()); }

  /// Buffers passed through until EOS, then the statistics.
  const GstStructure* conclude() {
    GstBuffer* last = nullptr;
    while (gst_harness_buffers_in_queue(candidate) > 0)
      passed.emplace_back(gst_harness_pull(candidate));
    EXPECT_TRUE(gst_harness_pull_until_eos(candidate, &last));
    while (last != nullptr) {
      passed.emplace_back(last);
      EXPECT_TRUE(gst_harness_pull_until_eos(candidate, &last));
    }
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
  begin();
  // The candidate starts 10 ms later; earlier events of the reference do not count.
  gst_harness_push(reference, buffer_of(0,
                                        {Event::at(1, 1, 5'000, Polarity::on),
                                         Event::at(1, 1, 15'000, Polarity::on),
                                         Event::at(6, 1, 18'000, Polarity::off)},
                                        20 * ms));
  gst_harness_push(candidate, buffer_of(10 * ms,
                                        {Event::at(2, 2, 1'000, Polarity::on),
                                         Event::at(6, 1, 8'500, Polarity::on)},
                                        10 * ms));
  gst_harness_push(reference, buffer_of(20 * ms, {Event::at(5, 1, 1'000, Polarity::on)}, 20 * ms));
  gst_harness_push_event(candidate, gst_event_new_gap(20 * ms, 20 * ms));
  gst_harness_push(reference, buffer_of(40 * ms, {Event::at(5, 1, 1'000, Polarity::on)}, 20 * ms));
  end(candidate);
  end(reference);
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
  EXPECT_NEAR(number_in(of_reference, "within-10ms"), 2 / 3.0, 1e-9);
  EXPECT_NEAR(number_in(within(figures, "candidate-matches"), "within-5ms"), 1, 1e-9);
  const GValue* curve = gst_structure_get_value(within(figures, "rate-curve"), "reference");
  ASSERT_TRUE(curve);
  EXPECT_EQ(gst_value_array_get_size(curve), 30U);
  EXPECT_EQ(g_value_get_uint64(gst_value_array_get_value(curve, 5)), 1U);

  ASSERT_EQ(passed.size(), 1U);
  EXPECT_EQ(events_of(passed[0].get()).size(), 2U);
  EXPECT_EQ(GST_BUFFER_PTS(passed[0].get()), 10 * ms);
  int gaps = 0;
  while (GstEvent* event = gst_harness_try_pull_event(candidate)) {
    gaps += GST_EVENT_TYPE(event) == GST_EVENT_GAP ? 1 : 0;
    gst_event_unref(event);
  }
  EXPECT_EQ(gaps, 1);
  const auto json = text_in(path("f.json"));
  for (const char* field : {"map-correlation", "candidate-matches", "rate-curve", "std-dev"})
    EXPECT_NE(json.find(field), std::string::npos) << field;
  EXPECT_EQ(text_in(path("map.png")).substr(1, 3), "PNG");
}

TEST_F(CompareTest, PassesTheCandidateOnWhereTheReferenceHasEnded) {
  make();
  begin();
  gst_harness_push(reference, buffer_of(0, {Event::at(1, 1, 5, Polarity::on)}, 10 * ms));
  end(reference);
  for (const GstClockTime t : {0 * ms, 10 * ms, 20 * ms})
    gst_harness_push(candidate, buffer_of(t, {Event::at(1, 1, 5, Polarity::on)}, 10 * ms));
  end(candidate);
  const auto* figures = conclude();
  ASSERT_TRUE(figures);
  EXPECT_EQ(count_in(within(figures, "candidate")), 1U);
  EXPECT_EQ(time_in(figures, "end"), gint64{10 * ms});
  EXPECT_EQ(passed.size(), 3U);
}

TEST_F(CompareTest, ComparesEachSegment) {
  make();
  begin();
  for (const GstClockTime base : {0 * ms, 10 * ms}) {
    for (auto* h : {reference, candidate}) {
      play_on(h, base);
      gst_harness_push(h, buffer_of(0, {Event::at(1, 1, 5, Polarity::on)}, 10 * ms));
      end_segment(h);
    }
    ASSERT_TRUE(next_event(candidate, GST_EVENT_SEGMENT_DONE));
    message_ = compare->message(GST_MESSAGE_ELEMENT);
    const auto* figures = structure_of(message_);
    ASSERT_TRUE(figures);
    EXPECT_EQ(count_in(within(figures, "candidate")), 1U);
    EXPECT_EQ(number_in(within(figures, "reference-matches"), "within-1ms"), 1);
  }
  for (auto* h : {reference, candidate}) end(h);  // of nothing more
  ASSERT_TRUE(next_event(candidate, GST_EVENT_EOS));
  EXPECT_FALSE(compare->message(GST_MESSAGE_ELEMENT));
}

TEST_F(CompareTest, StartsOverWhereTimeGoesBack) {
  make();
  begin();
  for (const GstClockTime base : {0 * ms, 20 * ms}) {
    for (auto* h : {reference, candidate}) play_on(h, base);
    for (const GstClockTime t : {0 * ms, 10 * ms})
      for (auto* h : {reference, candidate})
        gst_harness_push(h, buffer_of(t, {Event::at(1, 1, 5, Polarity::on)}, 10 * ms));
  }
  for (auto* h : {reference, candidate}) end(h);
  expect_comparisons({{2, 20 * ms}, {2, 20 * ms}});
  EXPECT_EQ(passed.size(), 4U);
}

TEST_F(CompareTest, StartsOverOnceTimeGoesBackInBothStreams) {
  make();
  begin();
  const auto push = [](GstHarness* h, GstClockTime t) {
    gst_harness_push(h, buffer_of(t, {Event::at(1, 1, 5, Polarity::on)}, 10 * ms));
  };
  for (const GstClockTime t : {0 * ms, 10 * ms})
    for (auto* h : {reference, candidate}) push(h, t);
  push(reference, 20 * ms);
  push(candidate, 0);
  push(reference, 30 * ms);
  push(reference, 0);
  for (auto* h : {reference, candidate}) end(h);
  expect_comparisons({{2, 20 * ms}, {1, 10 * ms}});
  EXPECT_EQ(passed.size(), 3U);
}

TEST_F(CompareTest, ComparesOnlyWhatIsInTheSegments) {
  make();
  begin();
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  segment.start = segment.time = 50 * ms;
  segment.stop = 80 * ms;
  std::vector<Event> events;
  for (std::uint32_t t = 0; t < 100'000; t += 1000)
    events.push_back(Event::at(1, 0, t, Polarity::on));
  for (auto* h : {reference, candidate}) {
    gst_harness_push_event(h, gst_event_new_segment(&segment));
    gst_harness_push(h, buffer_of(0, events, 100 * ms));
    end(h);
  }
  const auto* figures = conclude();
  ASSERT_TRUE(figures);
  EXPECT_EQ(time_in(figures, "start"), gint64{50 * ms});
  EXPECT_EQ(time_in(figures, "end"), gint64{80 * ms});
  for (const char* role : {"reference", "candidate"})
    EXPECT_EQ(count_in(within(figures, role)), 30U) << role;
  ASSERT_EQ(passed.size(), 1U);
  EXPECT_EQ(events_of(passed[0].get()).size(), 100U);
}

TEST_F(CompareTest, PassesTheCustomEventsOfTheCandidateOn) {
  make();
  const OutputOrder output(candidate);
  begin();
  for (const GstClockTime t : {0 * ms, 10 * ms}) {
    push_custom(reference, "of-reference");
    push_custom(candidate, "of-candidate");
    for (auto* h : {reference, candidate})
      gst_harness_push(h, buffer_of(t, {Event::at(1, 1, 5, Polarity::on)}, 10 * ms));
  }
  end(reference);
  end(candidate);
  EXPECT_TRUE(conclude());
  EXPECT_EQ(output.names(),
            (std::vector<std::string>{"stream-start", "caps", "segment", "of-candidate", "buffer",
                                      "of-candidate", "buffer", "eos"}));
}

/// A buffer with an event of each of these causes.
GstBuffer* caused_by(const std::vector<guint8>& causes) {
  std::vector<Event> events;
  std::vector<GstEventCameraLabel> labels;
  for (const auto cause : causes) {
    events.push_back(Event::at(static_cast<int>(events.size()), 1, 5, Polarity::on));
    labels.push_back({.object_class = 0, .cause = cause, .reserved = 0});
  }
  GstBuffer* const buffer = buffer_of(0, events, 10 * ms);
  gst_buffer_add_event_camera_label_meta(buffer, labels.data(), labels.size());
  return buffer;
}

TEST_F(CompareTest, ClassifiesTheEventsThatAreLeft) {
  make();
  begin();
  constexpr guint8 light = GST_EVENT_CAMERA_CAUSE_LIGHT;
  constexpr guint8 leak = GST_EVENT_CAMERA_CAUSE_LEAK;
  gst_harness_push(reference, caused_by({light, light, light, leak, leak, leak, leak}));
  gst_harness_push(candidate, caused_by({light, light, leak}));
  end(reference);
  end(candidate);
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
  EXPECT_DOUBLE_EQ(number_in(classification, "precision"), 2 / 3.0);
}

TEST_F(CompareTest, ClassifiesWhereNoEventIsLeft) {
  make();
  begin();
  gst_harness_push(reference, caused_by({GST_EVENT_CAMERA_CAUSE_LEAK}));
  gst_harness_push_event(candidate, gst_event_new_gap(0, 10 * ms));
  end(reference);
  end(candidate);
  const auto* figures = conclude();
  ASSERT_TRUE(figures);
  const auto* classification = within(figures, "classification");
  ASSERT_TRUE(classification);
  EXPECT_STREQ(gst_structure_nth_field_name(figures, 2), "classification");  // after start and end
  EXPECT_EQ(count_in(classification, "true-negatives"), 1U);
}

TEST_F(CompareTest, WritesWhatHasComeWhereItIsStopped) {
  make("location=" + in_quotes(path("f.json")) + " map=" + in_quotes(path("map.png")));
  begin();
  for (const GstClockTime t : {0 * ms, 10 * ms})
    for (auto* h : {reference, candidate})
      gst_harness_push(h, buffer_of(t, {Event::at(1, 1, 5, Polarity::on)}, 10 * ms));
  EXPECT_TRUE(Buffer(gst_harness_pull(candidate)));
  gst_element_set_state(compare->element.get(), GST_STATE_READY);
  EXPECT_FALSE(text_in(path("f.json")).empty());
  EXPECT_EQ(text_in(path("map.png")).substr(1, 3), "PNG");
  const auto message = compare->message(GST_MESSAGE_ELEMENT);
  ASSERT_TRUE(message);
  EXPECT_EQ(time_in(structure_of(message), "start"), 0);
}

TEST_F(CompareTest, WritesNothingAtAStopWhereNothingHasComeSinceItDid) {
  make("location=" + in_quotes(path("f.json")));
  begin();
  for (auto* h : {reference, candidate})
    gst_harness_push(h, buffer_of(0, {Event::at(1, 1, 5, Polarity::on)}, 10 * ms));
  end(reference);
  end(candidate);
  EXPECT_TRUE(conclude());
  EXPECT_TRUE(std::filesystem::remove(path("f.json")));
  gst_element_set_state(compare->element.get(), GST_STATE_READY);
  EXPECT_FALSE(std::filesystem::exists(path("f.json")));
}

/// At once, because a source whose size changes may wait for one of the streams itself.
TEST_F(CompareTest, ReportsAndRefusesAChangeOfSize) {
  make();
  begin();
  for (auto* h : {reference, candidate})
    gst_harness_push(h, buffer_of(0, {Event::at(1, 1, 5, Polarity::on)}, 10 * ms));
  gst_harness_set_src_caps_str(reference,
                               "application/x-event-camera, format=XYTP, width=9, height=4");
  const Owned<GstMessage> error(
      gst_bus_timed_pop_filtered(compare->bus.get(), 5 * GST_SECOND, GST_MESSAGE_ERROR));
  ASSERT_TRUE(error);
  EXPECT_NE(text_of(error.get()).find("9 x 4 pixels, the candidate 8 x 4"), std::string::npos);
}

TEST_F(CompareTest, BeginsAnewAfterAFlush) {
  make();
  begin();
  for (auto* h : {reference, candidate})
    gst_harness_push(h, buffer_of(0, {Event::at(1, 1, 5, Polarity::on)}, 10 * ms));
  flush({reference, candidate});
  for (auto* h : {reference, candidate}) {
    push_segment(h);
    gst_harness_push(h, buffer_of(0, {Event::at(2, 1, 5, Polarity::on)}, 10 * ms));
  }
  end(reference);
  end(candidate);
  const auto* figures = conclude();
  ASSERT_TRUE(figures);
  EXPECT_EQ(count_in(within(figures, "candidate")), 1U);
  EXPECT_EQ(count_in(within(figures, "reference")), 1U);
}

}  // namespace
