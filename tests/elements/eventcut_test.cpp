// SPDX-License-Identifier: LGPL-2.1-or-later
// eventcut: which events are in which window, what ends a window, and windows in later elements.
#include <string>
#include <vector>

#include "tests/elements/pipeline.hpp"

namespace {

using namespace harness;
using namespace eventcamera;

using Triggers = std::vector<Trigger>;
using Texts = std::vector<std::string>;

const std::string sensor = "application/x-event-camera, format=XYTP, width=8, height=4";

/// An eventcut, whose output is written as texts in its order: "PTS+duration: times of events",
/// all in microseconds; "PTS+duration" for a GAP, and "PTS" for one without duration.
class Cut {
 public:
  explicit Cut(const std::string& settings = "") : h("eventcut " + settings) {
    watch(h->sinkpad,
          {[this](GstBuffer* buffer) { take(buffer); }, [this](GstEvent* event) { take(event); }});
    h.caps(sensor + ", framerate=100/1");
  }

  void push_triggers(const Triggers& triggers) {
    gst_harness_push_event(h.get(), event_of(triggers));
  }

  /// Pushes the events at these times in a buffer of 10 ms, or a GAP if there are none.
  void push(Microseconds start, const std::vector<Microseconds>& times) {
    const auto pts = static_cast<GstClockTime>(start) * GST_USECOND;
    std::vector<Event> events;
    for (const auto t : times) events.push_back(on(1, 2, static_cast<guint32>(t - start)));
    if (events.empty())
      push_gap(h.get(), pts, 10 * GST_MSECOND);
    else
      EXPECT_EQ(h.push(buffer_of(pts, events, 10 * GST_MSECOND)), GST_FLOW_OK);
  }

  /// Output since the last call, without GAPs that have no duration.
  Texts windows() {
    auto texts = std::exchange(texts_, {});
    std::erase_if(texts, [](const auto& text) { return text.find('+') == text.npos; });
    return texts;
  }
  Texts all() { return std::exchange(texts_, {}); }

  Harness h;

 private:
  static std::string us(GstClockTime time) { return std::to_string(time / GST_USECOND); }
  void take(GstBuffer* buffer) {
    auto text = us(GST_BUFFER_PTS(buffer)) + "+" + us(GST_BUFFER_DURATION(buffer)) + ":";
    for (const auto& event : events_of(buffer)) text += " " + std::to_string(event.t);
    texts_.push_back(text + (GST_BUFFER_IS_DISCONT(buffer) ? " DISCONT" : ""));
  }
  void take(GstEvent* event) {
    if (GST_EVENT_TYPE(event) != GST_EVENT_GAP) return;
    const auto [start, duration] = gap_of(event);
    texts_.push_back(us(start) + (GST_CLOCK_TIME_IS_VALID(duration) ? "+" + us(duration) : ""));
  }

  Texts texts_;
};

struct Case {
  const char* name;
  const char* settings;
  Triggers triggers;
  Texts windows;
};

const std::vector<Case> cases = {
    {"RisingEdges",
     "",
     {{1'000, 0, true}, {5'000, 0, false}, {12'000, 0, true}, {26'000, 0, true}},
     {"1000+11000: 8000 9000 DISCONT", "12000+14000: 3000 13000"}},
    {"FallingEdges",
     "edge=falling",
     {{1'000, 0, true}, {5'000, 0, false}, {12'000, 0, true}, {26'000, 0, false}},
     {"5000+21000: 4000 5000 10000 20000 DISCONT"}},
    {"BothEdges",
     "edge=both",
     {{0, 0, true}, {12'000, 0, false}, {26'000, 0, true}},
     {"0+12000: 500 9000 10000 DISCONT", "12000+14000: 3000 13000"}},
    {"AnInput",
     "input=2",
     {{0, 2, true}, {1'000, 1, true}, {12'000, 2, true}, {13'000, 0, true}},
     {"0+12000: 500 9000 10000 DISCONT"}},
    {"AllInputs",
     "",
     {{0, 2, true}, {12'000, 1, true}, {12'000, 2, true}, {26'000, 0, true}},
     {"0+12000: 500 9000 10000 DISCONT", "12000+14000: 3000 13000"}},
    {"EventsAtTriggersBelongToTheNextWindow",
     "",
     {{500, 0, true}, {10'000, 0, true}, {15'000, 0, true}, {25'000, 0, true}},
     {"500+9500: 0 8500 DISCONT", "10000+5000: 0", "15000+10000: 0"}},
    {"NoEvents",
     "",
     {{16'000, 0, true}, {17'000, 0, true}, {24'999, 0, true}, {25'001, 0, true}},
     {"16000+1000", "17000+7999", "24999+2: 1 DISCONT"}},
    {"TriggersOutOfOrder",
     "",
     {{9'500, 0, true}, {8'000, 0, true}, {12'000, 0, true}},
     {"8000+1500: 1000 DISCONT", "9500+2500: 500"}},
    {"OneTrigger", "", {{1'000, 0, true}}, {}},
    {"NegativeTimes", "", {{-5, 0, true}, {1'000, 0, true}}, {}},
};

class EventCutCase : public testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(, EventCutCase, testing::ValuesIn(cases),
                         [](const auto& test) { return test.param.name; });

TEST_P(EventCutCase, HasTheseWindows) {
  const std::vector<std::vector<Microseconds>> buffers{
      {500, 9'000}, {10'000, 15'000}, {25'000, 29'999}, {}};
  Cut cut(GetParam().settings);
  for (std::size_t i = 0; i < buffers.size(); ++i) {
    const auto start = static_cast<Microseconds>(i) * 10'000;
    auto triggers = GetParam().triggers;
    std::erase_if(triggers, [start](const Trigger& trigger) {
      return std::max(trigger.t, Microseconds{0}) / 10'000 * 10'000 != start;
    });
    cut.push_triggers(triggers);
    cut.push(start, buffers[i]);
  }
  push_eos(cut.h.get());
  const auto windows = cut.windows();
  EXPECT_EQ(windows, GetParam().windows);
  EXPECT_EQ(stat_of(cut.h.element(), "windows"), windows.size());
  EXPECT_EQ(stat_of(cut.h.element(), "events"), 6U);
  std::size_t kept = 0;
  for (const auto& window : windows)
    kept += static_cast<std::size_t>(std::ranges::count(window, ' ')) -
            (window.ends_with("DISCONT") ? 1U : 0U);
  EXPECT_EQ(stat_of(cut.h.element(), "dropped-events"), 6U - kept);
  EXPECT_EQ(cut.h.warning().starts_with("There are no windows"), windows.empty());
}

TEST(EventCut, StartsOverWhereTheStreamDoes) {
  struct Break {
    std::function<void(Cut&)> happen;
    bool starts_over;
  };
  const std::vector<Break> breaks{
      {[](Cut&) {}, false},
      {[](Cut& cut) { push_segment(cut.h.get()); }, false},
      {[](Cut& cut) {
         flush({cut.h.get()});
         push_segment(cut.h.get());
       },
       true},
      {[](Cut& cut) { push_segment(cut.h.get(), {.base = GST_SECOND}); }, true},
      {[](Cut& cut) { end_segment(cut.h.get()); }, true},
      {[](Cut& cut) {
         gst_harness_set_src_caps_str(cut.h.get(),
                                      "application/x-event-camera, format=XYTP, width=9, height=4");
       },
       true}};
  for (const auto& stream : breaks) {
    Cut cut;
    cut.push_triggers({{1'000, 0, true}, {3'000, 0, true}});
    cut.push(0, {2'000, 4'000});
    stream.happen(cut);
    cut.push_triggers({{12'000, 0, true}, {15'000, 0, true}});
    cut.push(10'000, {11'000, 13'000});
    EXPECT_EQ(cut.windows(),
              stream.starts_over
                  ? (Texts{"1000+2000: 1000 DISCONT", "12000+3000: 1000 DISCONT"})
                  : (Texts{"1000+2000: 1000 DISCONT", "3000+9000: 1000 8000", "12000+3000: 1000"}));
    EXPECT_EQ(stat_of(cut.h.element(), "dropped-events"), stream.starts_over ? 2U : 0U);
  }
}

TEST(EventCut, ForgetsTriggersThatWaitAtAFlush) {
  Cut cut;
  cut.push_triggers({{1'000, 0, true}, {11'500, 0, true}});
  cut.push(0, {2'000});
  flush({cut.h.get()});
  push_segment(cut.h.get());
  cut.push_triggers({{12'000, 0, true}, {15'000, 0, true}});
  cut.push(10'000, {11'700, 13'000});
  EXPECT_EQ(cut.windows(), Texts{"12000+3000: 1000 DISCONT"});
}

TEST(EventCut, StartsOverWhereTimeGoesBack) {
  Cut cut;
  cut.push_triggers({{51'000, 0, true}});
  cut.push(50'000, {52'000});
  cut.push_triggers({{2'000, 0, true}, {8'000, 0, true}});
  cut.push(0, {1'000, 3'000});
  EXPECT_EQ(cut.windows(), Texts{"2000+6000: 1000 DISCONT"});
}

/// Rounded timestamps overlap.
TEST(EventCut, KeepsAnEventThatIsLateByAMicrosecond) {
  Cut cut;
  cut.push_triggers({{0, 0, true}, {10'000, 0, true}});
  cut.push(0, {1'000});
  cut.push_triggers({{19'000, 0, true}});
  cut.push(9'999, {9'999, 12'000});
  EXPECT_EQ(cut.windows(), (Texts{"0+10000: 1000 DISCONT", "10000+9000: 0 2000"}));
}

/// Sinks start with it, and it is no window.
TEST(EventCut, SendsGapsWithoutDurationBeforeTheFirstTrigger) {
  Cut cut;
  cut.push(0, {1'000});
  cut.push(10'000, {});
  cut.push_triggers({{25'000, 0, true}, {26'000, 0, true}});
  cut.push(20'000, {25'500});
  EXPECT_EQ(cut.all(), (Texts{"0", "10000", "25000+1000: 500 DISCONT"}));
}

TEST(EventCut, DropsWindowsThatAreTooLongForTheirTimes) {
  Cut cut;
  constexpr Microseconds max = G_MAXUINT32;
  cut.push_triggers({{1, 0, true}});
  cut.push(0, {5});
  cut.push_triggers({{max + 2, 0, true}, {2 * max + 2, 0, true}});
  cut.push(max, {max + 3});
  cut.push(2 * max, {2 * max + 1});
  const auto length = std::to_string(max);
  EXPECT_EQ(cut.windows(), Texts{std::to_string(max + 2) + "+" + length + ": 1 " +
                                 std::to_string(max - 1) + " DISCONT"});
  EXPECT_EQ(stat_of(cut.h.element(), "dropped-events"), 1U);
}

TEST(EventCut, BoundsTheEventsOfAWindow) {
  Cut cut;
  const std::vector<Event> many(std::size_t{1} << 22);
  cut.push_triggers({{0, 0, true}});
  for (GstClockTime i = 0; i < 5; ++i) cut.h.push(buffer_of(i * GST_MSECOND, many, GST_MSECOND));
  EXPECT_EQ(stat_of(cut.h.element(), "dropped-events"), many.size());
  EXPECT_TRUE(contains(cut.h.warning(), "more than 16777216 in a window"));
}

TEST(EventCut, KeepsLabelsAndPassesTriggersOn) {
  Cut cut;
  const OutputOrder order(cut.h.get());
  cut.push_triggers({{1, 0, true}, {5, 0, true}});
  GstBuffer* const buffer = buffer_of(0, {{0, 1, 1}, {2, 1, 1}, {4, 1, 1}}, GST_MSECOND);
  const GstEventCameraLabel labels[] = {{7, 1, 0}, {8, 2, 0}, {9, 3, 0}};
  gst_buffer_add_event_camera_label_meta(buffer, labels, 3);
  cut.h.push(buffer);
  const auto window = cut.h.pull();
  ASSERT_TRUE(window);
  const auto* const meta = gst_buffer_get_event_camera_label_meta(window.get());
  ASSERT_NE(meta, nullptr);
  ASSERT_EQ(meta->n_labels, 2U);
  EXPECT_EQ(meta->labels[0].object_class, 8U);
  EXPECT_EQ(meta->labels[1].cause, 3U);
  const auto& names = order.names();
  const auto triggers = std::ranges::find(names, "GstEventCameraTriggers");
  EXPECT_LT(triggers, std::ranges::find(names, "buffer"));
  EXPECT_TRUE(contains(cut.h.out_caps(), "framerate=(fraction)0/1"));
}

TEST(EventCut, HasTheLatencyOfTheLongestWindow) {
  Cut cut;
  EXPECT_EQ(gst_harness_query_latency(cut.h.get()), 0U);
  const std::vector<std::pair<Microseconds, GstClockTime>> steps{
      {0, 0}, {20'000, 20}, {30'000, 20}, {3'000'000, 1'000}};
  for (const auto& [t, latency] : steps) {
    cut.push_triggers({{t, 0, true}});
    cut.push(t, {t});
    EXPECT_EQ(gst_harness_query_latency(cut.h.get()), latency * GST_MSECOND);
  }
}

/// A synchronised camera starts after half a second, and takes a frame every 20 ms; there are no
/// events in two of them.
TEST(EventCutPipeline, HasATensorOrPictureOfEachWindow) {
  for (const auto& [use, caps] : {std::pair{"eventtensor representation=event-frame", "ANY"},
                                  {"eventrender", "video/x-raw, framerate=0/1"},
                                  {"eventreconstruct", "video/x-raw, framerate=0/1"}}) {
    Harness h(std::string("eventcut ! ") + use);
    h.caps(sensor, caps);
    for (Microseconds t = 0; t < 1'000'000; t += 10'000) {
      const Triggers triggers{{t + 5'000, 0, t % 20'000 == 0}};
      if (t >= 500'000) gst_harness_push_event(h.get(), event_of(triggers));
      const auto pts = static_cast<GstClockTime>(t) * GST_USECOND;
      if (t < 700'000 || t >= 750'000)
        h.push(buffer_of(pts, {{1, 1, 1}, {9'000, 2, 2}}, 10 * GST_MSECOND));
      else
        push_gap(h.get(), pts, 10 * GST_MSECOND);
    }
    push_eos(h.get());
    GstBuffer* next = nullptr;
    GstClockTime expected = 505 * GST_MSECOND;
    for (; gst_harness_pull_until_eos(h.get(), &next) && next != nullptr;
         expected += 20 * GST_MSECOND) {
      EXPECT_EQ(GST_BUFFER_PTS(next), expected) << use;
      EXPECT_EQ(GST_BUFFER_DURATION(next), 20 * GST_MSECOND);
      gst_buffer_unref(next);
    }
    EXPECT_EQ(expected, (505 + 24 * 20) * GST_MSECOND) << use;
  }
}

}  // namespace
