// SPDX-License-Identifier: LGPL-2.1-or-later
// What files do not state: sensor sizes, units, columns and the place of row 0.
#include "tests/elements/event_files.hpp"

namespace {

using namespace harness;
using namespace event_files;

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

}  // namespace
