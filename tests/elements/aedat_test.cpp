// SPDX-License-Identifier: LGPL-2.1-or-later
// aedatdemux gives the events and frames of AEDAT files as they were recorded, and aedatmux writes
// them.
#include <algorithm>
#include <map>

#include "src/formats/evt/raw.hpp"
#include "tests/elements/aedat_recordings.hpp"
#include "tests/elements/pipeline.hpp"
#include "tests/formats/recordings.hpp"

namespace {

using namespace harness;
using namespace aedat_recordings;

struct Picture {
  GstClockTime pts;
  std::string bytes;
};

/// Output of a pad since its last segment.
struct Track {
  std::string caps;
  std::vector<AbsoluteEvent> events;
  std::vector<Picture> pictures;
  std::size_t gaps = 0;
  GstClockTime end = 0;
  GstSegment segment{};
  std::size_t eos = 0;
};

/// Plays an AEDAT file and records what these pads of aedatdemux give. Launch lines of sources end
/// before it; identity at their end forces push mode.
class AedatPlayer : public Pipeline {
 public:
  explicit AedatPlayer(const std::string& source,
                       const std::vector<std::string>& pads = {"events_0"})
      : Pipeline(launch(source, pads)) {
    for (const auto& pad : pads) {
      auto& track = tracks_[pad];
      const bool has_events = pad.starts_with("events");
      watch(GST_BASE_SINK_PAD((*this)[pad.c_str()]),
            {[&track, has_events](GstBuffer* buffer) { see(track, buffer, has_events); },
             [&track](GstEvent* event) { see(track, event); }});
    }
  }
  ~AedatPlayer() { set(GST_STATE_NULL); }

  guint64 stat(const char* name) const { return Pipeline::stat("d", name); }

  /// While nothing is played.
  const Track& track(const std::string& pad) const { return tracks_.at(pad); }

 private:
  static std::string launch(const std::string& source, const std::vector<std::string>& pads) {
    auto line = source + "aedatdemux name=d";
    for (const auto& pad : pads) line += "  d." + pad + " ! queue ! fakesink name=" + pad;
    return line;
  }

  static void see(Track& track, GstBuffer* buffer, bool of_events) {
    EXPECT_GE(GST_BUFFER_PTS(buffer), track.end) << "intervals overlap";
    if (!of_events) {
      track.end = GST_BUFFER_PTS(buffer);
      track.pictures.push_back({GST_BUFFER_PTS(buffer), bytes_of(buffer)});
      return;
    }
    track.end = GST_BUFFER_PTS(buffer) + GST_BUFFER_DURATION(buffer);
    EXPECT_LE(GST_BUFFER_DURATION(buffer), 10 * GST_MSECOND);
    append_events(buffer, track.events);
    for (const auto& event : events_of(buffer))
      EXPECT_LE(event.t, GST_BUFFER_DURATION(buffer) / 1000);
  }

  static void see(Track& track, GstEvent* event) {
    switch (GST_EVENT_TYPE(event)) {
      case GST_EVENT_CAPS: {
        GstCaps* caps = nullptr;
        gst_event_parse_caps(event, &caps);
        track.caps = text_of(Owned<GstCaps>(gst_caps_ref(caps)));
        break;
      }
      case GST_EVENT_SEGMENT: {
        const auto caps = track.caps;
        track = {};
        track.caps = caps;
        gst_event_copy_segment(event, &track.segment);
        break;
      }
      case GST_EVENT_GAP: {
        const auto [start, duration] = gap_of(event);
        EXPECT_GE(start, track.end);
        EXPECT_GT(duration, 0U);
        track.end = start + duration;
        ++track.gaps;
        break;
      }
      case GST_EVENT_EOS:
        ++track.eos;
        break;
      default:
        break;
    }
  }

  std::map<std::string, Track> tracks_;
};

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
    EXPECT_TRUE(contains(assumed.warnings.front(), "assuming 240 x 180 pixels"));

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
    AedatPlayer player(file.source(), {"events_0", "video_0"});
    ASSERT_TRUE(player.play()) << player.error;
    const auto& video = player.track("video_0");
    EXPECT_TRUE(contains(video.caps, "format=(string)" + std::string(name)));
    EXPECT_TRUE(contains(video.caps, "width=(int)5, height=(int)3"));
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

/// Frames continue after the end of events, and events after the end of frames.
TEST(AedatDemux, KeepsSilentStreamsGoing) {
  const auto few = steady_events(10'000, 100);
  const TemporaryFile frames(aedat4_with_frames(few, PixelFormat::grey8, 250));
  AedatPlayer player(frames.source(), {"events_0", "video_0"});
  ASSERT_TRUE(player.play()) << player.error;
  EXPECT_GE(player.track("events_0").end, 9 * GST_SECOND);
  const TemporaryFile events(
      aedat4_with_frames(steady_events(10'000'000, 1'000), PixelFormat::grey8, 2));
  AedatPlayer other(events.source(), {"events_0", "video_0"});
  ASSERT_TRUE(other.play()) << other.error;
  EXPECT_GE(other.track("video_0").end, 9 * GST_SECOND);
  EXPECT_LE(other.track("video_0").gaps, 40U);
}

TEST(AedatDemux, SaysWhereTheTableIsWrong) {
  const auto events = steady_events(2'000'000, 50);
  const auto whole = aedat4_file(events);
  const auto table_at = read_aedat4_header(whole)->table_at.value();
  Aedat4Encoder encoder({sensor, "a camera", Aedat4Compression::lz4, false, true});
  Bytes ignored;
  encoder.finish(ignored);
  const auto field_at = encoder.patch().value().position;

  const auto changed = [&](const auto& change) {
    auto bytes = whole;
    change(bytes);
    return bytes;
  };
  const struct {
    std::size_t at;
    const char* what;
    Bytes bytes;
  } faults[] = {
      {table_at, "the packet table that the header states is missing", changed([&](Bytes& bytes) {
         for (auto i = table_at + 8; i < bytes.size(); ++i) bytes[i] ^= 0x5a;
       })},
      {table_at, "the file ends before its packet table",
       changed([&](Bytes& bytes) { bytes.resize(table_at); })},
      {field_at, "the header has a wrong position for the packet table",
       changed([&](Bytes& bytes) { bytes[field_at + 5] = 1; })},
      {field_at, "the header has a wrong position for the packet table",
       changed([&](Bytes& bytes) { bytes[field_at] ^= 0x10; })}};
  for (const auto& fault : faults) {
    const TemporaryFile file(fault.bytes);
    AedatPlayer player(file.source());
    ASSERT_TRUE(player.play()) << player.error;
    ASSERT_EQ(player.warnings.size(), 1U);
    EXPECT_TRUE(player.warnings.front().starts_with("Corrupt data at byte " +
                                                    std::to_string(fault.at) + ": " + fault.what))
        << player.warnings.front();
    EXPECT_TRUE(player.track("events_0").events == events);
    EXPECT_EQ(player.stat("corrupt-places"), 1U);
  }
}

/// What decodebin ends a file with.
GstMessageType decoded(const TemporaryFile& file, const std::string& between = "") {
  Player player(file.source() + between + "decodebin caps=application/x-event-camera,format=XYTP");
  player.play();
  return player.end;
}

/// decodebin drops errors while it is adding an element, whose state it locks.
TEST(AedatDemux, TellsDecodebinOfErrors) {
  auto bytes = aedat4_file(steady_events(100'000, 70));
  bytes[17] = 0x7f;  // the size of the header
  const TemporaryFile file(bytes);
  for (int i = 0; i < 5; ++i) {
    ASSERT_EQ(decoded(file), GST_MESSAGE_ERROR) << i;
    ASSERT_EQ(decoded(file, "queue ! "), GST_MESSAGE_ERROR) << i;
  }

  Pipeline pipeline(file.source() + "aedatdemux name=d");
  const Owned<GstBus> bus(gst_element_get_bus(pipeline.get()));
  gst_element_set_locked_state(pipeline["d"], TRUE);
  pipeline.set(GST_STATE_PAUSED);
  gst_element_set_state(pipeline["d"], GST_STATE_PAUSED);
  EXPECT_FALSE(Owned<GstMessage>(
      gst_bus_timed_pop_filtered(bus.get(), 50 * GST_MSECOND, GST_MESSAGE_ERROR)));
  gst_element_set_locked_state(pipeline["d"], FALSE);
  EXPECT_FALSE(pipeline.wait());
  EXPECT_EQ(pipeline.end, GST_MESSAGE_ERROR);
}

TEST(AedatDemux, SaysWhereAFileHasNoEvents) {
  const TemporaryFile empty(aedat_files::aedat4_header(""));
  AedatPlayer player(empty.source());
  EXPECT_FALSE(player.play());
  EXPECT_TRUE(contains(player.error, "neither events nor frames"));
  // There is a stream of events here, though it is empty.
  const TemporaryFile silent(aedat4_file({}));
  AedatPlayer other(silent.source());
  EXPECT_TRUE(other.play()) << other.error;
  EXPECT_EQ(other.track("events_0").eos, 1U);
}

/* copies */

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
  const auto middle = events[2000].t;
  const std::vector<Trigger> triggers{{of_1970 - 5'000, 0, true},  // before the first event
                                      {middle, 1, true},
                                      {middle + 33, 1, false}};
  const std::vector<ImuSample> samples{
      {.t = middle + 50, .temperature = 40, .acceleration = {0, -1, 7}}};
  Aedat4Encoder encoder({.size = sensor,
                         .source = "a camera",
                         .compression = Aedat4Compression::lz4,
                         .table = true,
                         .triggers = true,
                         .imu_samples = true});
  Bytes bytes;
  encoder.encode(std::span(triggers).first(1), bytes);
  encoder.encode(std::span(events).first(2000), bytes);
  encoder.encode(std::span(triggers).subspan(1), bytes);
  encoder.encode(std::span(samples), bytes);
  encoder.encode(std::span(events).subspan(2000), bytes);
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
