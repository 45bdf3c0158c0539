// SPDX-License-Identifier: LGPL-2.1-or-later
// aedatdemux gives the events and frames of AEDAT files as they were recorded.
#include <map>

#include "tests/elements/aedat_player.hpp"
#include "tests/elements/aedat_recordings.hpp"
#include "tests/formats/recordings.hpp"
#include "tests/formats/shared_data.hpp"

namespace {

using namespace harness;
using namespace aedat_recordings;

TEST(AedatDemux, Aedat2WithoutACameraHasTheSizeThatIsAskedFor) {
  recordings::Random random(3);
  constexpr SensorSize davis240{240, 180};
  const auto events = recordings::random_events(random, davis240, 20'000, 200'000);
  const TemporaryFile file(aedat_files::aedat2_v2e(events, davis240));
  for (const std::string between : {"", "identity ! "}) {
    SCOPED_TRACE(between);
    Player assumed(file.source() + between + "aedatdemux");
    EXPECT_TRUE(assumed.play()) << assumed.error;
    EXPECT_TRUE(assumed.events == events);
    ASSERT_EQ(assumed.warnings.size(), 1U);
    EXPECT_NE(assumed.warnings.front().find("assuming 240 x 180 pixels"), std::string::npos);

    auto moved = events;  // by what a DAVIS346 has more of
    for (auto& e : moved) e = AbsoluteEvent::at(e.x + 106, e.y() + 80, e.t, e.polarity());
    for (const char* way : {"aedatdemux width=346 height=260",
                            "aedatdemux ! application/x-event-camera,width=346,height=260"}) {
      Player asked(file.source() + between + way);
      EXPECT_TRUE(asked.play()) << way << ": " << asked.error;
      EXPECT_TRUE(asked.events == moved) << way;
      EXPECT_TRUE(asked.warnings.empty());
    }
  }

  const auto few = recordings::random_events(random, {128, 128}, 20'000, 200'000);
  const TemporaryFile of_matlab(aedat_files::aedat2_of_matlab(few));
  Player dvs128(of_matlab.source() +
                "aedatdemux ! application/x-event-camera,width=128,height=128");
  EXPECT_TRUE(dvs128.play()) << dvs128.error;
  EXPECT_TRUE(dvs128.events == few);
  EXPECT_TRUE(dvs128.warnings.empty());
}

TEST(AedatDemux, PutsFramesInSyncWithEvents) {
  const struct {
    PixelFormat format;
    const char* name;
    std::size_t size;
  } formats[] = {{PixelFormat::grey8, "GRAY8", 8 * 3},
                 {PixelFormat::grey16, "GRAY16_LE", 12 * 3},
                 {PixelFormat::bgr, "BGR", 16 * 3},
                 {PixelFormat::bgra, "BGRA", 20 * 3}};
  const auto events = steady_events(2'000'000, 1'000, of_1970);
  for (const auto& [format, name, size] : formats) {
    const TemporaryFile file(aedat4_with_frames(events, format, 50));
    AedatPlayer player(file.source());
    ASSERT_TRUE(player.play()) << player.error;
    const auto video = player.track("video_0");
    EXPECT_NE(video.caps.find("format=(string)" + std::string(name)), std::string::npos);
    EXPECT_NE(video.caps.find("width=(int)5, height=(int)3"), std::string::npos) << video.caps;
    ASSERT_EQ(video.pictures.size(), 50U);
    for (std::size_t i = 0; i < 50; ++i) {
      EXPECT_EQ(video.pictures[i].pts, (of_1970 - 3'000) * GST_USECOND + i * 40 * GST_MSECOND);
      ASSERT_EQ(video.pictures[i].bytes.size(), size);
      EXPECT_EQ(video.pictures[i].bytes.front(), static_cast<char>(i));
    }
    EXPECT_TRUE(player.track("events_0").events == events);
    EXPECT_EQ(gst_segment_to_running_time(&video.segment, GST_FORMAT_TIME, video.pictures[1].pts),
              40 * GST_MSECOND);
    EXPECT_EQ(player.duration(), 2'002'001 * GST_USECOND);
  }
}

TEST(AedatDemux, ReadsTheRecordingOfADavis) {
  const auto bytes = shared_data::events_file(davis);
  if (bytes.empty()) GTEST_SKIP() << "no shared data";
  const TemporaryFile file(bytes);
  for (const char* between : {"", "identity ! "}) {
    AedatPlayer player(file.source() + between);
    ASSERT_TRUE(player.play()) << player.error;
    const auto track = player.track("events_0");
    EXPECT_EQ(track.events.size(), 117'667U);
    EXPECT_EQ(std::count_if(track.events.begin(), track.events.end(),
                            [](const auto& e) { return e.polarity() == Polarity::on; }),
              72'363);
    const auto start = track.segment.start;
    EXPECT_EQ(static_cast<GstClockTime>(track.events.front().t) * GST_USECOND, start);
    const auto pictures = player.track("video_0").pictures;
    ASSERT_EQ(pictures.size(), 3U);
    EXPECT_EQ(pictures[1].pts - pictures[0].pts, 40 * GST_MSECOND);
    EXPECT_EQ(pictures[2].pts - pictures[1].pts, 40 * GST_MSECOND);
    EXPECT_LT(pictures[0].pts, start + 40 * GST_MSECOND);
    EXPECT_EQ(player.stat("imu-samples"), 130U);
    EXPECT_EQ(player.stat("triggers"), 15U);
    EXPECT_EQ(player.stat("corrupt-places"), 0U);
  }
}

TEST(AedatDemux, TellsOfSilenceInFewWords) {
  Events events = steady_events(20'000, 100);
  const auto later = steady_events(20'000, 100, 3'600'000'000);
  events.insert(events.end(), later.begin(), later.end());
  const TemporaryFile file(aedat4_file(events));
  AedatPlayer player(file.source());
  ASSERT_TRUE(player.play()) << player.error;
  const auto track = player.track("events_0");
  EXPECT_TRUE(track.events == events);
  EXPECT_LE(track.buffers + track.gaps, 8U);
  EXPECT_GE(track.gaps, 1U);
}

/// Frames continue after the end of events, and events after the end of frames.
TEST(AedatDemux, KeepsSilentStreamsGoing) {
  const auto few = steady_events(10'000, 100);
  const TemporaryFile frames(aedat4_with_frames(few, PixelFormat::grey8, 250));
  AedatPlayer player(frames.source());
  ASSERT_TRUE(player.play()) << player.error;
  EXPECT_GE(player.track("events_0").end, 9 * GST_SECOND);
  const TemporaryFile events(
      aedat4_with_frames(steady_events(10'000'000, 1'000), PixelFormat::grey8, 2));
  AedatPlayer other(events.source());
  ASSERT_TRUE(other.play()) << other.error;
  EXPECT_GE(other.track("video_0").end, 9 * GST_SECOND);
  EXPECT_LE(other.track("video_0").gaps, 40U);
}

TEST(AedatDemux, ReadsStreamsThatAreWrittenOneAfterTheOther) {
  const auto first = steady_events(5'000'000, 1'000);
  const auto second = shifted(steady_events(5'000'000, 1'300), 5);
  const TemporaryFile file(aedat4_of_two_streams(first, second));
  for (const char* between : {"", "identity ! "}) {
    Pipeline pipeline(
        file.source() + between +
        "aedatdemux name=d  d.events_0 ! queue ! fakesink name=a signal-handoffs=true "
        " d.events_1 ! queue ! fakesink name=b signal-handoffs=true");
    std::map<std::string, Events> events;
    for (const char* name : {"a", "b"})
      g_signal_connect(pipeline[name], "handoff",
                       G_CALLBACK(+[](GstElement*, GstBuffer* buffer, GstPad*, Events* of_sink) {
                         append_events(buffer, *of_sink);
                       }),
                       &events[name]);
    ASSERT_TRUE(pipeline.play()) << pipeline.error;
    EXPECT_TRUE(pipeline.warnings.empty()) << pipeline.warnings.front();
    EXPECT_TRUE(events["a"] == first) << events["a"].size();
    EXPECT_TRUE(events["b"] == second) << events["b"].size();
  }
}

TEST(AedatDemux, SeeksWhilePlayingAgainAndAgain) {
  const auto events = steady_events(10'000'000, 100);
  const TemporaryFile file(aedat4_with_frames(events, PixelFormat::bgr, 250));
  AedatPlayer player(file.source());
  player.preroll();
  ASSERT_TRUE(player.seek(GST_SECOND));
  EXPECT_EQ(player.flushes, 2) << "the bin sends a seek to both sinks; it is done once";
  player.set(GST_STATE_PLAYING);
  recordings::Random random(3);
  for (int i = 0; i < 60; ++i) {
    ASSERT_TRUE(
        player.seek(static_cast<GstClockTime>(recordings::below(random, 9'000)) * GST_MSECOND));
    if (i % 4 == 0) g_usleep(1000);
  }
  ASSERT_TRUE(player.seek(8 * GST_SECOND));
  while (player.track("events_0").eos == 0 || player.track("video_0").eos == 0)
    ASSERT_TRUE(player.wait()) << player.error;
  EXPECT_TRUE(player.track("events_0").events == from(shifted(events, 3'000), 8'000'000));
  EXPECT_EQ(player.track("video_0").pictures.size(), 50U);
}

}  // namespace
