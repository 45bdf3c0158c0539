// SPDX-License-Identifier: LGPL-2.1-or-later
// What aedatmux writes of what aedatdemux and other readers read.
#include <algorithm>

#include "src/formats/evt/raw.hpp"
#include "tests/elements/aedat_player.hpp"
#include "tests/elements/aedat_recordings.hpp"

namespace {

using namespace harness;
using namespace aedat_recordings;

const std::string both_streams =
    "aedatdemux name=d  d.events_0 ! queue ! m.events_0  d.video_0 ! queue ! m.video_0  aedatmux "
    "name=m";

TEST(AedatMux, WritesWhatTheDemuxerReads) {
  const auto events = steady_events(1'500'000, 70);
  const char* const compressions[] = {"none", "lz4", "lz4-high", "zstd", "zstd-high"};
  const PixelFormat formats[] = {PixelFormat::grey8, PixelFormat::grey16, PixelFormat::bgr,
                                 PixelFormat::bgra, PixelFormat::grey8};
  for (std::size_t i = 0; i < 5; ++i) {
    SCOPED_TRACE(compressions[i]);
    const TemporaryFile in(aedat4_with_frames(events, formats[i], 30));
    const TemporaryFile out(copied(in, both_streams + " compression=" + compressions[i]));
    auto before = Content(in.bytes());
    const auto after = Content(out.bytes());
    EXPECT_TRUE(after.has_table);
    EXPECT_EQ(static_cast<std::size_t>(after.compression), i);
    EXPECT_EQ(after.streams.front().size, sensor);
    EXPECT_TRUE(after.events == shifted(before.events, 3'000));
    for (auto& picture : before.pictures)
      for (auto& t : picture.times) t += 3'000;
    EXPECT_TRUE(after.pictures == before.pictures);
    // Duration and seek positions come from the table.
    AedatPlayer player(out.source(), {"events_0", "video_0"});
    ASSERT_TRUE(player.reaches(GST_STATE_PAUSED));
    EXPECT_EQ(player.duration(),
              static_cast<GstClockTime>(before.events.back().t + 3'001) * GST_USECOND);
    ASSERT_TRUE(player.seek(GST_SECOND));
    ASSERT_TRUE(player.play());
    EXPECT_TRUE(player.track("events_0").events == from(after.events, 1'000'000));
  }
}

TEST(AedatMux, KeepsTheTimesOfAFileAndOfExposures) {
  const auto events = steady_events(100'000, 70, of_1970 + 123'457);
  Aedat4Encoder encoder({sensor, "", Aedat4Compression::none, true, true});
  Bytes bytes;
  std::vector<Content::Picture> pictures;
  const auto add_picture = [&](Microseconds t) {
    pictures.push_back({{t, t - 900, t + 40, t - 800, t - 300}, {5, 3, 17, 11}, Bytes(5 * 3, 7)});
    encoder.encode(Frame{t, t - 900, t + 40, t - 800, t - 300, PixelFormat::grey8, 5, 3, 17, 11,
                         pictures.back().pixels.data(), 5},
                   bytes);
  };
  add_picture(of_1970 + 120'457);
  encoder.encode(events, bytes);
  add_picture(of_1970 + 170'123);
  const TemporaryFile in(finished(encoder, bytes));
  const std::string elements[] = {
      both_streams,
      "aedatdemux name=d  d.events_0 ! queue ! m.  d.video_0 ! queue ! m.  aedatmux name=m",
      "aedatdemux name=d  d.video_0 ! queue ! m.  d.events_0 ! queue ! m.  aedatmux name=m"};
  for (const auto& way : elements) {  // caps tell the muxer what comes to a pad
    SCOPED_TRACE(way);
    const Content after(copied(in, way));
    EXPECT_TRUE(after.events == events);
    EXPECT_TRUE(after.pictures == pictures);
  }
}

TEST(AedatMux, RefusesTwoStreamsOfAKind) {
  const TemporaryFile in(aedat4_file(steady_events(300'000, 70)));
  Pipeline pipeline(in.source() +
                    "aedatdemux ! tee name=t  t. ! queue ! m.  t. ! queue ! m.  aedatmux name=m ! "
                    "fakesink");
  EXPECT_FALSE(pipeline.play());
  EXPECT_EQ(
      pipeline.error,
      "Cannot write two streams of events into one file; link one stream of events and one of "
      "video.");
}

TEST(AedatMux, KeepsTriggersAndImuSamples) {
  const auto events = steady_events(300'000, 70, of_1970);
  std::vector<Trigger> triggers{{of_1970 - 5'000, 0, true}};  // before the first event
  std::vector<ImuSample> samples;
  Aedat4Encoder encoder({.size = sensor,
                         .source = "a camera",
                         .compression = Aedat4Compression::lz4,
                         .table = true,
                         .triggers = true,
                         .imu_samples = true});
  Bytes bytes;
  encoder.encode(std::span<const Trigger>(triggers), bytes);
  for (std::size_t i = 0; i < events.size(); i += 100) {
    const std::vector<Trigger> few{{events[i].t, 1, true}, {events[i].t + 33, 1, false}};
    const std::vector<ImuSample> sample{
        {.t = events[i].t + 50, .temperature = 40, .acceleration = {0, -1, static_cast<float>(i)}}};
    triggers.insert(triggers.end(), few.begin(), few.end());
    samples.push_back(sample.front());
    encoder.encode(std::span<const Trigger>(few), bytes);
    encoder.encode(std::span<const ImuSample>(sample), bytes);
    encoder.encode(std::span(events).subspan(i, std::min<std::size_t>(100, events.size() - i)),
                   bytes);
  }
  const TemporaryFile in(finished(encoder, bytes));
  for (const std::string between : {"", "identity ! "}) {
    const Content copy(copied(in, between + "aedatdemux ! queue ! aedatmux"));
    EXPECT_EQ(copy.triggers, triggers);
    EXPECT_EQ(copy.imu_samples, samples);
    EXPECT_EQ(copy.events, events);
  }
}

TEST(AedatMux, NeedsNoSeeking) {
  const auto events = steady_events(300'000, 70);
  // The branch of the tee continues as a stream.
  const Content content(copied(TemporaryFile(aedat4_file(events)),
                               "aedatdemux ! aedatmux ! aedatdemux ! aedatmux compression=none"));
  EXPECT_TRUE(content.events == events);
  EXPECT_EQ(content.streams.front().source, "a camera");
}

}  // namespace
