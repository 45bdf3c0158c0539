// SPDX-License-Identifier: LGPL-2.1-or-later
// Contracts of every element that takes events or frames: segments, flushes, DISCONT, GAP, custom
// events, EOS, errors and states.
#include <gst/base/gstbasesink.h>

#include <cstring>
#include <functional>
#include <mutex>
#include <thread>

#include "tests/elements/element_lines.hpp"
#include "tests/elements/event_buffer.hpp"

namespace {

using namespace harness;
using namespace element_lines;

/// What leaves a source pad, in order.
class Output {
 public:
  struct Item {
    std::string name;            ///< of an event; or "buffer"
    GstClockTime base;           ///< of the segment that it belongs to; none before the first
    GstClockTime discontinuity;  ///< PTS of a buffer that is flagged DISCONT; else none
    std::string bytes;           ///< of a buffer
  };

  explicit Output(GstPad* pad) {
    watch(pad,
          {[this](GstBuffer* buffer) { add(buffer); }, [this](GstEvent* event) { add(event); }});
  }

  /// Items of this name.
  std::vector<Item> named(const std::string& name) const {
    auto items = all();
    std::erase_if(items, [&](const Item& item) { return item.name != name; });
    return items;
  }
  std::vector<Item> all() const {
    const std::lock_guard lock(mutex_);
    return items_;
  }
  std::vector<std::string> buffers_after_flushes() const {
    std::vector<std::string> buffers;
    for (const auto& item : all()) {
      if (item.name == "buffer") buffers.push_back(item.bytes);
      if (item.name == "flush-stop") buffers.clear();
    }
    return buffers;
  }

 private:
  void add(GstEvent* event) {
    if (GST_EVENT_TYPE(event) == GST_EVENT_SEGMENT) {
      const GstSegment* segment = nullptr;
      gst_event_parse_segment(event, &segment);
      base_ = segment->base;
    }
    if (GST_EVENT_TYPE(event) == GST_EVENT_FLUSH_STOP) base_ = GST_CLOCK_TIME_NONE;
    add(event_name(event));
  }
  void add(GstBuffer* buffer) {
    add("buffer", GST_BUFFER_IS_DISCONT(buffer) ? GST_BUFFER_PTS(buffer) : GST_CLOCK_TIME_NONE,
        bytes_of(buffer));
  }
  void add(const std::string& name, GstClockTime discontinuity = GST_CLOCK_TIME_NONE,
           const std::string& bytes = {}) {
    const std::lock_guard lock(mutex_);
    items_.push_back({name, base_, discontinuity, bytes});
  }

  mutable std::mutex mutex_;
  GstClockTime base_ = GST_CLOCK_TIME_NONE;
  std::vector<Item> items_;
};

/// Elements that send a segment only with their first output: it has the times of that, and their
/// inputs are no recordings; GStreamer's base class of RTP payloaders does the same.
bool has_own_segment(const std::string& name) {
  return name == "evtparse" || name == "eventdatagramdepay" || name == "rtpeventpay";
}

std::vector<std::string> seekable_consumers() {
  auto names = consumers();
  std::erase_if(names, has_own_segment);
  return names;
}

/// A playing element. Its inputs receive what has been pushed when play() is called, each in its
/// own thread: an aggregator may block one until another has data.
class Consumer {
 public:
  explicit Consumer(const std::string& name) : kind_(name) {
    element_.reset(gst_bin_get_by_name(GST_BIN(pipeline_.get()), "it"));
    for (GList* item = element_->srcpads; item != nullptr; item = item->next)
      outputs_.push_back(std::make_unique<Output>(GST_PAD(item->data)));
    for (auto& pad : kind_.pads(GST_PAD_SINK)) {
      const Owned<GstPad> sink(
          pad.presence == GST_PAD_REQUEST
              ? gst_element_request_pad_simple(element_.get(), pad.name.c_str())
              : gst_element_get_static_pad(element_.get(), pad.name.c_str()));
      inputs_.push_back({Owned<GstPad>(gst_pad_new(nullptr, GST_PAD_SRC)), pad.takes_frames()});
      EXPECT_EQ(gst_pad_link(inputs_.back().pad.get(), sink.get()), GST_PAD_LINK_OK) << pad.name;
    }
    // A sink that a flush sends back to PAUSED may post EOS before its bin plays again, and the bin
    // then forgets it.
    for (GList* child = GST_BIN_CHILDREN(pipeline_.get()); child != nullptr; child = child->next)
      if (GST_IS_BASE_SINK(child->data)) g_object_set(child->data, "async", FALSE, nullptr);
    gst_element_set_state(pipeline_.get(), GST_STATE_PLAYING);
    for (const auto& input : inputs_) gst_pad_set_active(input.pad.get(), TRUE);
    steps_.emplace_back([](const Input& input) {
      gst_pad_push_event(input.pad.get(), gst_event_new_stream_start("stream"));
      const Owned<GstCaps> caps(gst_caps_from_string(input.takes_frames ? frame_caps : event_caps));
      gst_pad_push_event(input.pad.get(), gst_event_new_caps(caps.get()));
    });
  }
  ~Consumer() { gst_element_set_state(pipeline_.get(), GST_STATE_NULL); }
  Consumer(const Consumer&) = delete;
  Consumer& operator=(const Consumer&) = delete;

  std::size_t inputs() const { return inputs_.size(); }
  bool takes_events() const {
    return std::ranges::any_of(inputs_, [](const Input& input) { return !input.takes_frames; });
  }
  const std::vector<std::unique_ptr<Output>>& outputs() const { return outputs_; }

  /// Pushes an event from make() into each input.
  template <class Make>
  void push(const Make& make) {
    steps_.emplace_back(
        [make](const Input& input) { gst_pad_push_event(input.pad.get(), make()); });
  }
  void push_segment(const SegmentFields& fields = {}) {
    push([fields] { return segment_event(fields); });
  }
  /// Pushes a buffer of 10 ms after the first 10 ms into each input: a frame, or these events.
  void push_events(const std::vector<GstEventCameraEvent>& events,
                   GstClockTime pts = 10 * GST_MSECOND, gsize extra_bytes = 0) {
    steps_.emplace_back([=](const Input& input) {
      if (!input.takes_frames && events.empty()) return;
      std::vector<guint8> bytes(events.size() * sizeof(GstEventCameraEvent) + extra_bytes);
      if (!events.empty()) std::memcpy(bytes.data(), events.data(), bytes.size() - extra_bytes);
      GstBuffer* const buffer =
          input.takes_frames ? frame(1) : gst_buffer_new_memdup(bytes.data(), bytes.size());
      if (!input.takes_frames) GST_BUFFER_PTS(buffer) = pts;
      GST_BUFFER_DURATION(buffer) = 10 * GST_MSECOND;
      gst_pad_push(input.pad.get(), buffer);
    });
  }
  void push_custom_event_and_tag() {
    push([] {
      return gst_event_new_custom(GST_EVENT_CUSTOM_DOWNSTREAM, gst_structure_new_empty("custom"));
    });
    push([] { return gst_event_new_tag(gst_tag_list_new(GST_TAG_TITLE, "title", nullptr)); });
  }
  /// Pushes an interval of 10 ms into each input: a frame, or a trigger and three events.
  void push_interval(guint index, bool discontinuous = false) {
    steps_.emplace_back([=](const Input& input) {
      const eventcamera::Trigger trigger{gint64{index} * 10'000, 0, true};
      if (!input.takes_frames) gst_pad_push_event(input.pad.get(), event_of({&trigger, 1}));
      GstBuffer* const buffer = input.takes_frames ? frame(index) : neighbours(index);
      GST_BUFFER_PTS(buffer) = index * 10 * GST_MSECOND;
      GST_BUFFER_DURATION(buffer) = 10 * GST_MSECOND;
      if (discontinuous) GST_BUFFER_FLAG_SET(buffer, GST_BUFFER_FLAG_DISCONT);
      gst_pad_push(input.pad.get(), buffer);
    });
  }
  void play() {
    {
      std::vector<std::jthread> threads;
      for (const auto& input : inputs_)
        threads.emplace_back([this, &input] {
          for (const auto& step : steps_) step(input);
        });
    }
    steps_.clear();
  }
  /// Ends all inputs, waits for the end of the output, and returns the warnings, or the error.
  std::vector<std::string> faults() {
    push(gst_event_new_eos);
    play();
    std::vector<std::string> texts;
    while (const auto message = wait_for(
               pipeline_.get(), GST_MESSAGE_EOS | GST_MESSAGE_ERROR | GST_MESSAGE_WARNING)) {
      has_ended_ = GST_MESSAGE_TYPE(message.get()) == GST_MESSAGE_EOS;
      if (has_ended_) break;
      texts.push_back(text_of(message.get()));
      if (GST_MESSAGE_TYPE(message.get()) == GST_MESSAGE_ERROR) break;
    }
    return texts;
  }
  void end() {
    const auto texts = faults();
    EXPECT_TRUE(has_ended_) << testing::PrintToString(texts);
    for (const auto& output : outputs_) EXPECT_EQ(output->named("eos").size(), 1U);
  }
  /// Expects the custom events and tags of the main input; where inputs are joined, the custom
  /// events of each.
  void expect_custom_events_and_tags() const {
    const bool joins = kind_.name() == "eventmerge" || kind_.name() == "aedatmux";
    for (const auto& output : outputs_) {
      EXPECT_EQ(output->named("custom").size(), joins ? inputs_.size() : 1U);
      EXPECT_TRUE(joins || output->named("buffer").empty() || !output->named("tag").empty());
    }
  }
  /// Expects every buffer and GAP to follow a SEGMENT, also after a flush.
  void expect_segments() const {
    for (const auto& output : outputs_)
      for (const auto& item : output->all())
        if (item.name == "buffer" || item.name == "gap") {
          EXPECT_TRUE(GST_CLOCK_TIME_IS_VALID(item.base)) << item.name;
        }
  }

 private:
  struct Input {
    Owned<GstPad> pad;
    bool takes_frames;
  };

  static GstBuffer* frame(guint index) {
    return filled(gsize{64} * 48, index % 2 == 1 ? 0xff : 0, index * 10 * GST_MSECOND,
                  10 * GST_MSECOND);
  }
  /// Events of neighbouring pixels, so that a denoiser keeps the last one.
  static GstBuffer* neighbours(guint index) {
    const auto x = static_cast<guint16>(4 + 4 * (index % 8));
    const auto right = static_cast<guint16>(x + 1);
    const GstEventCameraEvent events[] = {{0, x, 4}, {1, right, 4}, {2, x, 5}};
    return gst_buffer_new_memdup(events, sizeof events);
  }

  const Kind kind_;
  const Owned<GstElement> pipeline_ = launched(kind_.launch());
  Owned<GstElement> element_;
  std::vector<std::unique_ptr<Output>> outputs_;
  std::vector<Input> inputs_;
  std::vector<std::function<void(const Input&)>> steps_;
  bool has_ended_ = false;
};

class EveryConsumer : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(, EveryConsumer, testing::ValuesIn(seekable_consumers()),
                         element_lines::test_name);

/// Segments without output, as of seeks with GST_SEEK_FLAG_SEGMENT.
TEST_P(EveryConsumer, EndsEachSegmentOnceAfterItsStart) {
  Consumer it(GetParam());
  for (const GstClockTime base : {0 * GST_SECOND, 1 * GST_SECOND}) {
    it.push_segment({.base = base, .flags = GST_SEGMENT_FLAG_SEGMENT});
    it.push([] { return gst_event_new_segment_done(GST_FORMAT_TIME, 0); });
  }
  it.end();
  for (const auto& output : it.outputs()) {
    std::vector<GstClockTime> bases;
    for (const auto& done : output->named("segment-done")) bases.push_back(done.base);
    // A segment in bytes has the base 0.
    EXPECT_TRUE(bases == (std::vector<GstClockTime>{0, 1 * GST_SECOND}) ||
                bases == (std::vector<GstClockTime>{0, 0}))
        << testing::PrintToString(bases);
  }
}

TEST_P(EveryConsumer, EndsAfterGaps) {
  Consumer it(GetParam());
  it.push_segment();
  for (guint i = 0; i < 3; ++i)
    it.push([i] { return gst_event_new_gap(i * 10 * GST_MSECOND, 10 * GST_MSECOND); });
  it.end();
  it.expect_segments();
}

TEST_P(EveryConsumer, ForwardsCustomEventsAndTags) {
  for (const guint intervals : {0, 3}) {
    Consumer it(GetParam());
    it.push_segment();
    for (guint i = 0; i < intervals; ++i) it.push_interval(i);
    it.push_custom_event_and_tag();
    it.end();
    it.expect_custom_events_and_tags();
  }
}

/// The output after a flush is that of an element which receives nothing before, also if a segment
/// has ended.
TEST_P(EveryConsumer, StartsOverAfterAFlush) {
  for (const bool ends_segment : {false, true}) {
    Consumer it(GetParam());
    Consumer fresh(GetParam());
    it.push_segment();
    // An input holds one interval while another has none.
    const guint before = it.inputs() > 1 ? 1 : 3;
    for (guint i = 0; i < before; ++i) it.push_interval(i);
    if (ends_segment) it.push([] { return gst_event_new_segment_done(GST_FORMAT_TIME, 0); });
    it.play();
    // A sequence number in common tells aggregators that all inputs are flushed together.
    const auto seqnum = gst_util_seqnum_next();
    for (const bool starts : {true, false}) {
      it.push([=] {
        GstEvent* const event =
            starts ? gst_event_new_flush_start() : gst_event_new_flush_stop(TRUE);
        gst_event_set_seqnum(event, seqnum);
        return event;
      });
      it.play();
    }
    for (auto* consumer : {&it, &fresh}) {
      consumer->push_segment({.base = 1 * GST_SECOND});
      for (guint i = 0; i < 3; ++i) consumer->push_interval(before + i);
      consumer->end();
      consumer->expect_segments();
    }
    for (std::size_t i = 0; i < it.outputs().size(); ++i) {
      EXPECT_EQ(it.outputs()[i]->buffers_after_flushes(),
                fresh.outputs()[i]->buffers_after_flushes());
    }
  }
}

/// Elements that write files; tests of these tell what they do with invalid events.
bool is_writer(const std::string& name) {
  return name.ends_with("enc") || name.ends_with("mux") || name == "eventhdf5sink";
}

/// Elements that pass all events, or those of the wrong time, unchanged.
bool passes_invalid_events(const std::string& name) {
  return name == "eventstats" || name == "eventcompare" || name == "eventlabel";
}
bool takes_late_events(const std::string& name) {
  return is_writer(name) || name == "eventlabel" || name == "eventdatagrampay";
}

/// They warn once, and the output is that without these events.
TEST_P(EveryConsumer, SkipsInvalidEvents) {
  struct Fault {
    const char* name;
    GstEventCameraEvent event;  ///< the last one of the buffer
    GstClockTime pts = 10 * GST_MSECOND;
    gsize extra_bytes = 0;
  };
  std::vector<Fault> faults{{"outside", {2, 64, 5}}, {"outside", {2, 8, 48}}};
  if (!takes_late_events(GetParam())) faults.push_back({"past the end", {900'000, 8, 4}});
  if (!is_writer(GetParam())) {
    faults.push_back({"no PTS", {2, 8, 5}, GST_CLOCK_TIME_NONE});
    faults.push_back({"a partial event", {2, 8, 5}, 10 * GST_MSECOND, 5});
  }
  for (const auto& fault : faults) {
    Consumer it(GetParam());
    if (!it.takes_events()) GTEST_SKIP();
    Consumer reference(GetParam());
    const bool skips_buffer = fault.extra_bytes > 0 || !GST_CLOCK_TIME_IS_VALID(fault.pts);
    std::vector<GstEventCameraEvent> events{{0, 8, 4}, {1, 9, 4}};
    for (auto* consumer : {&reference, &it}) {
      consumer->push_segment();
      consumer->push_interval(0);
      if (consumer == &it) events.push_back(fault.event);
      if (consumer == &it || !skips_buffer)
        consumer->push_events(events, fault.pts, fault.extra_bytes);
      else
        consumer->push_events({});
      consumer->push_interval(2);
    }
    const auto usual = reference.faults();
    const auto found = it.faults();
    EXPECT_EQ(found.size(), usual.size() + 1) << fault.name << testing::PrintToString(found);
    if (passes_invalid_events(GetParam())) continue;
    for (std::size_t i = 0; i < it.outputs().size(); ++i)
      EXPECT_EQ(it.outputs()[i]->buffers_after_flushes(),
                reference.outputs()[i]->buffers_after_flushes())
          << fault.name;
  }
}

TEST_P(EveryConsumer, RefusesToRunBackwards) {
  Consumer it(GetParam());
  it.push_segment({.stop = GST_SECOND, .rate = -1});
  EXPECT_TRUE(contains(testing::PrintToString(it.faults()), "backwards"));
}

TEST_P(EveryConsumer, RefusesEventsWithoutTimes) {
  Consumer it(GetParam());
  if (!it.takes_events() || is_writer(GetParam())) GTEST_SKIP();
  it.push_segment({.format = GST_FORMAT_BYTES});
  EXPECT_TRUE(contains(testing::PrintToString(it.faults()), "no timestamps"));
}

/// Elements whose output continues where their input does not: files and datagrams have no flags,
/// and eventrender and eventreconstruct draw frames through gaps.
bool continues_through_discontinuities(const std::string& name) {
  return name.ends_with("enc") || name.ends_with("mux") || name.ends_with("pay") ||
         name == "eventrender" || name == "eventreconstruct";
}

TEST_P(EveryConsumer, MarksADiscontinuity) {
  if (continues_through_discontinuities(GetParam())) GTEST_SKIP();
  Consumer it(GetParam());
  it.push_segment();
  for (guint i = 0; i < 3; ++i) it.push_interval(i);
  for (guint i = 10; i < 13; ++i) it.push_interval(i, i == 10);
  it.end();
  for (const auto& output : it.outputs())
    EXPECT_TRUE(std::ranges::any_of(output->named("buffer"), [](const Output::Item& item) {
      return GST_CLOCK_TIME_IS_VALID(item.discontinuity) && item.discontinuity >= 90 * GST_MSECOND;
    }));
}

/// An element that passes its main input on, and uses another one.
struct Joiner {
  const char* element;
  const char* main_pad;
};

class EveryJoiner : public testing::TestWithParam<Joiner> {};
INSTANTIATE_TEST_SUITE_P(, EveryJoiner,
                         testing::Values(Joiner{"eventcompare", "candidate"},
                                         Joiner{"eventfuse", "video_sink"},
                                         Joiner{"eventlabel", "event_sink"},
                                         Joiner{"eventoverlay", "video_sink"},
                                         Joiner{"flowjoin", "video_sink"}),
                         [](const auto& joiner) { return std::string(joiner.param.element); });

TEST_P(EveryJoiner, AsksOnceForTheStreamThatIsMissing) {
  const auto& [element, main_pad] = GetParam();
  Harness h(element, main_pad, "src");
  for (const char* framerate : {"25/1", "30/1"}) {
    const std::string kind = main_pad == std::string("video_sink")
                                 ? "video/x-raw, format=GRAY8"
                                 : "application/x-event-camera, format=XYTP";
    gst_harness_set_src_caps_str(h.get(),
                                 (kind + ", width=8, height=4, framerate=" + framerate).c_str());
  }
  h.wait_for_events();
  EXPECT_TRUE(contains(h.warning(), "link a s"));
  EXPECT_EQ(h.warning(), "");
}

/* errors, where GStreamer tries again what was refused */

constexpr auto small = "application/x-event-camera, format=XYTP, width=32, height=24";
constexpr auto large = "application/x-event-camera, format=XYTP, width=16384, height=16384";

struct Refusal {
  const char* launch;
  const char* caps;
  const char* error;
  double rate = 1;
};

void PrintTo(const Refusal& refusal, std::ostream* out) {
  *out << refusal.launch << ": " << refusal.error;
}

constexpr Refusal refusals[] = {
    {"eventcrop left=40", small, "Cannot filter the events: cropping 40 columns"},
    {"eventmask location=/nowhere", small, "Cannot filter the events: cannot read the mask"},
    {"eventtensor bins=256", large, "Cannot make tensors that take more than 1 GiB"},
    {"evtenc", large, "This file format cannot hold the stream"},
    {"evtparse", "application/x-event-camera, format=EVT3, framerate=0/1",
     "Cannot read this camera"},
    {"eventdatagrampay format=jaer", large, "jAER's addresses support sensors of up to 1024x512"},
    {"rtpeventpay", large,
     "EVT3 words support sensors of 1x1 to 2048x2048 pixels, not 16384x16384; set format=XYTP"},
    {"eventdatagramdepay width=32 height=24", "application/x-event-datagram",
     "Cannot receive events backwards", -1},
    {"evtdec", "application/x-event-camera, format=EVT3, width=32, height=24",
     "Cannot read events backwards", -1},
    {"evtparse", "application/x-event-camera, format=EVT3, width=32, height=24, framerate=0/1",
     "Cannot parse events backwards", -1},
    {"rtpeventdepay",
     "application/x-rtp, media=application, clock-rate=1000000, "
     "encoding-name=X-EVENT-CAMERA, width=32, height=24",
     "Cannot receive events backwards", -1},
    {"rtpeventpay", small, "Cannot send events backwards", -1},
};

class EveryRefusal : public testing::TestWithParam<Refusal> {};
INSTANTIATE_TEST_SUITE_P(, EveryRefusal, testing::ValuesIn(refusals));

/// Sticky events that are refused come again before each buffer and event that follows.
TEST_P(EveryRefusal, IsToldOncePerStart) {
  const auto& refusal = GetParam();
  Harness h(refusal.launch);
  for (int start = 0; start < 2; ++start) {
    gst_harness_set_src_caps_str(h.get(), refusal.caps);
    push_segment(h.get(), {.stop = GST_SECOND, .rate = refusal.rate});
    for (const GstClockTime time : {0, 10})
      EXPECT_NE(h.push(buffer_of(time * GST_MSECOND, {{0, 1, 1}}, GST_MSECOND)), GST_FLOW_OK);
    push_eos(h.get());
    EXPECT_TRUE(contains(h.error(), refusal.error));
    EXPECT_EQ(h.error(), "");
    gst_element_set_state(h->element, GST_STATE_READY);
    gst_element_set_state(h->element, GST_STATE_PLAYING);
    gst_harness_push_event(h.get(), gst_event_new_stream_start("again"));
  }
}

/* states */

INSTANTIATE_TEST_SUITE_P(, EverySimulator, testing::ValuesIn(simulators));

class AllStates : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(, AllStates, testing::ValuesIn(element_names()), element_lines::test_name);

/// As GStreamer's generic tests of all elements do.
TEST_P(AllStates, AreReachedFromEachOther) {
  const auto element = Kind(GetParam()).make();
  const auto states = {GST_STATE_NULL, GST_STATE_READY, GST_STATE_PAUSED, GST_STATE_PLAYING};
  for (const auto from : states)
    for (const auto to : states)
      for (const auto state : {from, to, from})
        EXPECT_NE(gst_element_set_state(element.get(), state), GST_STATE_CHANGE_FAILURE)
            << gst_element_state_get_name(from) << " and " << gst_element_state_get_name(to);
  EXPECT_EQ(gst_element_set_state(element.get(), GST_STATE_NULL), GST_STATE_CHANGE_SUCCESS);
  EXPECT_EQ(GST_OBJECT_REFCOUNT_VALUE(element.get()), 1);
}

TEST_P(EverySimulator, PlaysAgainAfterAStop) {
  Pipeline pipeline(
      "videotestsrc name=source pattern=ball num-buffers=6 ! video/x-raw,width=80,height=60 ! " +
      with_upload(GetParam()) + " ! fakesink name=sink signal-handoffs=true");
  int buffers = 0;
  g_signal_connect(pipeline["sink"], "handoff",
                   G_CALLBACK(+[](GstElement*, GstBuffer*, GstPad*, int* count) { ++*count; }),
                   &buffers);
  for (int times = 1; times <= 3; ++times) {
    ASSERT_TRUE(pipeline.play()) << pipeline.error;
    pipeline.set(GST_STATE_NULL);
    EXPECT_EQ(buffers, 5 * times);
  }
}

}  // namespace
