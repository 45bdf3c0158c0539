// SPDX-License-Identifier: LGPL-2.1-or-later
// Event files of every format are read as they were written, however they come; what files do not
// state; and files that are corrupt, empty or of another format.
#include <gst/base/gsttypefindhelper.h>

#include <stdexcept>
#include <tuple>

#include "tests/elements/event_files.hpp"

namespace {

using namespace harness;
using namespace event_files;

INSTANTIATE_TEST_SUITE_P(, EveryFormat, testing::ValuesIn(formats), name_of);

TEST_P(EveryFormat, IsReadAsItWasWrittenHoweverItIsSplit) {
  const auto events = some_events();
  const auto file = file_of(format(), events);
  for (const std::size_t piece : {1UL, 1000UL, 1UL << 24}) {
    Reader h(format());
    h.read(file, piece);
    EXPECT_EQ(pull_events(h), events);
    if (format().tells_size) {
      EXPECT_EQ(h.out_caps(),
                "application/x-event-camera, format=(string)XYTP, width=(int)320, height=(int)240, "
                "framerate=(fraction)0/1");
    }
    EXPECT_EQ(h.warning_or_error(), "");
    EXPECT_TRUE(h.pull_event(GST_EVENT_EOS));
  }
}

TEST_P(EveryFormat, BeginsAtTheFirstEventAndTellsSilence) {
  Reader h(format());
  h.read(file_of(format(), some_events()), 5000);
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
  Reader h(format(), " buffer-duration=100000000");
  h.read(file_of(format(), some_events()), 5000);
  int buffers = 0;
  while (h.pull()) ++buffers;
  EXPECT_EQ(buffers, 10);
}

TEST_P(EveryFormat, TellsItsDurationOncePushed) {
  const TemporaryFile file(file_of(format(), some_events()));
  Player player(file.source() + "queue ! " + format().reader);
  ASSERT_TRUE(player.reaches(GST_STATE_PAUSED));
  if (format().is_archive) {
    EXPECT_EQ(player.duration(), GST_CLOCK_TIME_NONE);
  }
  ASSERT_TRUE(player.play()) << player.error;
  EXPECT_EQ(player.duration(), 3'999'951 * GST_USECOND);
}

TEST(Typefinders, LookAtAllOfAShortFile) {
  gst_init(nullptr, nullptr);
  // Three lines are needed; the largest power of two has but two.
  const std::string text =
      "1700000000.000001,100,100,1\n1700000000.000002,100,100,0\n1700000000.000003,100,100,1\n";
  const Owned<GstCaps> caps(gst_type_find_helper_for_data(
      nullptr, reinterpret_cast<const guint8*>(text.data()), text.size(), nullptr));
  ASSERT_TRUE(caps);
  EXPECT_STREQ(gst_structure_get_name(gst_caps_get_structure(caps.get(), 0)),
               "application/x-event-csv");
}

TEST_P(EveryFormat, IsEmptyWhereThereAreNoEvents) {
  const auto file = file_of(format(), {});
  EXPECT_FALSE(file.empty());
  Reader h(format());
  h.read(file, 5);
  EXPECT_FALSE(h.pull());
  EXPECT_TRUE(contains(h.out_caps(), format().tells_size ? "width=(int)320" : "width=(int)128"));
  EXPECT_TRUE(h.pull_event(GST_EVENT_SEGMENT));
  EXPECT_TRUE(h.pull_event(GST_EVENT_EOS));
  EXPECT_EQ(h.warning(), "The file has no events.");
  EXPECT_EQ(h.error(), "");
}

TEST_P(EveryFormat, EndsEachOfTwoFilesInItsOwnStream) {
  const auto events = some_events();
  const TemporaryFile file(file_of(format(), events));
  Player player(file.source() + "queue ! c.  " + file.source() + "concat name=c ! " +
                format().reader);
  std::vector<std::size_t> starts;
  watch(GST_BASE_SINK_PAD(player["sink"]), {[](GstBuffer*) {},
                                            [&](GstEvent* event) {
                                              if (GST_EVENT_TYPE(event) == GST_EVENT_STREAM_START)
                                                starts.push_back(player.events.size());
                                            }});
  ASSERT_TRUE(player.play()) << player.error;
  EXPECT_EQ(player.events.size(), 2 * events.size());
  EXPECT_EQ(starts, (std::vector<std::size_t>{0, events.size()}));
}

TEST_P(EveryFormat, BeginsAnewAfterAFlush) {
  const auto events = some_events();
  const auto file = file_of(format(), events);
  Reader h(format());
  h.push_bytes(file.substr(0, file.size() / 2));
  pull_events(h);
  flush({h.get()});
  push_segment(h.get(), {.format = GST_FORMAT_BYTES});
  h.read(file, 10'000);
  EXPECT_EQ(pull_events(h), events);
  EXPECT_EQ(h.warning(), "");
}

/// Subtitles and letters have the extensions of text files, too.
TEST(Typefinders, DoNotKnowTextByItsExtension) {
  gst_init(nullptr, nullptr);
  const auto has_extensions = [](const char* typefinder) {
    GstPluginFeature* const feature =
        gst_registry_find_feature(gst_registry_get(), typefinder, GST_TYPE_TYPE_FIND_FACTORY);
    if (feature == nullptr) throw std::runtime_error(typefinder);
    const bool has =
        gst_type_find_factory_get_extensions(GST_TYPE_FIND_FACTORY(feature)) != nullptr;
    gst_object_unref(feature);
    return has;
  };
  EXPECT_TRUE(has_extensions("application/x-npy"));
  EXPECT_FALSE(has_extensions("application/x-event-csv"));
}

/* what files do not state */

TEST(EvtDec, AssumesASensorWhereTheFileTellsNone) {
  const auto file = file_of(format_of("evt2"), some_events());
  const auto words = file.substr(file.find("% end\n") + 6);
  const auto bare = "% evt 2.0\n% end\n" + words;
  const TemporaryFile temporary(bare);
  for (const std::string way : {"", "queue ! "}) {
    Player player(temporary.source() + way + "evtdec ! capsfilter name=filter");
    ASSERT_TRUE(player.reaches(GST_STATE_PAUSED));
    const auto pad = static_pad(player["filter"], "src");
    EXPECT_TRUE(
        contains(text_of(Owned<GstCaps>(gst_pad_get_current_caps(pad.get()))), "height=(int)320"));
    Player told(temporary.source() + way +
                "evtdec ! application/x-event-camera,width=640,height=480");
    EXPECT_TRUE(told.play()) << told.error;
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
  const auto file = file_of(top_left, events);
  EXPECT_EQ(events_in(top_left, file), events);
  EXPECT_EQ(events_in(format_of("es"), file), flipped);
}

/// Leaves the sensor that fits its beginning.
Events growing_events() {
  Events events;
  for (int i = 0; i < 3000; ++i) events.push_back(on_at(i / 10, i / 15, Microseconds{1000} * i));
  return events;
}

TEST(EventNpyDec, ChangesCapsWhereEventsLieOutsideTheAssumedSensor) {
  const auto events = growing_events();
  Reader h(format_of("npy"));
  h.read(file_of(format_of("npy"), events), 500);
  EXPECT_EQ(pull_events(h), events);
  EXPECT_EQ(h.warning(), "");
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
  for (const auto& format : {format_of("npy"), csv}) {
    SCOPED_TRACE(format.name);
    const TemporaryFile file(file_of(format, events));
    for (const std::string way : {"", "queue ! "}) {
      // They come before what downstream allows, and a file has one size.
      Player written(file.source() + way + format.reader +
                     " width=320 height=240 ! evtenc ! evtdec");
      EXPECT_TRUE(written.play()) << written.error;
      EXPECT_EQ(written.events, events);
      Player cut(file.source() + way + format.reader + " width=100 height=100");
      EXPECT_TRUE(cut.play()) << cut.error;
      EXPECT_EQ(cut.events.size(), 1000U);
    }
    Player grown(file.source() + "queue ! " + format.reader + " ! evtenc ! evtdec");
    EXPECT_FALSE(grown.play());
    EXPECT_TRUE(contains(grown.error, "width and height"));
  }
}

TEST(EvtDec, LeavesOutEventsOutsideTheSensor) {
  auto file = file_of(format_of("evt2"), some_events());
  const std::string_view size = "height=240;width=320";
  file.replace(file.find(size), size.size(), "height=240;width=160");
  Reader h(format_of("evt2"));
  h.read(file);
  EXPECT_EQ(pull_events(h).size(), 10'080U);
  EXPECT_TRUE(contains(h.warning(), "9920 events outside the sensor"));
  EXPECT_EQ(stat_of(h.element(), "outside-events"), 9920U);
  EXPECT_EQ(stat_of(h.element(), "late-items") + stat_of(h.element(), "stray-items"), 0U);
}

TEST(EventCsvDec, TakesTimesInTheUnitThatIsFoundOrSet) {
  const Format esim = {"esim", "eventcsvenc format=esim", "eventcsvdec", "application/x-event-csv"};
  const auto file = file_of(esim, some_events());
  for (const char* const properties : {"", " time-unit=nanoseconds"}) {
    Reader h(esim, properties);
    h.read(file);
    EXPECT_EQ(pull_events(h), some_events()) << properties;
  }

  const TemporaryFile unclear(std::string("1000 2 3 1\n2000 4 5 0\n3000 6 7 1\n"));
  Player refused(unclear.source() + "eventcsvdec");
  EXPECT_FALSE(refused.play());
  EXPECT_TRUE(contains(refused.error, "set time-unit"));
  Player set(unclear.source() + "eventcsvdec time-unit=nanoseconds");
  EXPECT_TRUE(set.play()) << set.error;
  EXPECT_EQ(set.events, (Events{on_at(2, 3, 1), off_at(4, 5, 2), on_at(6, 7, 3)}));
}

/* corrupt files */

/// A format that is read up to where a file is truncated.
class EveryStream : public EveryFormat {};

INSTANTIATE_TEST_SUITE_P(, EveryStream, testing::ValuesIn(stream_formats()), name_of);

TEST_P(EveryFormat, SaysWhenItIsUnsupportedFormat) {
  for (const auto& file : {std::string("a,b\n"), std::string("no events at all, but words\n"),
                           std::string(100'000, '\0')}) {
    Reader h(format());
    h.read(file, 4000);
    EXPECT_TRUE(h.error().starts_with("Cannot read this file: "));
    EXPECT_EQ(h.error(), "");

    const TemporaryFile temporary(file);
    Player player(temporary.source() + format().reader);
    EXPECT_FALSE(player.play());
    EXPECT_TRUE(player.error.starts_with("Cannot read this file: ")) << player.error;
  }
}

TEST_P(EveryFormat, IsNoFileWithoutAByte) {
  const bool is_text = format().name == "csv";  // without events, it may have no byte
  const TemporaryFile file;
  for (const std::string way : {"", "queue ! "}) {
    Player player(file.source() + way + format().reader);
    EXPECT_EQ(player.play(), is_text);
    EXPECT_EQ(player.error.starts_with("Cannot read this file: "), !is_text) << way << player.error;
  }
}

TEST_P(EveryStream, WarnsOnceOfCorruptionAndTellsWhere) {
  const auto events = some_events();
  auto file = file_of(format(), events);
  if (format().end.empty())
    file.pop_back();
  else
    file += format().end;
  Reader h(format());
  h.read(file, 5000);
  const auto text = h.warning();
  const auto found = text.find("data at byte ");
  ASSERT_NE(found, std::string::npos) << text;
  const auto position = std::stoul(text.substr(found + 13));
  EXPECT_LT(position, file.size());
  EXPECT_GE(position + 13, file.size());  // size of the longest event
  EXPECT_EQ(h.warning_or_error(), "");
  // Nearly all events were intact.
  const auto read = pull_events(h);
  ASSERT_GT(read.size(), events.size() - 40);
  EXPECT_TRUE(std::equal(read.begin(), read.end(), events.begin()));
  EXPECT_EQ(stat_of(h.element(), "corrupt-places"), 1U);
}

TEST(EventNpzDec, SaysWhenAnArchiveIsTruncated) {
  const auto file = file_of(format_of("npz"), some_events());
  for (const std::size_t size : {1UL, file.size() / 2, file.size() - 1}) {
    Reader h(format_of("npz"));
    h.read(file.substr(0, size));
    EXPECT_TRUE(h.error().starts_with("Cannot read this file: "));
    EXPECT_TRUE(pull_events(h).empty());
  }
}

TEST(FileReaders, QuoteTheBytesOfAFileInUtf8) {
  const std::string raw = "% format EVT\xff;width=2;height=2\n% end\n";
  const std::string order = "% format EVT21;endianness=\xfe;width=2;height=2\n% end\n";
  const std::string version = "#!AER-DAT\xff.0\r\n";
  const std::string camera = "#!AER-DAT2.0\r\n# AEChip: \xff\r\n#End Of ASCII Header\r\n";
  for (const auto& [file, reader, caps] :
       {std::tuple{raw, "evtdec", "application/x-prophesee-raw"},
        {order, "evtdec", "application/x-prophesee-raw"},
        {version, "aedatdemux", "application/x-aedat, version=2"},
        {camera, "aedatdemux", "application/x-aedat, version=2"}}) {
    Reader h(reader, caps);
    push_segment(h.get(), {.format = GST_FORMAT_BYTES});
    h.read(file);
    const auto text = h.error();
    EXPECT_TRUE(contains(text, "\xEF\xBF\xBD"));
    EXPECT_TRUE(g_utf8_validate(text.data(), static_cast<gssize>(text.size()), nullptr)) << text;
  }
}

/// Lines of a log: their level and text.
using Log = std::vector<std::pair<GstDebugLevel, std::string>>;

void take_line(GstDebugCategory* category, GstDebugLevel level, const gchar*, const gchar*, gint,
               GObject*, GstDebugMessage* message, gpointer log) {
  const std::string text = gst_debug_message_get(message);
  if (gst_debug_category_get_name(category) == std::string_view("eventreader") &&
      text.find("Corrupt data at byte") != text.npos)
    static_cast<Log*>(log)->emplace_back(level, text);
}

/// The first place is a warning.
TEST(FileReaders, LogEachPlaceThatIsCorrupt) {
  gst_init(nullptr, nullptr);
  std::string table = "t,x,y,p\n";
  std::vector<std::size_t> corrupt;
  for (int t = 0; t < 15'000; ++t) {
    if (t % 5000 == 1) corrupt.push_back(table.size());
    table += t % 5000 == 1 ? "?\n" : std::to_string(20 * t) + ",1,1,1\n";
  }
  const TemporaryFile file(table);
  Log log;
  gst_debug_set_threshold_for_name("eventreader", GST_LEVEL_LOG);
  gst_debug_remove_log_function(gst_debug_log_default);
  gst_debug_add_log_function(take_line, &log, nullptr);
  {
    Pipeline pipeline(file.source() + "queue ! eventcsvdec width=8 height=8 ! fakesink");
    EXPECT_TRUE(pipeline.play()) << pipeline.error;
  }
  gst_debug_remove_log_function_by_data(&log);
  gst_debug_unset_threshold_for_name("eventreader");
  ASSERT_EQ(log.size(), corrupt.size());
  for (std::size_t i = 0; i < log.size(); ++i) {
    EXPECT_EQ(log[i].first, i == 0 ? GST_LEVEL_WARNING : GST_LEVEL_LOG);
    EXPECT_TRUE(contains(log[i].second, "the last at byte " + std::to_string(corrupt[i])));
  }
}

}  // namespace
