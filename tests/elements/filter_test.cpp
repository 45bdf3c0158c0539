// SPDX-License-Identifier: LGPL-2.1-or-later
// Filters of events: buffers, timestamps, flags, and what they forget.
#include "tests/elements/pipeline.hpp"

namespace {

using namespace harness;
using eventcamera::Event;

constexpr GstClockTime ms = GST_MSECOND;
const std::string small_sensor = "application/x-event-camera, format=XYTP, width=8, height=4";

Event on(std::uint32_t t, int x = 1) {
  return ::on(x, 1, t);
}

std::vector<std::uint32_t> times_of(const Buffer& buffer) {
  std::vector<std::uint32_t> times;
  if (buffer)
    for (const auto& event : events_of(buffer.get())) times.push_back(event.t);
  return times;
}
using Times = std::vector<std::uint32_t>;

/// eventrefractory with a period of 10 ms, at which a pixel fires that it remembers.
class FilterTest : public testing::Test {
 protected:
  FilterTest() { h.caps(small_sensor); }

  /// Whether an event at `pts` passes.
  bool passes(GstClockTime pts) {
    EXPECT_EQ(h.push(buffer_of(pts, {on(0)}, 5 * ms)), GST_FLOW_OK);
    return h.pull() != nullptr;
  }

  Harness h{"eventrefractory refractory-period=10000000"};
};

TEST_F(FilterTest, KeepsTimestampsFlagsAndEvents) {
  GstBuffer* buffer = buffer_of(33 * ms, {on(0), on(5), on(10'004)}, 20 * ms);
  GST_BUFFER_OFFSET(buffer) = 7;
  h.push(buffer);
  const auto out = h.pull();
  EXPECT_EQ(times_of(out), (Times{0, 10'004}));
  EXPECT_EQ(GST_BUFFER_PTS(out.get()), 33 * ms);
  EXPECT_EQ(GST_BUFFER_DURATION(out.get()), 20 * ms);
  EXPECT_EQ(stat_of(h.element(), "events"), 3U);
  EXPECT_EQ(stat_of(h.element(), "dropped-events"), 1U);
  EXPECT_EQ(stat_of(h.element(), "rejected-events"), 0U);
}

TEST_F(FilterTest, DoesNotWriteToBuffersOfOthers) {
  const Buffer buffer(buffer_of(0, {on(0), on(5), on(6, 2)}, 20 * ms));
  const auto before = bytes_of(buffer.get());
  h.push(gst_buffer_ref(buffer.get()));
  EXPECT_EQ(times_of(h.pull()), (Times{0, 6}));
  EXPECT_EQ(bytes_of(buffer.get()), before);
}

TEST_F(FilterTest, KeepsLabelsWithTheirEvents) {
  const std::vector events = {on(0), on(5), on(6, 2)};
  const GstEventCameraLabel labels[] = {{10, 1, 0}, {11, 2, 0}, {12, 3, 0}};
  for (const bool is_shared : {false, true}) {
    GstBuffer* buffer = buffer_of(is_shared ? 20 * ms : 0, events, 20 * ms);
    gst_buffer_add_event_camera_label_meta(buffer, labels, 3);
    const Buffer other(is_shared ? gst_buffer_ref(buffer) : nullptr);
    h.push(buffer);
    const auto out = h.pull();
    const GstEventCameraLabelMeta* kept = gst_buffer_get_event_camera_label_meta(out.get());
    ASSERT_TRUE(kept);
    ASSERT_EQ(kept->n_labels, 2U);
    EXPECT_EQ(kept->labels[0].object_class, 10);
    EXPECT_EQ(kept->labels[1].object_class, 12);
    if (!other) continue;
    EXPECT_EQ(gst_buffer_get_event_camera_label_meta(other.get())->n_labels, 3U);
  }
}

TEST_F(FilterTest, RemovesLabelsThatAreNotThoseOfTheEvents) {
  const GstEventCameraLabel labels[2] = {};
  GstBuffer* buffer = buffer_of(0, {on(0), on(5), on(6, 2)}, 20 * ms);
  gst_buffer_add_event_camera_label_meta(buffer, labels, 2);
  h.push(buffer);
  const auto out = h.pull();
  EXPECT_EQ(times_of(out), (Times{0, 6}));
  EXPECT_FALSE(gst_buffer_get_event_camera_label_meta(out.get()));
}

TEST_F(FilterTest, TakesMemoryInPiecesAtAnyAddress) {
  const std::vector events = {on(0), on(5), on(6, 2)};
  GstBuffer* buffer = buffer_of(0, events, 20 * ms);
  const std::string bytes = bytes_of(buffer);
  gst_buffer_remove_all_memory(buffer);
  for (const auto& [from, size] : {std::pair<gsize, gsize>{0, 3}, {3, 21}}) {
    auto* memory = gst_allocator_alloc(nullptr, size + 1, nullptr);
    GstMapInfo map;
    gst_memory_map(memory, &map, GST_MAP_WRITE);
    std::copy_n(bytes.data() + from, size, map.data + 1);
    gst_memory_unmap(memory, &map);
    gst_memory_resize(memory, 1, size);
    gst_buffer_append_memory(buffer, memory);
  }
  h.push(buffer);
  EXPECT_EQ(times_of(h.pull()), (Times{0, 6}));
}

TEST_F(FilterTest, MakesAGapOfABufferWithoutEvents) {
  h.push(buffer_of(0, {on(0)}, 5 * ms));
  ASSERT_TRUE(h.pull());
  h.push(buffer_of(5 * ms, {on(0)}, 4 * ms));
  EXPECT_FALSE(h.pull());
  auto gap = h.pull_event(GST_EVENT_GAP);
  ASSERT_TRUE(gap);
  EXPECT_EQ(gap_of(gap.get()), (Gap{5 * ms, 4 * ms}));
  h.push(buffer_of(9 * ms, {}, 1 * ms));
  gap = h.pull_event(GST_EVENT_GAP);
  ASSERT_TRUE(gap);
  EXPECT_EQ(gap_of(gap.get()), (Gap{9 * ms, 1 * ms}));
  // Nothing was lost: the next buffer is no discontinuity, unless that of the gap was.
  h.push(buffer_of(10 * ms, {on(0)}, 5 * ms));
  EXPECT_FALSE(GST_BUFFER_IS_DISCONT(h.pull().get()));
  GstBuffer* discont = buffer_of(15 * ms, {on(0)}, 5 * ms);
  GST_BUFFER_FLAG_SET(discont, GST_BUFFER_FLAG_DISCONT);
  h.push(discont);
  EXPECT_FALSE(h.pull());
  h.push(buffer_of(20 * ms, {on(0)}, 5 * ms));
  EXPECT_TRUE(GST_BUFFER_IS_DISCONT(h.pull().get()));
}

TEST_F(FilterTest, RemembersThroughGapsSegmentsAndDiscont) {
  EXPECT_TRUE(passes(0));
  push_gap(h.get(), 5 * ms, 1 * ms);
  EXPECT_FALSE(passes(6 * ms));
  push_segment(h.get());
  EXPECT_FALSE(passes(7 * ms));
  GstBuffer* discont = buffer_of(8 * ms, {on(0)}, 1 * ms);
  GST_BUFFER_FLAG_SET(discont, GST_BUFFER_FLAG_DISCONT);
  h.push(discont);
  EXPECT_FALSE(h.pull());
  h.caps(small_sensor + ", framerate=100/1");
  EXPECT_FALSE(passes(9 * ms));
  EXPECT_TRUE(passes(10 * ms));
}

TEST_F(FilterTest, ForgetsWhereTimeGoesBack) {
  EXPECT_TRUE(passes(100 * ms));
  EXPECT_TRUE(passes(95 * ms));
  EXPECT_FALSE(passes(99 * ms));
  // Rounded timestamps may overlap by a microsecond.
  EXPECT_FALSE(passes(99 * ms - 1));
  EXPECT_FALSE(passes(99 * ms - 1001));
  EXPECT_TRUE(passes(99 * ms - 3001));
}

TEST_F(FilterTest, SeesOnlyLaterTimesWhereBuffersOverlap) {
  h.push(buffer_of(0, {on(1000)}, 1 * ms));
  EXPECT_TRUE(h.pull());
  for (const GstClockTime start : {1, 2, 3, 4}) {
    h.push(buffer_of(start * ms - GST_USECOND, {on(0), on(1001)}, 2 * ms));
    EXPECT_FALSE(h.pull());
  }
}

TEST_F(FilterTest, ForgetsWhereTheSensorChangesAndWhereItStops) {
  EXPECT_TRUE(passes(0));
  h.caps("application/x-event-camera, format=XYTP, width=9, height=4");
  EXPECT_TRUE(passes(5 * ms));
  gst_element_set_state(h.element(), GST_STATE_READY);
  gst_element_set_state(h.element(), GST_STATE_PLAYING);
  h.caps(small_sensor);
  push_segment(h.get());
  EXPECT_TRUE(passes(6 * ms));
  EXPECT_EQ(stat_of(h.element(), "events"), 1U);
}

TEST_F(FilterTest, RejectsEventsThatAreInvalid) {
  h.push(buffer_of(0, {on(0), on(1, 8), on(2, 2), on(1, 3), on(5001, 4)}, 5 * ms));
  EXPECT_EQ(times_of(h.pull()), (Times{0, 2}));
  EXPECT_EQ(stat_of(h.element(), "rejected-events"), 3U);
  EXPECT_TRUE(contains(h.warning(), "outside the sensor"));
  EXPECT_TRUE(contains(h.warning(), "earlier than the previous one"));
}

TEST_F(FilterTest, TakesNewSettingsWhilePlaying) {
  EXPECT_TRUE(passes(0));
  g_object_set(h.element(), "refractory-period", guint64{20 * ms}, nullptr);
  EXPECT_FALSE(passes(15 * ms));
  g_object_set(h.element(), "refractory-period", guint64{10 * ms}, nullptr);
  EXPECT_TRUE(passes(16 * ms));
}

/// How many events pass of those of half a second.
std::size_t count_passed(Harness& h, GstClockTime pts, const std::vector<Event>& events) {
  EXPECT_EQ(h.push(buffer_of(pts, events, 500 * ms)), GST_FLOW_OK);
  return times_of(h.pull()).size();
}

/// Three events of a pixel, 5 ms apart.
const std::vector burst = {on(0), on(5000), on(10'000)};

TEST(Trail, ForgetsBurstsWhereTimeGoesBack) {
  Harness h("eventtrail mode=stc-keep-trail");
  h.caps(small_sensor);
  EXPECT_EQ(count_passed(h, 500 * ms, burst), 2U);
  EXPECT_EQ(count_passed(h, 0, burst), 2U);
  g_object_set(h.element(), "mode", 0, nullptr);
  EXPECT_EQ(count_passed(h, 1000 * ms, burst), 1U);
}

TEST(RateControl, CountsWhatItDrops) {
  Harness h("eventratecontrol max-rate=1000 reference-period=100000000");
  h.caps(small_sensor);
  std::vector<Event> flood;
  for (std::uint32_t t = 0; t < 500'000; t += 100) flood.push_back(on(t));
  const auto first = count_passed(h, 0, flood);
  EXPECT_EQ(stat_of(h.element(), "dropped-events"), flood.size() - first);
  // The beginning of the flood, which was not foreseen, is paid back.
  EXPECT_NEAR(static_cast<double>(first), 500, 2);
  EXPECT_NEAR(static_cast<double>(first + count_passed(h, 500 * ms, flood)), 1000, 10);
  // A flush begins anew.
  flush({h.get()});
  push_segment(h.get());
  EXPECT_EQ(count_passed(h, 1000 * ms, flood), first);
}

class HotPixelTest : public testing::Test {
 protected:
  std::string launch(const std::string& settings = "") const {
    return "eventhotpixel location=" + in_quotes(file) + settings;
  }
  void write(const std::string& text) const { std::ofstream(file) << text; }
  void learn(Harness& h) const {
    EXPECT_EQ(count_passed(h, 0, hot), 100U);
    EXPECT_EQ(count_passed(h, 500 * ms, hot), 100U);
    EXPECT_EQ(count_passed(h, 1000 * ms, hot), 0U);
  }
  std::string text() const { return text_in(file); }

  const TemporaryFolder folder;
  const std::string file = folder / "hot pixels.txt";
  /// A pixel that fires every 5 ms.
  const std::vector<Event> hot = [] {
    std::vector<Event> events;
    for (std::uint32_t t = 0; t < 500'000; t += 5000) events.push_back(on(t));
    return events;
  }();
};

TEST_F(HotPixelTest, LearnsWritesAndKeepsThemThroughEverything) {
  {
    Harness h(launch());
    h.caps(small_sensor);
    learn(h);
    flush({h.get()});
    push_segment(h.get());
    EXPECT_EQ(count_passed(h, 0, hot), 0U);
    gst_element_set_state(h.element(), GST_STATE_READY);
  }
  EXPECT_EQ(text(), "# Hot pixels: column and row\n1 1\n");
  Harness h(launch(" learn=false"));
  h.caps(small_sensor);
  EXPECT_EQ(count_passed(h, 0, hot), 0U);
  EXPECT_EQ(count_passed(h, 1500 * ms, {on(0, 2)}), 1U);
}

TEST_F(HotPixelTest, ReportsFilesThatItCannotReadAndLeavesThemAsTheyAre) {
  for (const std::string learn : {"true", "false"}) {
    write("1 1\nfive 5\n");
    Harness h(launch(" learn=" + learn));
    h.caps(small_sensor);
    EXPECT_NE(h.push(buffer_of(0, {on(0)}, ms)), GST_FLOW_OK);
    gst_element_set_state(h.element(), GST_STATE_READY);
    EXPECT_TRUE(contains(h.error(), file));
    EXPECT_EQ(text(), "1 1\nfive 5\n");
  }
  std::filesystem::remove(file);
  Harness h(launch(" learn=false"));
  h.caps(small_sensor);
  EXPECT_NE(h.push(buffer_of(0, {on(0)}, ms)), GST_FLOW_OK);
  EXPECT_TRUE(contains(h.error(), file));
}

TEST_F(HotPixelTest, LeavesFilesAsTheyAreUnlessItFindsOthers) {
  write("# mine\n1 1\n");
  Harness h(launch());
  h.caps(small_sensor);
  EXPECT_EQ(count_passed(h, 0, hot), 0U);
  gst_element_set_state(h.element(), GST_STATE_READY);
  EXPECT_EQ(text(), "# mine\n1 1\n");
}

TEST_F(HotPixelTest, WritesWhatItLearnedBeforeTheSensorChanges) {
  Harness h(launch());
  h.caps(small_sensor);
  learn(h);
  h.caps("application/x-event-camera, format=XYTP, width=1, height=1");
  EXPECT_EQ(text(), "# Hot pixels: column and row\n1 1\n");
  h.caps(small_sensor);
  EXPECT_EQ(count_passed(h, 1500 * ms, hot), 0U);
}

TEST_F(HotPixelTest, KeepsPixelsOutsideTheSensorInTheFile) {
  write("9 1\n0 0\n");
  Harness h(launch());
  h.caps(small_sensor);
  for (const GstClockTime pts : {0, 500, 1000}) count_passed(h, pts * ms, hot);
  gst_element_set_state(h.element(), GST_STATE_READY);
  EXPECT_EQ(text(), "# Hot pixels: column and row\n1 1\n9 1\n");
}

TEST_F(HotPixelTest, ReportsFilesThatItCannotWrite) {
  Harness h("eventhotpixel location=/nowhere/at/all.txt");
  h.caps(small_sensor);
  EXPECT_EQ(count_passed(h, 0, hot), 100U);
  gst_element_set_state(h.element(), GST_STATE_READY);
  EXPECT_TRUE(contains(h.error(), "/nowhere/at/all.txt"));
}

}  // namespace
