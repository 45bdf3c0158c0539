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

TEST(AedatDemux, HandsOutTheEventsOfEveryVersion) {
  recordings::Random random(7);
  auto made = recordings::random_events(random, sensor, 30'000, 200'000);
  const auto first = made.front().t;
  std::map<std::string, Bytes> files;
  for (const int compression : {0, 1, 2, 3, 4})
    files["4, compression " + std::to_string(compression)] =
        aedat4_file(made, static_cast<Aedat4Compression>(compression));
  files["4, without a table"] = aedat4_file(made, Aedat4Compression::lz4, false);
  files["4, of today"] = aedat4_file(shifted(made, of_1970));
  files["3"] = aedat_files::aedat3(made, "DAVIS346", 1000);
  files["3, camera unknown"] = aedat_files::aedat3(made, "a camera", 1000);
  files["2"] = aedat_files::aedat2_davis(made, sensor, "eu.seebetter.DAVIS346");
  for (const auto& [name, bytes] : files) {
    const TemporaryFile file(bytes);
    for (const char* between : {"", "identity ! "}) {
      SCOPED_TRACE(name + ", " + between);
      AedatPlayer player(file.source() + between);
      ASSERT_TRUE(player.play()) << player.error;
      EXPECT_TRUE(player.warnings.empty()) << player.warnings.front();
      EXPECT_EQ(player.pads(), 1U);
      EXPECT_EQ(player.no_more_pads, 1);
      const auto track = player.track("events_0");
      const bool of_today = name == "4, of today";
      const auto expected = shifted(made, of_today ? of_1970 : 0);
      EXPECT_EQ(track.segment.start,
                static_cast<GstClockTime>(first + (of_today ? of_1970 : 0)) * GST_USECOND);
      EXPECT_EQ(track.segment.time, 0U);
      EXPECT_EQ(track.caps,
                "application/x-event-camera, format=(string)XYTP, width=(int)346, "
                "height=(int)260, framerate=(fraction)0/1");
      EXPECT_TRUE(track.events == expected) << track.events.size() << " of " << expected.size();
      EXPECT_EQ(track.eos, 1U);
      EXPECT_EQ(player.stat("events"), expected.size());
      for (const char* const dropped : {"outside-events", "late-items", "stray-items"})
        EXPECT_EQ(player.stat(dropped), 0U);
    }
  }
}

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

TEST(AedatDemux, PiecesOfAnySizeChangeNothing) {
  const auto events = steady_events(300'000, 100);
  const TemporaryFile file(aedat4_with_frames(events, PixelFormat::grey8, 7));
  for (const int size : {1, 7, 100, 4096}) {
    AedatPlayer player("filesrc blocksize=" + std::to_string(size) +
                       " location=" + in_quotes(file.path()) + " ! identity ! ");
    ASSERT_TRUE(player.play()) << player.error;
    EXPECT_TRUE(shifted(player.track("events_0").events, -3'000) == events) << size;
    EXPECT_EQ(player.track("video_0").pictures.size(), 7U) << size;
  }
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

TEST(AedatDemux, PlaysAgainAfterAStop) {
  const auto events = steady_events(500'000, 100);
  const TemporaryFile file(aedat4_with_frames(events, PixelFormat::grey8, 10));
  for (const char* between : {"", "identity ! "}) {
    AedatPlayer player(file.source() + between);
    for (int times = 0; times < 3; ++times) {
      ASSERT_TRUE(player.play()) << player.error;
      EXPECT_EQ(player.track("events_0").events.size(), events.size());
      EXPECT_EQ(player.track("video_0").pictures.size(), 10U);
      player.stop();
    }
  }
}

/// After a flush in push mode, a demuxer starts over at the start of the file.
TEST(AedatDemux, BeginsAnewAfterAFlush) {
  const auto events = steady_events(200'000, 100);
  const auto bytes = aedat4_file(events);
  Harness h(Harness::with_late_pad("aedatdemux"), "aedatdemux");
  gst_harness_set_src_caps_str(h.get(), "application/x-aedat, version=(int)4");
  const auto push = [&](std::size_t size) {
    return h.push(gst_buffer_new_memdup(bytes.data(), size));
  };
  EXPECT_EQ(push(bytes.size() / 2), GST_FLOW_OK);
  flush({h.get()});
  pull_events(h);
  push_segment(h.get(), GST_FORMAT_BYTES);
  EXPECT_EQ(push(bytes.size()), GST_FLOW_OK);
  EXPECT_TRUE(gst_harness_push_event(h.get(), gst_event_new_eos()));
  EXPECT_TRUE(pull_events(h) == events);
}

}  // namespace
