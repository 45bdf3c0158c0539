// SPDX-License-Identifier: LGPL-2.1-or-later
// EVT words without a header, as streams; and what else is particular to EVT.
#include "src/formats/evt/raw.hpp"
#include "tests/elements/event_files.hpp"

namespace {

using namespace harness;
using namespace event_files;

std::string words_caps(const std::string& format) {
  return "application/x-event-camera, format=" + format + ", width=320, height=240, framerate=0/1";
}

class EveryWord : public testing::TestWithParam<const char*> {
 protected:
  /// The words of an event of a camera that has just started, received at `pts`.
  Buffer words_of(const AbsoluteEvent& event, GstClockTime pts = 10 * GST_MSECOND) const {
    Writer writer("evtenc", caps);
    writer.write(event, event.t / 1000 * 1000);
    Buffer words = writer.pull();
    GST_BUFFER_PTS(words.get()) = pts;
    return words;
  }

  const std::string caps = words_caps(GetParam());
};
INSTANTIATE_TEST_SUITE_P(, EveryWord, testing::Values("EVT2", "EVT21", "EVT3", "EVT4"));

TEST_P(EveryWord, KeepsTheTimesOfItsBuffers) {
  // Hours into the stream, beyond the range of the words' clocks.
  const GstClockTime late = 5 * 3600 * GST_SECOND;
  Writer writer("evtenc", caps);
  Reader reader("evtdec", caps);
  Events expected;
  Events read;
  for (int i = 0; i < 20; ++i) {
    const auto start = static_cast<Microseconds>(late / GST_USECOND) + 10'000 * i;
    const std::vector events = {on_at(i, 7, start + 17), off_at(i, 9, start + 9'999)};
    expected.insert(expected.end(), events.begin(), events.end());
    writer.write(events, start);
    const auto words = writer.pull();
    ASSERT_TRUE(words);
    EXPECT_EQ(GST_BUFFER_PTS(words.get()), static_cast<GstClockTime>(start) * GST_USECOND);
    reader.push(gst_buffer_ref(words.get()));
    while (const auto buffer = reader.pull()) append_events(buffer.get(), read);
    // Nothing is delayed by more than an interval.
    EXPECT_GE(read.size() + 4, expected.size());
  }
  push_eos(reader.get());
  while (const auto buffer = reader.pull()) append_events(buffer.get(), read);
  EXPECT_EQ(read, expected);
  EXPECT_EQ(gst_harness_query_latency(reader.get()), 10 * GST_MSECOND);
}

TEST_P(EveryWord, FollowsGaps) {
  Reader reader("evtdec", caps);
  push_gap(reader.get(), 0);
  EXPECT_TRUE(reader.pull_event(GST_EVENT_GAP));
  reader.push(words_of(on_at(3, 4, 12'000)).release());
  push_gap(reader.get(), 20 * GST_MSECOND, 30 * GST_MSECOND);
  EXPECT_EQ(pull_events(reader), Events{on_at(3, 4, 12'000)});
  EXPECT_TRUE(reader.pull_event(GST_EVENT_GAP));
}

/// A camera that starts again counts from a lower time.
TEST_P(EveryWord, FollowsACameraThatStartsAgain) {
  for (const std::string how : {"DISCONT", "flush", "stream"}) {
    Reader reader("evtdec", caps);
    Events read;
    for (const Microseconds clock : {9'000'000, 2'000'000}) {
      auto words = words_of(on_at(3, 4, clock + 5));
      if (how == "DISCONT") GST_BUFFER_FLAG_SET(words.get(), GST_BUFFER_FLAG_DISCONT);
      if (how == "flush") flush({reader.get()});
      if (how == "stream")
        gst_harness_push_event(reader.get(), gst_event_new_stream_start(how.c_str()));
      if (how != "DISCONT") push_segment(reader.get());
      reader.push(words.release());
      push_gap(reader.get(), 20 * GST_MSECOND, GST_MSECOND);
      append_events(reader.pull().get(), read);
    }
    EXPECT_EQ(read, Events(2, on_at(3, 4, 10'000))) << how;
    EXPECT_EQ(reader.warning(), "") << how;
  }
}

/// The camera starts again although downstream refused the events before.
TEST_P(EveryWord, FollowsADiscontinuityAfterAnError) {
  Writer before("evtenc", caps);
  Writer after("evtenc", caps);
  Reader reader("evtdec", caps);
  const auto push = [&](Writer& writer, Microseconds clock, GstClockTime pts, bool is_discont) {
    // In rows that differ, because EVT3 states a row only where it changes.
    const int row = clock % 20'000 == 0 ? 4 : 5;
    writer.write(on_at(3, row, clock + 5), clock);
    Buffer words = writer.pull();
    GST_BUFFER_PTS(words.get()) = pts;
    if (is_discont) GST_BUFFER_FLAG_SET(words.get(), GST_BUFFER_FLAG_DISCONT);
    return reader.push(words.release());
  };
  EXPECT_EQ(push(before, 9'000'000, 10 * GST_MSECOND, false), GST_FLOW_OK);
  const auto refuse = [](GstPad*, GstPadProbeInfo* info, gpointer) {
    gst_buffer_unref(GST_PAD_PROBE_INFO_BUFFER(info));
    info->data = nullptr;
    GST_PAD_PROBE_INFO_FLOW_RETURN(info) = GST_FLOW_ERROR;
    return GST_PAD_PROBE_HANDLED;
  };
  const auto probe =
      gst_pad_add_probe(reader->sinkpad, GST_PAD_PROBE_TYPE_BUFFER, refuse, nullptr, nullptr);
  EXPECT_EQ(push(before, 9'010'000, 20 * GST_MSECOND, false), GST_FLOW_ERROR);
  gst_pad_remove_probe(reader->sinkpad, probe);
  // The error of the last buffer.
  EXPECT_EQ(push(after, 2'000'000, 30 * GST_MSECOND, true), GST_FLOW_ERROR);
  EXPECT_EQ(push(after, 2'010'000, 40 * GST_MSECOND, false), GST_FLOW_OK);
  push_eos(reader.get());
  EXPECT_EQ(pull_events(reader), (Events{on_at(3, 4, 10'000), on_at(3, 5, 40'000)}));
  EXPECT_EQ(reader.warning(), "");
}

/// As of evtparse, which corrects its times so.
TEST_P(EveryWord, ContinuesInANewSegment) {
  Writer writer("evtenc", caps);
  Reader reader("evtdec", caps);
  const std::vector events = {on_at(3, 4, 9'000), on_at(5, 4, 9'010)};
  for (const auto& event : events) {
    push_segment(reader.get());
    writer.write(event, event.t);
    reader.push(writer.pull().release());
  }
  push_eos(reader.get());
  EXPECT_EQ(pull_events(reader), events);
}

TEST_P(EveryWord, FollowsASizeThatChanges) {
  Writer writer("evtenc", std::string("application/x-event-camera, format=") + GetParam());
  Reader reader("evtdec", caps);
  const auto pass = [&](const AbsoluteEvent& event) {
    writer.write(event, event.t);
    Buffer words = writer.pull();
    ASSERT_TRUE(words);
    gst_harness_set_src_caps_str(reader.get(), writer.out_caps().c_str());
    reader.push(words.release());
  };
  const auto first = on_at(300, 4, 10'000);
  const auto second = off_at(60, 40, 50'000);
  pass(first);
  gst_harness_set_src_caps_str(
      writer.get(), "application/x-event-camera, format=XYTP, width=64, height=48, framerate=30/1");
  pass(second);
  EXPECT_EQ(writer.error(), "");
  push_eos(reader.get());
  EXPECT_EQ(pull_events(reader), (std::vector{first, second}));
  EXPECT_TRUE(contains(reader.out_caps(), "width=(int)64"));
}

TEST_P(EveryWord, FillBuffersOfALimitedSize) {
  constexpr gsize max_size = 100;
  Writer writer("evtenc mtu=100", caps);
  Reader reader("evtdec", caps);
  // Dense rows, isolated events, and a silence that may take words of its own.
  Events expected;
  GstClockTime end = 7 * 3600 * GST_SECOND;
  for (int i = 0; i < 30; ++i) {
    const auto start = static_cast<Microseconds>(end / GST_USECOND);
    const Microseconds length = i == 15 ? 500'000 : 10'000;
    Events events;
    for (int x = 0; x < 320; ++x)
      events.push_back(on_at(x, i, start + 17 + (i % 2 == 0 ? x / 40 : 20 * x)));
    events.push_back(off_at(i, 9, start + length - 1));
    expected.insert(expected.end(), events.begin(), events.end());
    GstBuffer* const buffer = buffer_of(events, start);
    GST_BUFFER_DURATION(buffer) = static_cast<GstClockTime>(length) * GST_USECOND;
    writer.push(buffer);
    while (const auto words = writer.pull()) {
      EXPECT_LE(gst_buffer_get_size(words.get()), max_size);
      EXPECT_EQ(gst_buffer_get_size(words.get()) % 2, 0U);
      EXPECT_GE(GST_BUFFER_PTS(words.get()), end);
      if (GST_BUFFER_DURATION_IS_VALID(words.get()))
        end = GST_BUFFER_PTS(words.get()) + GST_BUFFER_DURATION(words.get());
      reader.push(gst_buffer_ref(words.get()));
    }
    EXPECT_EQ(end, static_cast<GstClockTime>(start + length) * GST_USECOND);
  }
  push_eos(reader.get());
  EXPECT_EQ(pull_events(reader), expected);
}

TEST(EvtEnc, KeepsTriggers) {
  using eventcamera::Trigger;
  const auto events = some_events();
  const std::span<const AbsoluteEvent> all(events);
  const std::vector<Trigger> triggers{{events[5000].t, 2, true},
                                      {events[5000].t + 20, 2, false},
                                      {events[9'999].t + 1'500'000, 7, true},
                                      {events.back().t + 40'000, 7, false}};
  const auto encoder =
      eventcamera::make_prophesee_raw_encoder(eventcamera::EvtFormat::evt3, {width, height});
  std::vector<std::uint8_t> bytes;
  encoder->encode(all.first(5001), bytes);
  for (const auto& trigger : {triggers[0], triggers[1]})
    EXPECT_TRUE(encoder->encode_trigger(trigger, bytes));
  encoder->encode(all.subspan(5001, 4999), bytes);
  EXPECT_TRUE(encoder->encode_trigger(triggers[2], bytes));
  encoder->encode(all.subspan(10'000), bytes);
  EXPECT_TRUE(encoder->encode_trigger(triggers[3], bytes));
  const TemporaryFile in(bytes);
  for (const std::string between : {"", "identity ! "})
    for (const std::string words : {"EVT2", "EVT21", "EVT3", "EVT4"}) {
      SCOPED_TRACE(words + between);
      const auto decoder = eventcamera::make_prophesee_raw_decoder();
      eventcamera::Decoded decoded;
      decoder->decode(copied(in, between + "evtdec ! queue ! evtenc format=" + words), decoded);
      decoder->finish(decoded);
      EXPECT_EQ(decoded.triggers, triggers);
      EXPECT_EQ(decoded.events, events);
      EXPECT_EQ(decoder->corruption().places, 0U);
    }
}

TEST(EvtEnc, TakesTheFormatThatDownstreamLeaves) {
  Writer h("evtenc format=EVT4", "application/x-event-camera, format=(string){ EVT2, EVT3, EVT4 }");
  EXPECT_TRUE(contains(h.out_caps(), "EVT4"));
  EXPECT_TRUE(contains(h.out_caps(), "width=(int)320"));
}

TEST(EvtEnc, RefusesCapsOfAnotherSensor) {
  const TemporaryFile file(file_of(format_of("evt3"), some_events()));
  const std::string other = "application/x-event-camera,format=EVT3,width=32,height=32";
  Pipeline refused(file.source() + "evtdec ! evtenc ! " + other + " ! fakesink");
  EXPECT_FALSE(refused.play());
  EXPECT_EQ(refused.error,
            "Downstream does not take this format, or not from a sensor of 320 x 240 pixels. "
            "Correct the caps after this element.");
  const Writer chooses("evtenc", other + "; application/x-event-camera,format=EVT2");
  EXPECT_TRUE(contains(chooses.out_caps(), "EVT2"));
  EXPECT_TRUE(contains(chooses.out_caps(), "width=(int)320"));
}

}  // namespace
