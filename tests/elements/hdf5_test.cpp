// SPDX-License-Identifier: LGPL-2.1-or-later
// eventhdf5dec and eventhdf5sink: round trips of every layout, in pull and push mode, with seeks,
// corrupt files and unwritable locations.
#include <sys/resource.h>

#include <algorithm>
#include <csignal>

#include "src/formats/byte_source.hpp"
#include "src/formats/hdf5/hdf5_decoder.hpp"
#include "src/formats/hdf5/hdf5_writer.hpp"
#include "tests/elements/pipeline.hpp"

namespace {

using namespace harness;
using namespace eventcamera;
using Events = std::vector<AbsoluteEvent>;

constexpr int width = 320;
constexpr int height = 240;
constexpr const char* events_caps =
    "application/x-event-camera, format=XYTP, width=320, height=240, framerate=0/1";

/// A dot that runs through the rows for a second, from 2 s on, and again after a silence of three
/// seconds.
Events some_events() {
  Events events;
  for (int i = 0; i < 50'000; ++i) {
    const Microseconds t = 2'000'000 + 20 * i + (i >= 25'000 ? 3'000'000 : 0);
    events.push_back(AbsoluteEvent::at(i % width, i / width % height, t,
                                       i % 3 == 0 ? Polarity::off : Polarity::on));
  }
  return events;
}

std::vector<std::uint8_t> contents(const std::string& path) {
  const auto text = text_in(path);
  return {text.begin(), text.end()};
}

Decoded read_all(const std::string& path) {
  MemoryBytes bytes(contents(path));
  const auto decoder = make_hdf5_decoder();
  decoder->open(bytes);
  Decoded out;
  while (const auto item = decoder->next()) {
    if (const auto* const some = std::get_if<EventItem>(&*item))
      out.events.insert(out.events.end(), some->events.begin(), some->events.end());
    if (const auto* const some = std::get_if<TriggerItem>(&*item))
      out.triggers.insert(out.triggers.end(), some->triggers.begin(), some->triggers.end());
  }
  EXPECT_EQ(decoder->corruption().places, 0U) << decoder->corruption().first;
  EXPECT_EQ(decoder->streams().front().size, (SensorSize{width, height}));
  return out;
}

Events read(const std::string& path) {
  return read_all(path).events;
}

TEST(Hdf5Elements, WriteWhatTheyRead) {
  const auto events = some_events();
  for (const auto& [name, format] :
       {std::pair{"dsec", Hdf5Format::dsec}, {"metavision", Hdf5Format::metavision}}) {
    const TemporaryFolder folder;
    const auto in = folder / "in.h5";
    const auto out = folder / "out.h5";
    Hdf5Writer writer(in, {format, Hdf5Writer::Compression::gzip, {width, height}});
    writer.append(events);
    writer.close();
    Player player("filesrc location=" + in_quotes(in) +
                  " ! eventhdf5dec ! tee name=t  t. ! queue ! eventhdf5sink format=" + name +
                  " location=" + in_quotes(out) + "  t. ! queue");
    // The file is complete at the end of the stream, and again where another one is overwritten.
    for (const auto state : {GST_STATE_READY, GST_STATE_NULL, GST_STATE_NULL}) {
      ASSERT_TRUE(player.play()) << player.error;
      EXPECT_TRUE(read(out) == events) << name;
      ASSERT_TRUE(player.reaches(state));
      std::ofstream(out, std::ios::trunc) << "of another program";
    }
  }
}

/// Through EVT words and back.
TEST(Hdf5Elements, KeepTriggers) {
  using namespace eventcamera;
  const auto events = some_events();
  const std::vector<Trigger> triggers{{events.front().t - 1'500, 1, true},
                                      {events[777].t, 7, false},
                                      {events.back().t + 7'000, 0, false}};
  const TemporaryFolder folder;
  const auto in = folder / "in.hdf5";
  const auto out = folder / "out.hdf5";
  Hdf5Writer writer(in, {Hdf5Format::metavision, Hdf5Writer::Compression::none, {width, height}});
  writer.append(events);
  EXPECT_TRUE(writer.append(std::span(triggers)));
  writer.close();
  Player player("filesrc location=" + in_quotes(in) +
                " ! eventhdf5dec ! evtenc ! evtdec ! tee name=t  t. ! queue ! eventhdf5sink "
                "name=out format=metavision location=" +
                in_quotes(out) + "  t. ! queue");
  ASSERT_TRUE(player.play()) << player.error;
  EXPECT_TRUE(read(out) == events);
  EXPECT_EQ(read_all(out).triggers, triggers);
  EXPECT_EQ(player.stat("out", "triggers"), triggers.size());
}

/// A sink fed by the test.
struct Sink : Harness {
  explicit Sink(const std::string& path, const std::string& settings = "")
      : Harness("eventhdf5sink " + settings + " location=" + in_quotes(path)) {
    gst_harness_set_src_caps_str(get(), events_caps);
  }

  GstFlowReturn push(const Events& events, Microseconds start) {
    return Harness::push(buffer_of(events, start));
  }
};

class Hdf5Sink : public testing::Test {
 protected:
  const AbsoluteEvent late = on_at(5, 5, 1'000'000);
  const AbsoluteEvent early = off_at(6, 6, 1003);
  const TemporaryFolder folder;
  const std::string path = folder / "out.h5";
};

TEST_F(Hdf5Sink, WritesToAnotherFileAfterAStop) {
  const auto second = folder / "second.h5";
  Sink sink(path);
  EXPECT_EQ(sink.push({late}, 1'000'000), GST_FLOW_OK);
  ASSERT_EQ(gst_element_set_state(sink.element(), GST_STATE_READY), GST_STATE_CHANGE_SUCCESS);
  EXPECT_TRUE(read(path) == Events{late});
  g_object_set(sink.element(), "location", second.c_str(), nullptr);
  gst_element_set_state(sink.element(), GST_STATE_PLAYING);
  gst_harness_set_src_caps_str(sink.get(), events_caps);
  EXPECT_EQ(sink.push({early}, 0), GST_FLOW_OK);
  push_eos(sink.get());
  EXPECT_EQ(sink.warning_or_error(), "");
  EXPECT_TRUE(read(path) == Events{late});
  EXPECT_TRUE(read(second) == Events{early});
}

TEST_F(Hdf5Sink, LeavesOutWhatItCannotWrite) {
  Sink sink(path);
  const Events events = {on_at(5, 5, 1000), on_at(width, 5, 1001), on_at(5, height, 1002), early};
  EXPECT_EQ(sink.push(events, 0), GST_FLOW_OK);
  EXPECT_TRUE(sink.warning().starts_with("Dropped 2 events outside"));
  EXPECT_EQ(sink.push({events[0]}, 0), GST_FLOW_OK);  // time goes back
  EXPECT_EQ(sink.warning(), "");
  push_eos(sink.get());
  EXPECT_TRUE(sink.warning().starts_with("Dropped 1 event earlier"));
  EXPECT_EQ(sink.warning_or_error(), "");
  EXPECT_TRUE(read(path) == (Events{events[0], early}));
}

TEST_F(Hdf5Sink, WritesAnewAfterAFlush) {
  Sink sink(path);
  for (const bool ended : {false, true}) {
    EXPECT_EQ(sink.push({late}, 1'000'000), GST_FLOW_OK);
    if (ended) push_eos(sink.get());
    flush({sink.get()});
    push_segment(sink.get());
  }
  EXPECT_EQ(sink.push({early}, 0), GST_FLOW_OK);
  push_eos(sink.get());
  EXPECT_EQ(sink.warning_or_error(), "");
  EXPECT_TRUE(read(path) == Events{early});
}

TEST_F(Hdf5Sink, KeepsTheSizeOfTheSensor) {
  Sink sink(path);
  const auto small = "application/x-event-camera, format=XYTP, width=64, height=48, framerate=0/1";
  push_caps(sink.get(), small);
  push_caps(sink.get(), events_caps);  // nothing is written yet
  EXPECT_EQ(sink.push({on_at(200, 5, 0)}, 0), GST_FLOW_OK);
  push_caps(sink.get(),
            "application/x-event-camera, format=XYTP, width=320, height=240, framerate=30/1");
  EXPECT_EQ(sink.error(), "");
  push_caps(sink.get(), small);
  EXPECT_TRUE(contains(sink.error(), "The sensor size changes"));
}

TEST_F(Hdf5Sink, SaysWhatCannotBeWritten) {
  EXPECT_TRUE(contains(Sink("/no/such/folder/out.h5").error(),
                       "Cannot write /no/such/folder/out.h5. Set location to"));
  Sink large(path, "format=metavision");
  push_caps(large.get(),
            "application/x-event-camera, format=XYTP, width=4000, height=48, framerate=0/1");
  EXPECT_TRUE(contains(large.error(), "at most 2048 pixels"));

  Sink partial(path);
  EXPECT_EQ(partial.Harness::push(filled(7, 0, 0, GST_MSECOND)), GST_FLOW_ERROR);
  EXPECT_TRUE(contains(partial.error(), "partial event"));

  const Owned<GstElement> nowhere(gst_element_factory_make("eventhdf5sink", nullptr));
  EXPECT_EQ(gst_element_set_state(nowhere.get(), GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE);
  gst_element_set_state(nowhere.get(), GST_STATE_NULL);
}

TEST_F(Hdf5Sink, SaysThatTheDiskIsFull) {
  rlimit before = {};
  getrlimit(RLIMIT_FSIZE, &before);
  const rlimit limit = {100'000, before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &limit);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  Sink sink(path, "compression=none");
  while (sink.push(some_events(), 2'000'000) == GST_FLOW_OK) continue;
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  EXPECT_TRUE(sink.error().starts_with("The disk is full"));
}

TEST(Hdf5Dec, HasAPathAndAUnit) {
  const TemporaryFolder folder;
  const auto path = folder / "events.h5";
  {
    Hdf5Writer writer(path, {Hdf5Format::dsec, Hdf5Writer::Compression::gzip, {width, height}});
    writer.append(Events{on_at(5, 6, 0), off_at(7, 8, 3007)});
    writer.close();
  }
  const auto reader = "filesrc location=" + in_quotes(path) + " ! eventhdf5dec ";
  Player player(reader + "events-path=/events time-unit=nanoseconds");
  ASSERT_TRUE(player.play()) << player.error;
  ASSERT_EQ(player.events.size(), 2U);
  EXPECT_EQ(player.events[1].t, 3);
  Player other(reader + "events-path=right");
  EXPECT_FALSE(other.play());
  EXPECT_TRUE(contains(other.error, "no events at events-path /right; it has some at /events"));
}

TEST(Hdf5Dec, SaysWhatCannotBeRead) {
  const TemporaryFolder folder;
  EXPECT_FALSE(
      Player("filesrc location=" + in_quotes(folder / "none.h5") + " ! eventhdf5dec").play());
  std::ofstream(folder / "text.h5") << "t,x,y,p\n";
  for (const char* way : {"", "queue ! "}) {
    Player player("filesrc location=" + in_quotes(folder / "text.h5") + " ! " + way +
                  "eventhdf5dec");
    EXPECT_FALSE(player.play());
    EXPECT_TRUE(contains(player.error, "not an HDF5 file"));
  }
}

}  // namespace
