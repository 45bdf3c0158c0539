// SPDX-License-Identifier: LGPL-2.1-or-later
// Event files of every format are read as they were written, however they come.
#include <gst/base/gsttypefindhelper.h>

#include <stdexcept>

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
    EXPECT_EQ(h.warning() + h.error(), "");
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

}  // namespace
