// SPDX-License-Identifier: LGPL-2.1-or-later
// Seeks in AEDAT files, with and without a table, paused and while playing.
#include <map>

#include "tests/elements/aedat_player.hpp"
#include "tests/elements/aedat_recordings.hpp"
#include "tests/formats/recordings.hpp"

namespace {

using namespace harness;
using namespace aedat_recordings;

TEST(AedatDemux, Seeks) {
  const auto events = steady_events(10'000'000, 200, of_1970);
  const std::map<std::string, Bytes> files{
      {"by the table", aedat4_file(events)},
      {"without a table", aedat4_file(events, Aedat4Compression::zstd, false)},
      {"AEDAT 3", aedat_files::aedat3(shifted(events, -of_1970), "DAVIS346", 1000)}};
  for (const auto& [name, bytes] : files) {
    SCOPED_TRACE(name);
    const Microseconds zero = name == "AEDAT 3" ? 0 : of_1970;
    const auto expected = shifted(events, zero - of_1970);
    const TemporaryFile file(bytes);
    AedatPlayer player(file.source());
    player.preroll();
    if (name == "by the table") {
      EXPECT_EQ(player.duration(), 9'999'801 * GST_USECOND);
    }
    for (const Microseconds t : {5'000'000, 1'234'567, 0, 9'900'000}) {
      ASSERT_TRUE(player.seek(static_cast<GstClockTime>(t) * 1000));
      ASSERT_TRUE(player.play()) << player.error;
      const auto track = player.track("events_0");
      EXPECT_EQ(track.segment.start, static_cast<GstClockTime>(zero + t) * 1000);
      EXPECT_EQ(track.segment.time, static_cast<GstClockTime>(t) * 1000);
      EXPECT_TRUE(track.events == from(expected, zero + t)) << track.events.size();
      EXPECT_EQ(track.eos, 1U);
    }
    EXPECT_EQ(player.duration(), 9'999'801 * GST_USECOND);
    ASSERT_TRUE(player.seek(2 * GST_SECOND, 3 * GST_SECOND));
    ASSERT_TRUE(player.wait()) << player.error;
    const auto track = player.track("events_0");
    EXPECT_EQ(track.events.front().t, zero + 2'000'000);
    EXPECT_EQ(track.events.back().t, zero + 2'999'800);
    // The stop position is kept, which is before this.
    EXPECT_FALSE(gst_element_seek(player.get(), 1, GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH,
                                  GST_SEEK_TYPE_SET, 5 * GST_SECOND, GST_SEEK_TYPE_NONE, -1));
    ASSERT_TRUE(player.seek(0, 3 * GST_SECOND, GST_SEEK_FLAG_SEGMENT));
    ASSERT_TRUE(player.wait()) << player.error;
    EXPECT_EQ(player.track("events_0").eos, 0U);
    EXPECT_FALSE(gst_element_seek(player.get(), -1, GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH,
                                  GST_SEEK_TYPE_SET, 0, GST_SEEK_TYPE_SET, GST_SECOND));
    EXPECT_TRUE(player.warnings.empty());
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
