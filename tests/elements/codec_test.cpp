// SPDX-License-Identifier: LGPL-2.1-or-later
// Readers and writers of event files: round trips of every format, in push and pull mode, in one
// piece or several, and corrupt.
#include <glib/gstdio.h>

#include <algorithm>
#include <fstream>
#include <sstream>
#include <tuple>

#include "src/formats/chunker.hpp"
#include "src/formats/evt/raw.hpp"
#include "tests/elements/event_buffer.hpp"
#include "tests/elements/harness.hpp"

namespace {

using namespace harness;
using eventcamera::AbsoluteEvent;
using eventcamera::Microseconds;
using eventcamera::Polarity;

constexpr int width = 320;
constexpr int height = 240;
const std::string events_caps =
    "application/x-event-camera, format=XYTP, width=320, height=240, framerate=0/1";

struct Format {
  const char* name;
  const char* writer;
  const char* reader;
  const char* caps;
  std::string end = {};    ///< invalid bytes at the end; by default the file is truncated
  bool tells_size = true;  ///< the file states the sensor size
};

void PrintTo(const Format& format, std::ostream* out) {
  *out << format.name;
}

const Format formats[] = {
    {"evt2", "evtenc format=EVT2", "evtdec", "application/x-prophesee-raw"},
    {"evt21", "evtenc format=EVT21", "evtdec", "application/x-prophesee-raw"},
    {"evt3", "evtenc format=EVT3", "evtdec", "application/x-prophesee-raw"},
    {"evt4", "evtenc format=EVT4", "evtdec", "application/x-prophesee-raw"},
    {"dat", "eventdatenc", "eventdatdec", "application/x-prophesee-dat"},
    {"es", "eventesenc", "eventesdec", "application/x-es"},
    {"csv", "eventcsvenc format=metavision", "eventcsvdec", "application/x-event-csv", "no\n"},
    {"npy", "eventnpyenc", "eventnpydec", "application/x-npy", "", false},
};

std::string element_of(const char* launch) {
  return std::string(launch).substr(0, std::string(launch).find(' '));
}

/// Sorted events without duplicates: a dot that runs through the rows for a second, from 2 s on,
/// and again after a silence of three seconds.
std::vector<AbsoluteEvent> some_events() {
  std::vector<AbsoluteEvent> events;
  for (int i = 0; i < 20'000; ++i) {
    const Microseconds t = 2'000'000 + 50 * i + (i >= 10'000 ? 3'000'000 : 0);
    events.push_back(
        AbsoluteEvent::at(i % width, i / width, t, i % 3 == 0 ? Polarity::off : Polarity::on));
  }
  return events;
}

std::string pull_bytes(Harness& h) {
  std::string bytes;
  while (const auto buffer = h.pull()) bytes += bytes_of(buffer.get());
  return bytes;
}

/// File with these events, written by the element.
std::string file_of(const Format& format, std::span<const AbsoluteEvent> events) {
  Harness h(format.writer);
  gst_harness_set_sink_caps_str(h.get(), format.caps);
  gst_harness_set_src_caps_str(h.get(), events_caps.c_str());
  while (!events.empty()) {
    const auto start = events.front().t / 10'000 * 10'000;
    const auto end =
        std::ranges::find_if(events, [&](const auto& event) { return event.t >= start + 10'000; });
    const auto count = static_cast<std::size_t>(end - events.begin());
    EXPECT_EQ(h.push(buffer_of(events.first(count), start)), GST_FLOW_OK);
    events = events.subspan(count);
  }
  EXPECT_TRUE(gst_harness_push_event(h.get(), gst_event_new_eos()));
  return pull_bytes(h);
}

GstBuffer* bytes(std::string_view text) {
  return gst_buffer_new_memdup(text.data(), text.size());
}

void begin_file(Harness& h, const Format& format) {
  gst_harness_set_src_caps_str(h.get(), format.caps);
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_BYTES);
  gst_harness_push_event(h.get(), gst_event_new_segment(&segment));
}

void push_file(Harness& h, std::string_view file, std::size_t piece) {
  for (std::size_t at = 0; at < file.size(); at += piece) h.push(bytes(file.substr(at, piece)));
  gst_harness_push_event(h.get(), gst_event_new_eos());
}

/// Temporary file, deleted with this object.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& content) {
    gchar* name = nullptr;
    const int fd = g_file_open_tmp("events-XXXXXX", &name, nullptr);
    g_close(fd, nullptr);
    path_ = name;
    g_free(name);
    std::ofstream(path_, std::ios::binary) << content;
  }
  ~TemporaryFile() { g_remove(path_.c_str()); }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

/// File read by a pipeline.
class Player {
 public:
  Player(const std::string& path, const std::string& middle) {
    gst_init(nullptr, nullptr);
    const auto launch = "filesrc location=" + in_quotes(path) + " ! " + middle +
                        " ! fakesink name=sink sync=false signal-handoffs=true";
    pipeline_.reset(gst_parse_launch(launch.c_str(), nullptr));
    bus_.reset(gst_element_get_bus(pipeline_.get()));
    const Owned<GstElement> sink(gst_bin_get_by_name(GST_BIN(pipeline_.get()), "sink"));
    g_signal_connect(sink.get(), "handoff",
                     G_CALLBACK(+[](GstElement*, GstBuffer* buffer, GstPad*, Player* player) {
                       append_events(buffer, player->events);
                     }),
                     this);
  }
  ~Player() { gst_element_set_state(pipeline_.get(), GST_STATE_NULL); }

  GstElement* get() const { return pipeline_.get(); }

  bool pause() { return reaches(GST_STATE_PAUSED); }

  bool seek(GstClockTime start, GstClockTime stop = GST_CLOCK_TIME_NONE, gdouble rate = 1) {
    const bool done =
        gst_element_seek(pipeline_.get(), rate, GST_FORMAT_TIME,
                         static_cast<GstSeekFlags>(GST_SEEK_FLAG_FLUSH | GST_SEEK_FLAG_ACCURATE),
                         GST_SEEK_TYPE_SET, static_cast<gint64>(start),
                         GST_CLOCK_TIME_IS_VALID(stop) ? GST_SEEK_TYPE_SET : GST_SEEK_TYPE_NONE,
                         static_cast<gint64>(stop));
    return done && gst_element_get_state(pipeline_.get(), nullptr, nullptr, 20 * GST_SECOND) ==
                       GST_STATE_CHANGE_SUCCESS;
  }

  /// The message that ends it: EOS, an error, or none on timeout.
  Owned<GstMessage> play() {
    events.clear();
    gst_element_set_state(pipeline_.get(), GST_STATE_PLAYING);
    return Owned<GstMessage>(gst_bus_timed_pop_filtered(
        bus_.get(), 20 * GST_SECOND,
        static_cast<GstMessageType>(GST_MESSAGE_EOS | GST_MESSAGE_ERROR)));
  }

  bool ends_well() {
    const auto message = play();
    return message && GST_MESSAGE_TYPE(message.get()) == GST_MESSAGE_EOS;
  }

  bool reaches(GstState state) {
    gst_element_set_state(pipeline_.get(), state);
    return gst_element_get_state(pipeline_.get(), nullptr, nullptr, 20 * GST_SECOND) ==
           GST_STATE_CHANGE_SUCCESS;
  }

  GstClockTime duration() const {
    gint64 duration = -1;
    gst_element_query_duration(pipeline_.get(), GST_FORMAT_TIME, &duration);
    return static_cast<GstClockTime>(duration);
  }

  GstClockTime position() const {
    gint64 position = -1;
    gst_element_query_position(pipeline_.get(), GST_FORMAT_TIME, &position);
    return static_cast<GstClockTime>(position);
  }

  std::vector<AbsoluteEvent> events;  ///< since play()

 private:
  Owned<GstElement> pipeline_;
  Owned<GstBus> bus_;
};

class EveryFormat : public testing::TestWithParam<Format> {
 protected:
  const Format& format() const { return GetParam(); }
};
INSTANTIATE_TEST_SUITE_P(, EveryFormat, testing::ValuesIn(formats),
                         [](const auto& test) { return test.param.name; });

TEST_P(EveryFormat, IsReadAsItWasWrittenHoweverItIsSplit) {
  const auto events = some_events();
  const auto file = file_of(format(), events);
  for (const std::size_t piece : {1UL, 1000UL, 1UL << 24}) {
    auto h = Harness::with_late_pad(format().reader);
    begin_file(h, format());
    push_file(h, file, piece);
    EXPECT_EQ(pull_events(h), events);
    if (format().tells_size) {
      EXPECT_EQ(h.out_caps(),
                "application/x-event-camera, format=(string)XYTP, width=(int)320, height=(int)240, "
                "framerate=(fraction)0/1");
    }
    EXPECT_FALSE(h.message(GST_MESSAGE_WARNING));
    EXPECT_FALSE(h.message(GST_MESSAGE_ERROR));
    EXPECT_TRUE(h.pull_event(GST_EVENT_EOS));
  }
}

TEST_P(EveryFormat, KeepsEveryEventOfATimeInTheFilesOrder) {
  // Events of the same microsecond, with repeated pixels, against raster order.
  std::vector<AbsoluteEvent> events;
  for (const Microseconds t : {5'000, 5'001, 25'000})
    for (const auto& [x, y, polarity] :
         {std::tuple(9, 9, Polarity::on), std::tuple(1, 2, Polarity::off),
          std::tuple(1, 2, Polarity::on), std::tuple(1, 2, Polarity::on),
          std::tuple(2, 2, Polarity::on), std::tuple(0, 0, Polarity::off)})
      events.push_back(AbsoluteEvent::at(x, y, t, polarity));
  auto h = Harness::with_late_pad(format().reader);
  begin_file(h, format());
  push_file(h, file_of(format(), events), 1000);
  EXPECT_EQ(pull_events(h), events);
}

TEST_P(EveryFormat, BeginsAtTheFirstEventAndTellsSilence) {
  auto h = Harness::with_late_pad(format().reader);
  begin_file(h, format());
  push_file(h, file_of(format(), some_events()), 5000);
  const auto event = h.pull_event(GST_EVENT_SEGMENT);
  ASSERT_TRUE(event);
  const GstSegment* segment = nullptr;
  gst_event_parse_segment(event.get(), &segment);
  EXPECT_EQ(segment->format, GST_FORMAT_TIME);
  EXPECT_EQ(segment->start, 2 * GST_SECOND);
  EXPECT_EQ(gst_segment_to_running_time(segment, GST_FORMAT_TIME, 2 * GST_SECOND), 0U);
  EXPECT_EQ(gst_segment_to_stream_time(segment, GST_FORMAT_TIME, 2 * GST_SECOND), 0U);

  const auto gap = h.pull_event(GST_EVENT_GAP);
  ASSERT_TRUE(gap);
  const auto [start, duration] = gap_of(gap.get());
  EXPECT_EQ(start, 2500 * GST_MSECOND);
  EXPECT_GT(duration, 2900 * GST_MSECOND);
  int gaps = 1;
  while (h.pull_event(GST_EVENT_GAP)) ++gaps;
  EXPECT_LE(gaps, 2);

  GstClockTime end = 2 * GST_SECOND;
  int buffers = 0;
  while (const auto buffer = h.pull()) {
    EXPECT_GE(GST_BUFFER_PTS(buffer.get()), end);
    EXPECT_LE(GST_BUFFER_DURATION(buffer.get()), 10 * GST_MSECOND);
    end = GST_BUFFER_PTS(buffer.get()) + GST_BUFFER_DURATION(buffer.get());
    ++buffers;
  }
  EXPECT_EQ(buffers, 100);
}

TEST_P(EveryFormat, CutsByBufferTime) {
  auto h = Harness::with_late_pad(std::string(format().reader) + " buffer-duration=100000000");
  begin_file(h, format());
  push_file(h, file_of(format(), some_events()), 5000);
  int buffers = 0;
  while (h.pull()) ++buffers;
  EXPECT_EQ(buffers, 10);
}

TEST_P(EveryFormat, IsEmptyWhereThereAreNoEvents) {
  const auto file = file_of(format(), {});
  EXPECT_FALSE(file.empty());
  auto h = Harness::with_late_pad(format().reader);
  begin_file(h, format());
  push_file(h, file, 5);
  EXPECT_FALSE(h.pull());
  EXPECT_NE(h.out_caps().find(format().tells_size ? "width=(int)320" : "width=(int)128"),
            std::string::npos);
  EXPECT_TRUE(h.pull_event(GST_EVENT_SEGMENT));
  EXPECT_TRUE(h.pull_event(GST_EVENT_EOS));
  EXPECT_FALSE(h.message(GST_MESSAGE_ERROR));
}

TEST_P(EveryFormat, SaysWhenItIsUnsupportedFormat) {
  for (const auto& file : {std::string("a,b\n"), std::string("no events at all, but words\n"),
                           std::string(100'000, '\0')}) {
    auto h = Harness::with_late_pad(format().reader);
    begin_file(h, format());
    push_file(h, file, 4000);
    const auto message = h.message(GST_MESSAGE_ERROR);
    ASSERT_TRUE(message);
    EXPECT_NE(text_of(message.get()).find("Cannot read this file: "), std::string::npos);
    EXPECT_FALSE(h.message(GST_MESSAGE_ERROR));

    const TemporaryFile temporary(file);
    Player player(temporary.path(), format().reader);
    const auto pulled = player.play();
    ASSERT_TRUE(pulled);
    EXPECT_EQ(GST_MESSAGE_TYPE(pulled.get()), GST_MESSAGE_ERROR);
    EXPECT_NE(text_of(pulled.get()).find("Cannot read this file: "), std::string::npos);
  }
}

TEST_P(EveryFormat, IsNoFileWithoutAByte) {
  const TemporaryFile file("");
  for (const std::string way : {"", "queue ! "}) {
    Player player(file.path(), way + format().reader);
    const auto message = player.play();
    ASSERT_TRUE(message);
    ASSERT_EQ(GST_MESSAGE_TYPE(message.get()), GST_MESSAGE_ERROR);
    EXPECT_TRUE(text_of(message.get()).starts_with("Cannot read this file: ")) << way;
  }
}

TEST_P(EveryFormat, WarnsOnceOfCorruptionAndTellsWhere) {
  const auto events = some_events();
  auto file = file_of(format(), events);
  if (format().end.empty())
    file.pop_back();
  else
    file += format().end;
  auto h = Harness::with_late_pad(format().reader);
  begin_file(h, format());
  push_file(h, file, 5000);
  const auto message = h.message(GST_MESSAGE_WARNING);
  ASSERT_TRUE(message);
  const auto text = text_of(message.get());
  const auto found = text.find("data at byte ");
  ASSERT_NE(found, std::string::npos) << text;
  const auto position = std::stoul(text.substr(found + 13));
  EXPECT_LT(position, file.size());
  EXPECT_GE(position + 13, file.size());  // size of the longest event
  EXPECT_FALSE(h.message(GST_MESSAGE_WARNING));
  EXPECT_FALSE(h.message(GST_MESSAGE_ERROR));
  // Nearly all events were intact.
  const auto read = pull_events(h);
  ASSERT_GT(read.size(), events.size() - 40);
  EXPECT_TRUE(std::equal(read.begin(), read.end(), events.begin()));
  GstStructure* stats = nullptr;
  g_object_get(h.element(), "stats", &stats, nullptr);
  guint64 places = 0;
  EXPECT_TRUE(gst_structure_get_uint64(stats, "corrupt-places", &places));
  EXPECT_EQ(places, 1U);
  gst_structure_free(stats);
}

TEST_P(EveryFormat, SurvivesNoise) {
  const auto file = file_of(format(), some_events());
  for (unsigned seed = 0; seed < 20; ++seed) {
    auto noisy = file;
    g_random_set_seed(seed);
    for (int i = 0; i < 200; ++i)
      noisy[static_cast<std::size_t>(g_random_int_range(200, static_cast<gint>(noisy.size())))] ^=
          static_cast<char>(1 << g_random_int_range(0, 8));
    auto h = Harness::with_late_pad(format().reader);
    begin_file(h, format());
    push_file(h, noisy, 3000);
    for (const auto& event : pull_events(h)) {
      if (!format().tells_size) break;
      ASSERT_LT(event.x, width);
      ASSERT_LT(event.y(), height);
    }
  }
}

TEST_P(EveryFormat, IsPulledAndSoughtIn) {
  const auto events = some_events();
  const TemporaryFile file(file_of(format(), events));
  for (const std::string way : {"", "queue ! "}) {
    Player player(file.path(), way + format().reader);
    ASSERT_TRUE(player.pause());
    if (way.empty()) {
      EXPECT_EQ(player.duration(), 3'999'951 * GST_USECOND);
    }
    EXPECT_EQ(player.position(), 0U);
    ASSERT_TRUE(player.ends_well());
    EXPECT_EQ(player.duration() == GST_CLOCK_TIME_NONE, false);

    const Microseconds from = 3'700'000;
    const Microseconds to = 3'804'321;
    ASSERT_TRUE(player.pause());
    ASSERT_TRUE(player.seek(static_cast<GstClockTime>(from) * GST_USECOND));
    EXPECT_EQ(player.position(), static_cast<GstClockTime>(from) * GST_USECOND);
    ASSERT_TRUE(player.ends_well());
    std::vector<AbsoluteEvent> expected;
    std::ranges::copy_if(events, std::back_inserter(expected),
                         [](const auto& event) { return event.t >= 2'000'000 + from; });
    EXPECT_EQ(player.events, expected);

    // Backwards, and with a stop position.
    ASSERT_TRUE(player.pause());
    ASSERT_TRUE(player.seek(100 * GST_MSECOND));
    ASSERT_TRUE(player.seek(static_cast<GstClockTime>(from) * GST_USECOND,
                            static_cast<GstClockTime>(to) * GST_USECOND));
    ASSERT_TRUE(player.ends_well());
    std::erase_if(expected, [](const auto& event) { return event.t >= 2'000'000 + to; });
    EXPECT_EQ(player.events, expected);

    // Past the end, and at a negative rate.
    ASSERT_TRUE(player.pause());
    EXPECT_FALSE(player.seek(GST_SECOND, GST_CLOCK_TIME_NONE, -1));
  }
}

TEST_P(EveryFormat, KeepsItsPlaceWhenTheRateChanges) {
  const auto events = some_events();
  const TemporaryFile file(file_of(format(), events));
  for (const std::string way : {"", "queue ! "}) {
    Player player(file.path(), way + format().reader);
    ASSERT_TRUE(player.pause());
    ASSERT_TRUE(gst_element_seek(player.get(), 2, GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH,
                                 GST_SEEK_TYPE_NONE, 0, GST_SEEK_TYPE_NONE, 0));
    ASSERT_TRUE(player.pause());
    ASSERT_TRUE(player.ends_well());
    ASSERT_FALSE(player.events.empty());
    EXPECT_GT(player.events.front().t, events.front().t) << "it went back to the start";
    EXPECT_EQ(player.events.back(), events.back());
  }
}

TEST_P(EveryFormat, EndsEachOfTwoFilesInItsOwnStream) {
  const auto events = some_events();
  const TemporaryFile file(file_of(format(), events));
  Player player(file.path(), "queue ! c.  filesrc location=" + in_quotes(file.path()) +
                                 " ! concat name=c ! " + format().reader);
  struct Streams {
    Player& player;
    std::vector<std::size_t> start_at;
  } streams{player, {}};
  const Owned<GstElement> sink(gst_bin_get_by_name(GST_BIN(player.get()), "sink"));
  gst_pad_add_probe(
      GST_BASE_SINK_PAD(sink.get()), GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM,
      +[](GstPad*, GstPadProbeInfo* info, gpointer data) {
        auto& to = *static_cast<Streams*>(data);
        if (GST_EVENT_TYPE(GST_PAD_PROBE_INFO_EVENT(info)) == GST_EVENT_STREAM_START)
          to.start_at.push_back(to.player.events.size());
        return GST_PAD_PROBE_OK;
      },
      &streams, nullptr);
  ASSERT_TRUE(player.ends_well());
  EXPECT_EQ(player.events.size(), 2 * events.size());
  EXPECT_EQ(streams.start_at, (std::vector<std::size_t>{0, events.size()}));
}

TEST_P(EveryFormat, IsFoundByDecodebin) {
  const auto events = some_events();
  const TemporaryFile file(file_of(format(), events));
  Player player(file.path(), "decodebin caps=application/x-event-camera");
  ASSERT_TRUE(player.ends_well());
  EXPECT_EQ(player.events, events);
}

TEST_P(EveryFormat, GoesThroughAllStates) {
  const TemporaryFile file(file_of(format(), some_events()));
  Player player(file.path(), format().reader);
  for (int times = 0; times < 3; ++times) {
    EXPECT_TRUE(player.reaches(GST_STATE_PAUSED));
    EXPECT_TRUE(player.ends_well());
    EXPECT_EQ(player.events.size(), 20'000U);
    EXPECT_TRUE(player.reaches(times % 2 == 0 ? GST_STATE_READY : GST_STATE_NULL));
  }
  // Without data, and stopped halfway.
  for (const auto& name : {element_of(format().reader), element_of(format().writer)}) {
    const Owned<GstElement> element(gst_element_factory_make(name.c_str(), nullptr));
    for (const auto state : {GST_STATE_PLAYING, GST_STATE_NULL, GST_STATE_PAUSED, GST_STATE_NULL})
      EXPECT_NE(gst_element_set_state(element.get(), state), GST_STATE_CHANGE_FAILURE);
  }
  EXPECT_TRUE(player.reaches(GST_STATE_PAUSED));
}

TEST_P(EveryFormat, BeginsAnewAfterAFlush) {
  const auto events = some_events();
  const auto file = file_of(format(), events);
  auto h = Harness::with_late_pad(format().reader);
  begin_file(h, format());
  h.push(bytes(file.substr(0, file.size() / 2)));
  pull_events(h);
  gst_harness_push_event(h.get(), gst_event_new_flush_start());
  gst_harness_push_event(h.get(), gst_event_new_flush_stop(TRUE));
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_BYTES);
  gst_harness_push_event(h.get(), gst_event_new_segment(&segment));
  push_file(h, file, 10'000);
  EXPECT_EQ(pull_events(h), events);
  EXPECT_FALSE(h.message(GST_MESSAGE_WARNING));
}

TEST_P(EveryFormat, IsFreedWhileInUse) {
  const auto file = file_of(format(), some_events());
  for (const std::size_t count : {std::size_t{1}, file.size() / 2}) {
    auto h = Harness::with_late_pad(format().reader);
    begin_file(h, format());
    gst_harness_push_event(h.get(), gst_event_new_tag(gst_tag_list_new_empty()));
    h.push(bytes(file.substr(0, count)));
  }
}

/// Writer of `format`, with event caps.
std::unique_ptr<Harness> writer_of(const Format& format) {
  auto h = std::make_unique<Harness>(format.writer);
  gst_harness_set_sink_caps_str(h->get(), format.caps);
  gst_harness_set_src_caps_str(h->get(), events_caps.c_str());
  return h;
}

std::vector<AbsoluteEvent> events_in(const Format& format, const std::string& file) {
  auto reader = Harness::with_late_pad(format.reader);
  begin_file(reader, format);
  push_file(reader, file, 1000);
  return pull_events(reader);
}

void push_segment(Harness& h) {
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  gst_harness_push_event(h.get(), gst_event_new_segment(&segment));
}

TEST_P(EveryFormat, IsWrittenWithoutWhatLiesOutsideTheSensor) {
  const auto h = writer_of(format());
  const std::vector events = {AbsoluteEvent::at(5, 5, 1000, Polarity::on),
                              AbsoluteEvent::at(width, 5, 1001, Polarity::on),
                              AbsoluteEvent::at(5, height, 1002, Polarity::on),
                              AbsoluteEvent::at(6, 6, 1003, Polarity::off)};
  EXPECT_EQ(h->push(buffer_of(events, 0)), GST_FLOW_OK);
  gst_harness_push_event(h->get(), gst_event_new_gap(10 * GST_MSECOND, 10 * GST_MSECOND));
  EXPECT_TRUE(h->pull_event(GST_EVENT_GAP));
  auto warning = h->message(GST_MESSAGE_WARNING);
  ASSERT_TRUE(warning);
  EXPECT_TRUE(text_of(warning.get())
                  .starts_with("Left out 2 events outside the sensor. Correct the size in the "
                               "caps, 320x240 pixels"));
  gst_harness_push_event(h->get(), gst_event_new_eos());
  while ((warning = h->message(GST_MESSAGE_WARNING)))
    EXPECT_FALSE(text_of(warning.get()).starts_with("Left out"));
  EXPECT_TRUE(h->pull_event(GST_EVENT_EOS));
  EXPECT_EQ(events_in(format(), pull_bytes(*h)), (std::vector{events[0], events[3]}));
}

TEST_P(EveryFormat, TellsHowManyEventsCameTooLate) {
  const auto h = writer_of(format());
  const auto push = [&](const std::vector<Microseconds>& times) {
    std::vector<AbsoluteEvent> events;
    for (const auto t : times) events.push_back(AbsoluteEvent::at(5, 5, t, Polarity::on));
    EXPECT_EQ(h->push(buffer_of(events, 0)), GST_FLOW_OK);
  };
  push({3000});
  // Another segment with earlier times.
  push_segment(*h);
  for (int times = 0; times < 3; ++times) push({1000, 2000});
  EXPECT_FALSE(h->message(GST_MESSAGE_WARNING));
  push({2000, 4000, 5000});
  auto warning = h->message(GST_MESSAGE_WARNING);
  ASSERT_TRUE(warning);
  EXPECT_TRUE(text_of(warning.get()).starts_with("Left out 7 events earlier than"));
  // Further dropped events are reported once, at the end.
  push({1000, 2000, 4999});
  push({6000});
  EXPECT_FALSE(h->message(GST_MESSAGE_WARNING));
  gst_harness_push_event(h->get(), gst_event_new_eos());
  warning = h->message(GST_MESSAGE_WARNING);
  ASSERT_TRUE(warning);
  EXPECT_TRUE(text_of(warning.get()).starts_with("Left out 10 events in total earlier"));
  std::vector<Microseconds> written;
  for (const auto& event : events_in(format(), pull_bytes(*h))) written.push_back(event.t);
  EXPECT_EQ(written, (std::vector<Microseconds>{3000, 4000, 5000, 6000}));
}

TEST_P(EveryFormat, TellsOfEventsLeftOutWhereItIsStopped) {
  const auto h = writer_of(format());
  const auto late = AbsoluteEvent::at(5, 5, 1000, Polarity::on);
  const auto early = AbsoluteEvent::at(5, 5, 10, Polarity::on);
  EXPECT_EQ(h->push(buffer_of(std::span(&late, 1), 0)), GST_FLOW_OK);
  EXPECT_EQ(h->push(buffer_of(std::span(&early, 1), 0)), GST_FLOW_OK);
  EXPECT_FALSE(h->message(GST_MESSAGE_WARNING));
  gst_element_set_state(h->element(), GST_STATE_READY);
  const auto warning = h->message(GST_MESSAGE_WARNING);
  ASSERT_TRUE(warning);
  EXPECT_TRUE(text_of(warning.get()).starts_with("Left out 1 event earlier"));
}

TEST_P(EveryFormat, IsWrittenAnewAfterAFlush) {
  const auto h = writer_of(format());
  const auto late = AbsoluteEvent::at(5, 5, 1'000'000, Polarity::on);
  const auto early = AbsoluteEvent::at(6, 6, 1000, Polarity::off);
  for (const bool ended : {false, true}) {
    EXPECT_EQ(h->push(buffer_of(std::span(&late, 1), 1'000'000)), GST_FLOW_OK);
    if (ended) gst_harness_push_event(h->get(), gst_event_new_eos());
    pull_bytes(*h);
    gst_harness_push_event(h->get(), gst_event_new_flush_start());
    gst_harness_push_event(h->get(), gst_event_new_flush_stop(TRUE));
    push_segment(*h);
    while (h->message(GST_MESSAGE_WARNING)) continue;
  }
  EXPECT_EQ(h->push(buffer_of(std::span(&early, 1), 0)), GST_FLOW_OK);
  gst_harness_push_event(h->get(), gst_event_new_eos());
  while (const auto warning = h->message(GST_MESSAGE_WARNING))
    EXPECT_FALSE(text_of(warning.get()).starts_with("Left out"));
  EXPECT_EQ(events_in(format(), pull_bytes(*h)), std::vector{early});
}

TEST_P(EveryFormat, HoldsWhatComesAfterASeekAlone) {
  const auto events = some_events();
  const TemporaryFile in(file_of(format(), events));
  const TemporaryFile out("");
  Player player(in.path(), std::string(format().reader) + " ! tee name=t  t. ! queue ! " +
                               format().writer + " ! filesink location=" + in_quotes(out.path()) +
                               "  t. ! queue");
  ASSERT_TRUE(player.pause());
  ASSERT_TRUE(player.seek(3 * GST_SECOND));
  ASSERT_TRUE(player.ends_well());
  const std::vector after(std::ranges::find_if(events, [](auto e) { return e.t >= 5'000'000; }),
                          events.end());
  std::stringstream file;
  file << std::ifstream(out.path(), std::ios::binary).rdbuf();
  EXPECT_EQ(events_in(format(), file.str()), after);
}

TEST_P(EveryFormat, IsOfOneSize) {
  Harness h(format().writer);
  gst_harness_set_sink_caps_str(h.get(), format().caps);
  gst_harness_set_src_caps_str(h.get(), events_caps.c_str());
  const auto event = AbsoluteEvent::at(5, 5, 1000, Polarity::on);
  EXPECT_EQ(h.push(buffer_of(std::span(&event, 1), 0)), GST_FLOW_OK);
  gst_harness_set_src_caps_str(
      h.get(), "application/x-event-camera, format=XYTP, width=320, height=240, framerate=30/1");
  EXPECT_FALSE(h.message(GST_MESSAGE_ERROR));
  gst_harness_push_event(
      h.get(),
      gst_event_new_caps(
          Owned<GstCaps>(gst_caps_from_string("application/x-event-camera, format=XYTP, width=64, "
                                              "height=48, framerate=30/1"))
              .get()));
  EXPECT_TRUE(h.message(GST_MESSAGE_ERROR));
}

TEST_P(EveryFormat, HoldsALongPauseOrTellsThatItIsLeftOut) {
  // Longer than 32 bits of microseconds.
  const std::vector events = {AbsoluteEvent::at(5, 5, 1000, Polarity::on),
                              AbsoluteEvent::at(6, 6, 4'320'000'000, Polarity::off),
                              AbsoluteEvent::at(7, 7, 4'320'000'001, Polarity::off)};
  const auto h = writer_of(format());
  for (const auto& event : events)
    EXPECT_EQ(h->push(buffer_of(std::span(&event, 1), event.t / 10'000 * 10'000)), GST_FLOW_OK);
  gst_harness_push_event(h->get(), gst_event_new_eos());
  auto reader = Harness::with_late_pad(format().reader);
  begin_file(reader, format());
  push_file(reader, pull_bytes(*h), 1 << 20);
  if (format().name != std::string("dat")) {
    EXPECT_EQ(pull_events(reader), events);
    while (const auto warning = h->message(GST_MESSAGE_WARNING))
      EXPECT_FALSE(text_of(warning.get()).starts_with("Left out"));
    return;
  }
  const auto warning = h->message(GST_MESSAGE_WARNING);
  ASSERT_TRUE(warning);
  EXPECT_TRUE(text_of(warning.get()).starts_with("Left out a pause of 4319 s"));
  const auto read = pull_events(reader);
  ASSERT_EQ(read.size(), 3U);
  EXPECT_EQ(read[2].t, 1001);
}

TEST(EventDatEnc, TellsOfAllPausesThatAreLeftOut) {
  Harness h("eventdatenc");
  gst_harness_set_sink_caps_str(h.get(), "application/x-prophesee-dat");
  gst_harness_set_src_caps_str(h.get(), events_caps.c_str());
  for (const Microseconds hour : {0, 2, 7}) {
    const auto t = hour * 3'600'000'000 + 1000;
    const auto event = AbsoluteEvent::at(5, 5, t, Polarity::on);
    EXPECT_EQ(h.push(buffer_of(std::span(&event, 1), t)), GST_FLOW_OK);
  }
  gst_harness_push_event(h.get(), gst_event_new_eos());
  for (const char* text : {"Left out a pause of 7200 s", "Left out pauses of 25200 s in total"}) {
    const auto warning = h.message(GST_MESSAGE_WARNING);
    ASSERT_TRUE(warning);
    EXPECT_TRUE(text_of(warning.get()).starts_with(text)) << text_of(warning.get());
  }
  EXPECT_FALSE(h.message(GST_MESSAGE_WARNING));
}

TEST_P(EveryFormat, RefusesBuffersThatAreNoEvents) {
  Harness h(format().writer);
  gst_harness_set_sink_caps_str(h.get(), format().caps);
  gst_harness_set_src_caps_str(h.get(), events_caps.c_str());
  GstBuffer* buffer = bytes("seven b");
  GST_BUFFER_PTS(buffer) = 0;
  EXPECT_EQ(h.push(buffer), GST_FLOW_ERROR);
  EXPECT_TRUE(h.message(GST_MESSAGE_ERROR));
}

/// A client that joins late, as of tcpserversink, gets it from there.
TEST_P(EveryFormat, HasItsHeaderInTheCaps) {
  const auto events = some_events();
  Harness writer(format().writer);
  gst_harness_set_sink_caps_str(writer.get(), format().caps);
  gst_harness_set_src_caps_str(writer.get(), events_caps.c_str());
  const auto half = std::span(events).first(10'000);
  writer.push(buffer_of(half, 0));
  const auto begun = writer.pull();
  ASSERT_TRUE(begun);
  EXPECT_TRUE(GST_BUFFER_FLAG_IS_SET(begun.get(), GST_BUFFER_FLAG_HEADER));
  while (const auto buffer = writer.pull())
    EXPECT_FALSE(GST_BUFFER_FLAG_IS_SET(buffer.get(), GST_BUFFER_FLAG_HEADER));

  GstPad* const pad = gst_element_get_static_pad(writer.element(), "src");
  const Owned<GstCaps> caps(gst_pad_get_current_caps(pad));
  gst_object_unref(pad);
  const GValue* const headers =
      gst_structure_get_value(gst_caps_get_structure(caps.get(), 0), "streamheader");
  ASSERT_TRUE(headers != nullptr && GST_VALUE_HOLDS_ARRAY(headers));
  ASSERT_EQ(gst_value_array_get_size(headers), 1U);
  auto* const header = gst_value_get_buffer(gst_value_array_get_value(headers, 0));
  EXPECT_EQ(bytes_of(header), bytes_of(begun.get()));

  auto reader = Harness::with_late_pad(format().reader);
  begin_file(reader, format());
  reader.push(gst_buffer_copy_deep(header));
  writer.push(buffer_of(std::span(events).subspan(10'000), 6'000'000));
  while (const auto buffer = writer.pull()) reader.push(gst_buffer_ref(buffer.get()));
  gst_harness_push_event(reader.get(), gst_event_new_eos());
  const auto read = pull_events(reader);
  // EVT3 has to wait for the next row.
  const auto missed = 10'000 - read.size();
  ASSERT_LE(missed, format().name == std::string("evt3") ? 320U : 0U);
  for (std::size_t i = 0; i < read.size(); ++i) {
    const auto& event = events[10'000 + missed + i];
    ASSERT_TRUE(read[i].x == event.x && read[i].y_p == event.y_p) << i;
  }
}

/* EVT words without a header */

class EveryWord : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(, EveryWord, testing::Values("EVT2", "EVT21", "EVT3", "EVT4"));

std::string words_caps(const std::string& format) {
  return "application/x-event-camera, format=" + format + ", width=320, height=240, framerate=0/1";
}

TEST_P(EveryWord, KeepsTheTimesOfItsBuffers) {
  // Hours into the stream, beyond the range of the words' clocks.
  const GstClockTime late = 5 * 3600 * GST_SECOND;
  Harness writer("evtenc");
  gst_harness_set_sink_caps_str(writer.get(), words_caps(GetParam()).c_str());
  gst_harness_set_src_caps_str(writer.get(), events_caps.c_str());
  auto reader = Harness::with_late_pad("evtdec");
  gst_harness_set_src_caps_str(reader.get(), words_caps(GetParam()).c_str());
  std::vector<AbsoluteEvent> expected;
  std::vector<AbsoluteEvent> read;
  for (int i = 0; i < 20; ++i) {
    const auto start = static_cast<Microseconds>(late / GST_USECOND) + 10'000 * i;
    const std::vector events = {AbsoluteEvent::at(i, 7, start + 17, Polarity::on),
                                AbsoluteEvent::at(i, 9, start + 9'999, Polarity::off)};
    expected.insert(expected.end(), events.begin(), events.end());
    writer.push(buffer_of(events, start));
    const auto words = writer.pull();
    ASSERT_TRUE(words);
    EXPECT_EQ(GST_BUFFER_PTS(words.get()), static_cast<GstClockTime>(start) * GST_USECOND);
    reader.push(gst_buffer_ref(words.get()));
    while (const auto buffer = reader.pull()) append_events(buffer.get(), read);
    // Nothing is delayed by more than an interval.
    EXPECT_GE(read.size() + 4, expected.size());
  }
  gst_harness_push_event(reader.get(), gst_event_new_eos());
  while (const auto buffer = reader.pull()) append_events(buffer.get(), read);
  EXPECT_EQ(read, expected);
  EXPECT_EQ(gst_harness_query_latency(reader.get()), 10 * GST_MSECOND);
}

TEST_P(EveryWord, FollowsGapsAndFlushes) {
  Harness writer("evtenc");
  gst_harness_set_sink_caps_str(writer.get(), words_caps(GetParam()).c_str());
  gst_harness_set_src_caps_str(writer.get(), events_caps.c_str());
  auto reader = Harness::with_late_pad("evtdec");
  gst_harness_set_src_caps_str(reader.get(), words_caps(GetParam()).c_str());
  gst_harness_push_event(reader.get(), gst_event_new_gap(0, 10 * GST_MSECOND));
  EXPECT_TRUE(reader.pull_event(GST_EVENT_GAP));
  const auto event = AbsoluteEvent::at(3, 4, 12'000, Polarity::on);
  writer.push(buffer_of(std::span(&event, 1), 10'000));
  reader.push(writer.pull().release());
  gst_harness_push_event(reader.get(), gst_event_new_gap(20 * GST_MSECOND, 30 * GST_MSECOND));
  EXPECT_EQ(pull_events(reader), std::vector{event});
  EXPECT_TRUE(reader.pull_event(GST_EVENT_GAP));

  gst_harness_push_event(reader.get(), gst_event_new_flush_start());
  gst_harness_push_event(reader.get(), gst_event_new_flush_stop(TRUE));
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  gst_harness_push_event(reader.get(), gst_event_new_segment(&segment));
  const auto later = AbsoluteEvent::at(3, 4, 70'000, Polarity::on);
  writer.push(buffer_of(std::span(&later, 1), 70'000));
  GstBuffer* words = writer.pull().release();
  GST_BUFFER_PTS(words) = 5 * GST_MSECOND;
  reader.push(words);
  gst_harness_push_event(reader.get(), gst_event_new_eos());
  const auto moved = AbsoluteEvent::at(3, 4, 5'000, Polarity::on);
  EXPECT_EQ(pull_events(reader), std::vector{moved});
}

TEST_P(EveryWord, FillBuffersOfALimitedSize) {
  constexpr gsize max_size = 100;
  Harness writer("evtenc mtu=100");
  gst_harness_set_sink_caps_str(writer.get(), words_caps(GetParam()).c_str());
  gst_harness_set_src_caps_str(writer.get(), events_caps.c_str());
  auto reader = Harness::with_late_pad("evtdec");
  gst_harness_set_src_caps_str(reader.get(), words_caps(GetParam()).c_str());
  // Dense rows, isolated events, and a silence that may take words of its own.
  std::vector<AbsoluteEvent> expected;
  GstClockTime end = 7 * 3600 * GST_SECOND;
  for (int i = 0; i < 30; ++i) {
    const auto start = static_cast<Microseconds>(end / GST_USECOND);
    const Microseconds length = i == 15 ? 500'000 : 10'000;
    std::vector<AbsoluteEvent> events;
    for (int x = 0; x < 320; ++x)
      events.push_back(
          AbsoluteEvent::at(x, i, start + 17 + (i % 2 == 0 ? x / 40 : 20 * x), Polarity::on));
    events.push_back(AbsoluteEvent::at(i, 9, start + length - 1, Polarity::off));
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
  gst_harness_push_event(reader.get(), gst_event_new_eos());
  EXPECT_EQ(pull_events(reader), expected);
}

TEST(EvtEnc, PutsManyEventsIntoABufferOfALimitedSize) {
  std::vector<AbsoluteEvent> events;
  for (int i = 0; i < 10'000; ++i)
    events.push_back(AbsoluteEvent::at(i % 320, i / 320, i / 100, Polarity::on));
  for (const char* const limit : {"1400", "4294967295"}) {
    Harness writer(std::string("evtenc mtu=") + limit);
    gst_harness_set_sink_caps_str(writer.get(), words_caps("EVT2").c_str());
    gst_harness_set_src_caps_str(writer.get(), events_caps.c_str());
    writer.push(buffer_of(events, 0));
    const auto count = gst_harness_buffers_in_queue(writer.get());
    if (std::string_view(limit) == "1400")
      EXPECT_LE(count, 31U);  // 29 of them would be full
    else
      EXPECT_EQ(count, 1U);
  }
}

TEST(EvtDec, NeedsNoFramerateInCaps) {
  const auto file = file_of(formats[2], some_events());
  const TemporaryFile words(file.substr(file.find("% end\n") + 6));
  Player player(words.path(),
                "application/x-event-camera,format=EVT3,width=320,height=240 ! evtdec");
  EXPECT_TRUE(player.ends_well());
  EXPECT_EQ(player.events.size(), 20'000U);
}

TEST(EvtEnc, KeepsTriggers) {
  using eventcamera::Trigger;
  gst_init(nullptr, nullptr);
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
  const TemporaryFile in(std::string(bytes.begin(), bytes.end()));
  for (const char* between : {"", "identity ! "})
    for (const char* words : {"EVT2", "EVT21", "EVT3", "EVT4"}) {
      SCOPED_TRACE(std::string(words) + between);
      const TemporaryFile out("");
      const auto launch = "filesrc location=" + in_quotes(in.path()) + " ! " + between +
                          "evtdec ! queue ! evtenc format=" + words +
                          " ! filesink location=" + in_quotes(out.path());
      const Owned<GstElement> pipeline(gst_parse_launch(launch.c_str(), nullptr));
      const Owned<GstBus> bus(gst_element_get_bus(pipeline.get()));
      gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
      const Owned<GstMessage> message(gst_bus_timed_pop_filtered(
          bus.get(), 20 * GST_SECOND,
          static_cast<GstMessageType>(GST_MESSAGE_EOS | GST_MESSAGE_ERROR)));
      gst_element_set_state(pipeline.get(), GST_STATE_NULL);
      ASSERT_TRUE(message && GST_MESSAGE_TYPE(message.get()) == GST_MESSAGE_EOS);
      std::ifstream file(out.path(), std::ios::binary);
      const std::vector<std::uint8_t> written{std::istreambuf_iterator<char>(file),
                                              std::istreambuf_iterator<char>()};
      const auto decoder = eventcamera::make_prophesee_raw_decoder();
      eventcamera::Decoded decoded;
      decoder->decode(written, decoded);
      decoder->finish(decoded);
      EXPECT_EQ(decoded.triggers, triggers);
      EXPECT_EQ(decoded.events, events);
      EXPECT_EQ(decoder->corruption().places, 0U);
    }
}

/// A custom event may come from anywhere, with any content.
TEST_P(EveryFormat, SurvivesTriggersOfAnyKind) {
  const auto push = [](Harness& h, GstStructure* structure) {
    EXPECT_TRUE(gst_harness_push_event(
        h.get(), gst_event_new_custom(GST_EVENT_CUSTOM_DOWNSTREAM, structure)));
  };
  const auto push_records = [&](Harness& h, const char* name, const std::vector<gint64>& numbers,
                                gsize size) {
    GBytes* const records = g_bytes_new(numbers.data(), size);
    push(h, gst_structure_new(name, "records", G_TYPE_BYTES, records, nullptr));
    g_bytes_unref(records);
  };
  const auto& format = GetParam();
  const auto events = some_events();
  Harness h(format.writer);
  gst_harness_set_sink_caps_str(h.get(), format.caps);
  gst_harness_set_src_caps_str(h.get(), events_caps.c_str());
  for (const char* name : {"GstEventCameraTriggers", "GstEventCameraImu"}) {
    push(h, gst_structure_new_empty(name));
    push(h, gst_structure_new(name, "records", G_TYPE_STRING, "none", nullptr));
    push_records(h, name, {}, 0);
    push_records(h, name, {G_MININT64, -1, G_MAXINT64, -1, -1, -1, 0, 0, 7'000'000, 1}, 75);
  }
  EXPECT_EQ(h.push(buffer_of(std::span(events).first(100), 2'000'000)), GST_FLOW_OK);
  push_records(h, "GstEventCameraTriggers", {2'000'000, 1, 2'004'950, -1},
               32);  // the first is late
  EXPECT_TRUE(gst_harness_push_event(h.get(), gst_event_new_eos()));
  auto reader = Harness::with_late_pad(format.reader);
  begin_file(reader, format);
  push_file(reader, pull_bytes(h), 1 << 20);
  EXPECT_EQ(pull_events(reader), std::vector(events.begin(), events.begin() + 100));
  EXPECT_FALSE(reader.message(GST_MESSAGE_WARNING));
}

TEST(EvtEnc, TakesTheFormatThatDownstreamLeaves) {
  Harness h("evtenc format=EVT4");
  gst_harness_set_sink_caps_str(h.get(),
                                "application/x-event-camera, format=(string){ EVT2, EVT3, EVT4 }");
  gst_harness_set_src_caps_str(h.get(), events_caps.c_str());
  EXPECT_NE(h.out_caps().find("EVT4"), std::string::npos);
  EXPECT_NE(h.out_caps().find("width=(int)320"), std::string::npos);
}

TEST(EvtDec, AssumesASensorWhereTheFileTellsNone) {
  const auto file = file_of(formats[0], some_events());
  const auto words = file.substr(file.find("% end\n") + 6);
  const auto bare = "% evt 2.0\n% end\n" + words;
  const TemporaryFile temporary(bare);
  for (const std::string way : {"", "queue ! "}) {
    Player player(temporary.path(), way + "evtdec ! capsfilter name=filter");
    ASSERT_TRUE(player.pause());
    const Owned<GstElement> filter(gst_bin_get_by_name(GST_BIN(player.get()), "filter"));
    GstPad* pad = gst_element_get_static_pad(filter.get(), "src");
    const Owned<GstCaps> caps(gst_pad_get_current_caps(pad));
    gst_object_unref(pad);
    int found = 0;
    gst_structure_get_int(gst_caps_get_structure(caps.get(), 0), "height", &found);
    EXPECT_EQ(found, 320);
    Player told(temporary.path(), way + "evtdec ! application/x-event-camera,width=640,height=480");
    EXPECT_TRUE(told.ends_well());
    EXPECT_EQ(told.events.size(), 20'000U);
  }
}

TEST(EventEs, CountsRowsFromWhereItIsTold) {
  const auto events = some_events();
  auto flipped = events;
  for (auto& event : flipped)
    event = AbsoluteEvent::at(event.x, height - 1 - event.y(), event.t, event.polarity());
  const Format top_left = {"es", "eventesenc origin=top-left", "eventesdec origin=top-left",
                           "application/x-es"};
  const Format bottom_left = {"es", "eventesenc", "eventesdec", "application/x-es"};
  const auto file = file_of(top_left, events);
  EXPECT_EQ(events_in(top_left, file), events);
  EXPECT_EQ(events_in(bottom_left, file), flipped);
}

/* sensors whose size the file does not tell */

const Format& npy = *std::ranges::find(formats, std::string("npy"), &Format::name);

/// Moves out of what its beginning fits into.
std::vector<AbsoluteEvent> growing_events() {
  std::vector<AbsoluteEvent> events;
  for (int i = 0; i < 3000; ++i)
    events.push_back(AbsoluteEvent::at(i / 10, i / 15, Microseconds{1000} * i, Polarity::on));
  return events;
}

TEST(EventNpyDec, ChangesCapsWhereEventsLieOutsideTheAssumedSensor) {
  const auto events = growing_events();
  auto h = Harness::with_late_pad("eventnpydec");
  begin_file(h, npy);
  push_file(h, file_of(npy, events), 500);
  EXPECT_EQ(pull_events(h), events);
  EXPECT_FALSE(h.message(GST_MESSAGE_WARNING));
  std::vector<int> widths;
  while (const auto event = h.pull_event(GST_EVENT_CAPS)) {
    GstCaps* caps = nullptr;
    gst_event_parse_caps(event.get(), &caps);
    widths.emplace_back();
    gst_structure_get_int(gst_caps_get_structure(caps, 0), "width", &widths.back());
  }
  EXPECT_EQ(widths, (std::vector{128, 240, 304}));
}

TEST(TableReaders, TakeTheSizeOfTheirProperties) {
  const Format csv{"csv", "eventcsvenc format=names", "eventcsvdec", "application/x-event-csv"};
  const auto events = growing_events();
  for (const auto& format : {npy, csv}) {
    SCOPED_TRACE(format.name);
    const TemporaryFile file(file_of(format, events));
    const std::string reader = format.reader;
    for (const std::string way : {"", "queue ! "}) {
      // They come before what downstream allows, and a file has one size.
      Player written(file.path(), way + reader + " width=320 height=240 ! evtenc ! evtdec");
      EXPECT_TRUE(written.ends_well());
      EXPECT_EQ(written.events, events);
      Player cut(file.path(), way + reader + " width=100 height=100");
      EXPECT_TRUE(cut.ends_well());
      EXPECT_EQ(cut.events.size(), 1000U);
    }
    Player grown(file.path(), "queue ! " + reader + " ! evtenc ! evtdec");
    const auto message = grown.play();
    ASSERT_TRUE(message);
    ASSERT_EQ(GST_MESSAGE_TYPE(message.get()), GST_MESSAGE_ERROR);
    EXPECT_NE(text_of(message.get()).find("width and height"), std::string::npos);
  }
}

TEST(EvtDec, LeavesOutEventsOutsideTheSensor) {
  auto file = file_of(formats[0], some_events());
  const std::string_view size = "height=240;width=320";
  file.replace(file.find(size), size.size(), "height=240;width=160");
  auto h = Harness::with_late_pad("evtdec");
  begin_file(h, formats[0]);
  push_file(h, file, 1000);
  EXPECT_EQ(pull_events(h).size(), 10'080U);
  const auto message = h.message(GST_MESSAGE_WARNING);
  ASSERT_TRUE(message);
  EXPECT_NE(text_of(message.get()).find("9920 events outside the sensor"), std::string::npos);
}

TEST(EventCsvDec, TakesTimesInTheUnitThatIsFoundOrSet) {
  const Format esim = {"esim", "eventcsvenc format=esim", "eventcsvdec", "application/x-event-csv"};
  const auto file = file_of(esim, some_events());
  for (const char* const reader : {"eventcsvdec", "eventcsvdec time-unit=nanoseconds"}) {
    auto h = Harness::with_late_pad(reader);
    begin_file(h, esim);
    push_file(h, file, 1000);
    EXPECT_EQ(pull_events(h), some_events()) << reader;
  }

  const TemporaryFile unclear("1000 2 3 1\n2000 4 5 0\n3000 6 7 1\n");
  Player refused(unclear.path(), "eventcsvdec");
  const auto message = refused.play();
  ASSERT_TRUE(message);
  ASSERT_EQ(GST_MESSAGE_TYPE(message.get()), GST_MESSAGE_ERROR);
  EXPECT_NE(text_of(message.get()).find("set time-unit"), std::string::npos);
  Player set(unclear.path(), "eventcsvdec time-unit=nanoseconds");
  EXPECT_TRUE(set.ends_well());
  EXPECT_EQ(set.events, (std::vector<AbsoluteEvent>{AbsoluteEvent::at(2, 3, 1, Polarity::on),
                                                    AbsoluteEvent::at(4, 5, 2, Polarity::off),
                                                    AbsoluteEvent::at(6, 7, 3, Polarity::on)}));
}

TEST(EventCsvDec, TakesColumnsInTheOrderThatIsSet) {
  const TemporaryFile file("1,3,2,5\n0,5,4,7\n");
  Player player(file.path(), "eventcsvdec column-order=pyxt");
  EXPECT_TRUE(player.ends_well());
  EXPECT_EQ(player.events, (std::vector<AbsoluteEvent>{AbsoluteEvent::at(2, 3, 5, Polarity::on),
                                                       AbsoluteEvent::at(4, 5, 7, Polarity::off)}));
  Player wrong(file.path(), "eventcsvdec column-order=pyxx");
  const auto message = wrong.play();
  ASSERT_TRUE(message);
  EXPECT_NE(text_of(message.get()).find("column-order \"pyxx\" must have"), std::string::npos);
}

}  // namespace
