// SPDX-License-Identifier: LGPL-2.1-or-later
// What writers of event files of every format write, leave out and report.
#include "src/formats/file_formats.hpp"
#include "tests/elements/event_files.hpp"
#include "tests/elements/recording_files.hpp"

namespace {

using namespace harness;
using namespace event_files;

TEST(Writers, EndInAnErrorOnAFullDisk) {
  for (const auto& [extension, writer] : recording_files::elements_with("output-extensions")) {
    if (writer.starts_with("eventhdf5sink")) continue;  // it writes the file itself
    Pipeline pipeline(
        "videotestsrc pattern=snow num-buffers=20 ! video/x-raw,format=GRAY8,width=64,height=48 ! "
        "eventsim-frame ! application/x-event-camera ! " +
        writer + " ! filesink location=/dev/full");
    EXPECT_FALSE(pipeline.play()) << writer;
    EXPECT_EQ(pipeline.error, "No space left on the resource.") << writer;
  }
}

/// All formats of the table have a reader, and their extensions one element each.
TEST(Readers, ReadAllFormats) {
  const auto readers = recording_files::elements_with("input-extensions");
  for (const auto& format : eventcamera::file_formats()) {
    const Owned<GstCaps> caps(gst_caps_new_empty_simple(format.media_type));
    const std::string extensions = format.extensions;
    const auto reader = readers.at(extensions.substr(0, extensions.find(',')));
    GstElementFactory* const factory = gst_element_factory_find(reader.c_str());
    EXPECT_TRUE(gst_element_factory_can_sink_any_caps(factory, caps.get())) << format.media_type;
    gst_object_unref(factory);
  }
}

TEST_P(EveryFormat, TellsHowManyEventsCameTooLate) {
  Writer h(format());
  const auto push = [&](const std::vector<Microseconds>& times) {
    Events events;
    for (const auto t : times) events.push_back(on_at(5, 5, t));
    h.write(events, 0);
  };
  push({3000});
  for (int times = 0; times < 3; ++times) push({1000, 2000});
  EXPECT_EQ(h.warning(), "");
  push({2000, 4000, 5000});
  EXPECT_TRUE(h.warning().starts_with("Dropped 7 events earlier than"));
  // Further dropped events are reported once, at the end.
  push({1000, 2000, 4999});
  push({6000});
  EXPECT_EQ(h.warning(), "");
  std::vector<Microseconds> written;
  for (const auto& event : events_in(format(), h.end())) written.push_back(event.t);
  EXPECT_TRUE(h.warning().starts_with("Dropped 10 events in total earlier"));
  EXPECT_EQ(written, (std::vector<Microseconds>{3000, 4000, 5000, 6000}));
}

/// As from concat.
TEST_P(EveryFormat, RefusesARecordingAfterAnother) {
  Writer h(format());
  h.write(on_at(5, 5, 3000), 0);
  push_segment(h.get());
  h.write(on_at(5, 5, 3000), 0);  // times go on
  EXPECT_EQ(h.error(), "");
  push_segment(h.get());
  EXPECT_EQ(h.push(buffer_of(Events{on_at(5, 5, 2000)}, 0)), GST_FLOW_ERROR);
  EXPECT_TRUE(contains(h.error(), "start over at 2000 us"));
}

/// As from MP4 with B-frames or an edit list: timestamps begin at 67 ms, players count from 0.
TEST(Writers, CountSimulatedEventsInStreamTime) {
  for (const std::string passed : {"", "! eventpolarity "}) {
    Harness h("eventsim-frame " + passed + "! eventcsvenc");
    h.caps("video/x-raw, format=GRAY8, width=8, height=4, framerate=25/1", "ANY");
    constexpr GstClockTime start = 66'666'667;
    push_segment(h.get(), {.start = start});
    h.push(h.flat(start, 50));
    h.push(h.flat(start + 40 * GST_MSECOND, 200));
    push_eos(h.get());
    std::string text;
    h.wait_for_events();
    while (const auto buffer = h.pull()) text += bytes_of(buffer.get());
    EXPECT_TRUE(contains(text, "\n40000,")) << text.substr(0, 200);
  }
}

TEST(EventNpzEnc, TellsOfEventsThatAreLostWithoutTheEnd) {
  Writer h(format_of("npz"));
  h.write(some_events(), 0);
  gst_element_set_state(h.element(), GST_STATE_READY);
  EXPECT_TRUE(h.warning().starts_with("Lost 20000 events, and the file is incomplete"));

  Writer ended(format_of("npz"));
  ended.write(some_events(), 0);
  ended.end();
  gst_element_set_state(ended.element(), GST_STATE_READY);
  EXPECT_EQ(ended.warning(), "");
}

TEST_P(EveryFormat, IsWrittenAnewAfterAFlush) {
  Writer h(format());
  const auto early = off_at(6, 6, 1000);
  for (const bool ended : {false, true}) {
    h.write(on_at(5, 5, 1'000'000), 1'000'000);
    if (ended) push_eos(h.get());
    h.pull_bytes();
    flush({h.get()});
    push_segment(h.get());
    while (h.message(GST_MESSAGE_WARNING)) continue;
  }
  h.write(early, 0);
  EXPECT_EQ(events_in(format(), h.end()), std::vector{early});
  EXPECT_EQ(h.dropped(), "");
}

TEST_P(EveryFormat, IsOfOneSize) {
  Writer h(format());
  h.write(on_at(5, 5, 1000), 0);
  gst_harness_set_src_caps_str(
      h.get(), "application/x-event-camera, format=XYTP, width=320, height=240, framerate=30/1");
  EXPECT_EQ(h.error(), "");
  push_caps(h.get(), "application/x-event-camera, format=XYTP, width=64, height=48, framerate=0/1");
  EXPECT_NE(h.error(), "");
}

TEST_P(EveryFormat, HoldsALongPauseOrTellsThatItIsLeftOut) {
  // Longer than 32 bits of microseconds.
  const std::vector events = {on_at(5, 5, 1000), off_at(6, 6, 4'320'000'000),
                              off_at(7, 7, 4'320'000'001)};
  Writer h(format());
  for (const auto& event : events) h.write(event, event.t / 10'000 * 10'000);
  const auto read = events_in(format(), h.end());
  if (format().name != "dat") {
    EXPECT_EQ(read, events);
    EXPECT_EQ(h.dropped(), "");
    return;
  }
  EXPECT_TRUE(h.warning().starts_with("Removed a pause of 4319 s"));
  ASSERT_EQ(read.size(), 3U);
  EXPECT_EQ(read[2].t, 1001);
}

TEST(EventDatEnc, TellsOfAllPausesThatAreLeftOut) {
  Writer h(format_of("dat"));
  for (const Microseconds hour : {0, 2, 7}) {
    const auto t = hour * 3'600'000'000 + 1000;
    h.write(on_at(5, 5, t), t);
  }
  h.end();
  EXPECT_TRUE(h.warning().starts_with("Removed a pause of 7200 s"));
  EXPECT_TRUE(h.warning().starts_with("Removed pauses of 25200 s in total"));
  EXPECT_EQ(h.warning(), "");
}

/// A client that joins late, as of tcpserversink, gets it from there.
TEST_P(EveryFormat, HasItsHeaderInTheCaps) {
  const auto events = some_events();
  Writer writer(format());
  writer.write(std::span(events).first(10'000), 0);
  const auto begun = writer.pull();
  ASSERT_TRUE(begun);
  EXPECT_TRUE(GST_BUFFER_FLAG_IS_SET(begun.get(), GST_BUFFER_FLAG_HEADER));
  while (const auto buffer = writer.pull())
    EXPECT_FALSE(GST_BUFFER_FLAG_IS_SET(buffer.get(), GST_BUFFER_FLAG_HEADER));

  const Owned<GstCaps> caps(gst_pad_get_current_caps(writer->sinkpad));
  const GValue* const headers =
      gst_structure_get_value(gst_caps_get_structure(caps.get(), 0), "streamheader");
  ASSERT_TRUE(headers != nullptr && GST_VALUE_HOLDS_ARRAY(headers));
  ASSERT_EQ(gst_value_array_get_size(headers), 1U);
  const auto header = bytes_of(gst_value_get_buffer(gst_value_array_get_value(headers, 0)));
  EXPECT_EQ(header, bytes_of(begun.get()));

  if (format().is_archive) {
    EXPECT_EQ(events_in(format(), header + writer.end()),
              Events(events.begin(), events.begin() + 10'000));
    return;
  }
  writer.write(std::span(events).subspan(10'000), 6'000'000);
  const auto read = events_in(format(), header + writer.pull_bytes());
  // EVT3 has to wait for the next row.
  const auto missed = 10'000 - read.size();
  ASSERT_LE(missed, format().name == "evt3" ? 320U : 0U);
  for (std::size_t i = 0; i < read.size(); ++i) {
    const auto& event = events[10'000 + missed + i];
    ASSERT_TRUE(read[i].x == event.x && read[i].y_p == event.y_p) << i;
  }
}

/// A custom event may come from anywhere, with any content.
TEST_P(EveryFormat, SurvivesTriggersOfAnyKind) {
  Writer h(format());
  const auto push = [&](GstStructure* structure) {
    EXPECT_TRUE(gst_harness_push_event(
        h.get(), gst_event_new_custom(GST_EVENT_CUSTOM_DOWNSTREAM, structure)));
  };
  const auto push_records = [&](const char* name, const std::vector<gint64>& numbers, gsize size) {
    GBytes* const records = g_bytes_new(numbers.data(), size);
    push(gst_structure_new(name, "records", G_TYPE_BYTES, records, nullptr));
    g_bytes_unref(records);
  };
  for (const char* name : {"GstEventCameraTriggers", "GstEventCameraImu"}) {
    push(gst_structure_new_empty(name));
    push(gst_structure_new(name, "records", G_TYPE_STRING, "none", nullptr));
    push_records(name, {}, 0);
    push_records(name, {G_MININT64, -1, G_MAXINT64, -1, -1, -1, 0, 0, 7'000'000, 1}, 75);
  }
  auto events = some_events();
  events.resize(100);
  h.write(events, 2'000'000);
  push_records("GstEventCameraTriggers", {2'000'000, 1, 2'004'950, -1},
               32);  // the first is late
  Reader reader(format());
  reader.read(h.end());
  EXPECT_EQ(pull_events(reader), events);
  EXPECT_EQ(reader.warning(), "");
}

}  // namespace
