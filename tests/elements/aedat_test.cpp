// SPDX-License-Identifier: LGPL-2.1-or-later
// aedatdemux and aedatmux on encoded files, on corrupt files, and on a recording.
#include <atomic>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>
#include <numeric>
#include <optional>
#include <random>
#include <set>

#include "src/formats/aedat/aedat4_decoder.hpp"
#include "src/formats/aedat/aedat4_encoder.hpp"
#include "src/formats/evt/raw.hpp"
#include "tests/elements/harness.hpp"
#include "tests/formats/aedat_files.hpp"
#include "tests/formats/recordings.hpp"
#include "tests/formats/shared_data.hpp"

namespace {

using namespace harness;
using eventcamera::AbsoluteEvent;
using eventcamera::Aedat4Compression;
using eventcamera::Aedat4Decoder;
using eventcamera::Aedat4Encoder;
using eventcamera::Aedat4Settings;
using eventcamera::EventItem;
using eventcamera::Frame;
using eventcamera::FrameItem;
using eventcamera::Microseconds;
using eventcamera::PixelFormat;
using eventcamera::Polarity;
using eventcamera::SensorSize;
using Bytes = std::vector<std::uint8_t>;
using Events = std::vector<AbsoluteEvent>;

constexpr SensorSize sensor{346, 260};
/// Start time of a recording with absolute times.
constexpr Microseconds of_1970 = 1'700'000'000'000'000;
constexpr const char* davis = "davis346-frames-events-imu.aedat4";

Events shifted(Events events, Microseconds by) {
  for (auto& event : events) event.t += by;
  return events;
}

Events from(const Events& events, Microseconds t) {
  Events later;
  for (const auto& event : events)
    if (event.t >= t) later.push_back(event);
  return later;
}

/// Events at all times from 0 to `end`, one every `step` microseconds.
Events steady_events(Microseconds end, Microseconds step, Microseconds start = 0) {
  Events events;
  for (Microseconds t = 0; t < end; t += step) {
    const auto i = static_cast<int>(t / step);
    events.push_back(AbsoluteEvent::at(i % sensor.width, i / 7 % sensor.height, start + t,
                                       i % 3 == 0 ? Polarity::on : Polarity::off));
  }
  return events;
}

/// A file with a table that is stated in its header.
Bytes finished(Aedat4Encoder& encoder, Bytes bytes) {
  encoder.finish(bytes);
  if (const auto patch = encoder.patch())
    std::copy(patch->bytes.begin(), patch->bytes.end(),
              bytes.begin() + static_cast<std::ptrdiff_t>(patch->position));
  return bytes;
}

Bytes aedat4(const Events& events, Aedat4Compression compression = Aedat4Compression::lz4,
             bool table = true) {
  Aedat4Encoder encoder({sensor, "a camera", compression, false, table});
  Bytes bytes;
  encoder.encode(events, bytes);
  return finished(encoder, bytes);
}

/// Events, and a frame every 40 ms whose pixels contain its number; the first is before the events.
Bytes aedat4_with_frames(const Events& events, PixelFormat format, int frames) {
  Aedat4Encoder encoder({sensor, "", Aedat4Compression::zstd, true, true});
  Bytes bytes;
  std::span<const AbsoluteEvent> rest(events);
  for (int i = 0; i < frames; ++i) {
    const auto t = events.front().t - 3'000 + i * 40'000;
    std::size_t count = 0;
    while (count < rest.size() && rest[count].t < t) ++count;
    encoder.encode(rest.first(count), bytes);
    rest = rest.subspan(count);
    const Bytes pixels(static_cast<std::size_t>(5 * 3 * bytes_per_pixel(format)),
                       static_cast<std::uint8_t>(i));
    encoder.encode({t, t, t, t, t, format, 5, 3, 0, 0, pixels.data(), 5 * bytes_per_pixel(format)},
                   bytes);
  }
  encoder.encode(rest, bytes);
  return finished(encoder, bytes);
}

class File {
 public:
  explicit File(const Bytes& bytes)
      : path_(std::filesystem::temp_directory_path() /
              ("aedat-test-" + std::to_string(std::random_device()()))) {
    std::ofstream(path_, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
  }
  ~File() { std::filesystem::remove(path_); }
  File(const File&) = delete;
  File& operator=(const File&) = delete;

  std::string path() const { return path_.string(); }
  Bytes bytes() const {
    std::ifstream file(path_, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  }

 private:
  std::filesystem::path path_;
};

struct Picture {
  GstClockTime pts;
  std::string bytes;
};

/// Output of a pad since its last segment.
struct Track {
  std::string caps;
  Events events;
  std::vector<Picture> pictures;
  std::size_t buffers = 0;
  std::size_t gaps = 0;
  GstClockTime end = 0;
  GstSegment segment{};
  std::size_t eos = 0;
};

/// Plays files with aedatdemux, named d, and records the output of each of its pads.
class Player {
 public:
  /// `between` is inserted between the file and the demuxer; identity forces push mode.
  explicit Player(const std::string& path, const std::string& between = "",
                  const std::string& properties = "") {
    gst_init(nullptr, nullptr);
    const auto launch = "filesrc name=source location=" + in_quotes(path) + " ! " +
                        (between.empty() ? "" : between + " ! ") + "aedatdemux name=d " +
                        properties;
    pipeline_.reset(gst_parse_launch(launch.c_str(), nullptr));
    demux_.reset(gst_bin_get_by_name(GST_BIN(pipeline_.get()), "d"));
    bus_.reset(gst_element_get_bus(pipeline_.get()));
    g_signal_connect(demux_.get(), "pad-added", G_CALLBACK(added), this);
    g_signal_connect(demux_.get(), "no-more-pads",
                     G_CALLBACK(+[](GstElement*, Player* self) { ++self->no_more_pads; }), this);
  }
  ~Player() { gst_element_set_state(pipeline_.get(), GST_STATE_NULL); }
  Player(const Player&) = delete;
  Player& operator=(const Player&) = delete;

  void set_state(GstState state) {
    ASSERT_NE(gst_element_set_state(pipeline_.get(), state), GST_STATE_CHANGE_FAILURE);
  }

  /// Stops, and removes the elements linked to the pads.
  void stop() {
    set_state(GST_STATE_READY);
    for (GstElement* element : std::exchange(after_, {})) {
      gst_element_set_state(element, GST_STATE_NULL);
      gst_bin_remove(GST_BIN(pipeline_.get()), element);
    }
  }

  /// Plays to the end. False after an error or a timeout.
  bool play() {
    set_state(GST_STATE_PLAYING);
    return wait();
  }

  bool wait() {
    while (true) {
      const Owned<GstMessage> message(gst_bus_timed_pop_filtered(
          bus_.get(), 20 * GST_SECOND,
          static_cast<GstMessageType>(GST_MESSAGE_EOS | GST_MESSAGE_ERROR | GST_MESSAGE_WARNING |
                                      GST_MESSAGE_SEGMENT_DONE)));
      if (!message) {
        error = "nothing happens";
        return false;
      }
      if (GST_MESSAGE_TYPE(message.get()) == GST_MESSAGE_WARNING) {
        warnings.push_back(text_of(message.get()));
        continue;
      }
      if (GST_MESSAGE_TYPE(message.get()) == GST_MESSAGE_ERROR) {
        error = text_of(message.get());
        return false;
      }
      return true;
    }
  }

  void preroll() {
    set_state(GST_STATE_PAUSED);
    while (no_more_pads == 0) g_usleep(1000);  // before, there are no sinks to wait for
    ASSERT_EQ(gst_element_get_state(pipeline_.get(), nullptr, nullptr, 20 * GST_SECOND),
              GST_STATE_CHANGE_SUCCESS);
  }

  bool seek(GstClockTime start, GstClockTime stop = GST_CLOCK_TIME_NONE, int more_flags = 0) {
    return gst_element_seek(pipeline_.get(), 1, GST_FORMAT_TIME,
                            static_cast<GstSeekFlags>(GST_SEEK_FLAG_FLUSH | more_flags),
                            GST_SEEK_TYPE_SET, static_cast<gint64>(start),
                            GST_CLOCK_TIME_IS_VALID(stop) ? GST_SEEK_TYPE_SET : GST_SEEK_TYPE_NONE,
                            static_cast<gint64>(stop)) != FALSE;
  }

  std::optional<gint64> duration() const {
    gint64 duration = 0;
    if (!gst_element_query_duration(pipeline_.get(), GST_FORMAT_TIME, &duration)) return {};
    return duration;
  }

  guint64 stat(const char* name) const {
    GstStructure* stats = nullptr;
    guint64 value = 0;
    g_object_get(demux_.get(), "stats", &stats, nullptr);
    EXPECT_TRUE(gst_structure_get_uint64(stats, name, &value)) << name;
    gst_structure_free(stats);
    return value;
  }

  Track track(const std::string& pad) {
    const std::lock_guard lock(mutex_);
    return tracks_[pad];
  }
  std::size_t pads() {
    const std::lock_guard lock(mutex_);
    return tracks_.size();
  }
  GstElement* pipeline() const { return pipeline_.get(); }

  std::vector<std::string> warnings;
  std::string error;
  std::atomic<int> no_more_pads = 0;
  std::atomic<int> flushes = 0;  ///< of all pads together

 private:
  static void added(GstElement*, GstPad* pad, Player* self) {
    GstElement* const queue = gst_element_factory_make("queue", nullptr);
    GstElement* const sink = gst_element_factory_make("fakesink", nullptr);
    gst_bin_add_many(GST_BIN(self->pipeline_.get()), queue, sink, nullptr);
    gst_element_link(queue, sink);
    {
      const std::lock_guard lock(self->mutex_);
      self->after_.insert(self->after_.end(), {queue, sink});
      auto& track = self->tracks_[GST_PAD_NAME(pad)] = {};
      // A pad whose caps may depend on what is linked has none yet.
      for (const auto type : {GST_EVENT_CAPS, GST_EVENT_SEGMENT})
        if (const Owned<GstEvent> event{gst_pad_get_sticky_event(pad, type, 0)})
          see(track, event.get());
    }
    gst_pad_add_probe(pad,
                      static_cast<GstPadProbeType>(GST_PAD_PROBE_TYPE_BUFFER |
                                                   GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM |
                                                   GST_PAD_PROBE_TYPE_EVENT_FLUSH),
                      seen, self, nullptr);
    GstPad* const in = gst_element_get_static_pad(queue, "sink");
    gst_pad_link(pad, in);
    gst_object_unref(in);
    gst_element_sync_state_with_parent(sink);
    gst_element_sync_state_with_parent(queue);
  }

  static GstPadProbeReturn seen(GstPad* pad, GstPadProbeInfo* info, gpointer data) {
    auto* const self = static_cast<Player*>(data);
    const std::lock_guard lock(self->mutex_);
    auto& track = self->tracks_[GST_PAD_NAME(pad)];
    if ((GST_PAD_PROBE_INFO_TYPE(info) & GST_PAD_PROBE_TYPE_BUFFER) != 0)
      see(track, GST_PAD_PROBE_INFO_BUFFER(info), g_str_has_prefix(GST_PAD_NAME(pad), "events"));
    else if (GST_EVENT_TYPE(GST_PAD_PROBE_INFO_EVENT(info)) == GST_EVENT_FLUSH_STOP)
      ++self->flushes;
    else
      see(track, GST_PAD_PROBE_INFO_EVENT(info));
    return GST_PAD_PROBE_OK;
  }

  static void see(Track& track, GstBuffer* buffer, bool of_events) {
    ++track.buffers;
    EXPECT_GE(GST_BUFFER_PTS(buffer), track.end) << "intervals overlap";
    if (!of_events) {
      track.end = GST_BUFFER_PTS(buffer);
      track.pictures.push_back({GST_BUFFER_PTS(buffer), bytes_of(buffer)});
      return;
    }
    track.end = GST_BUFFER_PTS(buffer) + GST_BUFFER_DURATION(buffer);
    EXPECT_LE(GST_BUFFER_DURATION(buffer), 10 * GST_MSECOND);
    const auto start = static_cast<Microseconds>(GST_BUFFER_PTS(buffer) / 1000);
    for (const auto& e : events_of(buffer)) {
      EXPECT_LT(e.t, GST_BUFFER_DURATION(buffer) / 1000);
      track.events.push_back({start + e.t, e.x, e.y_p});
    }
  }

  static void see(Track& track, GstEvent* event) {
    switch (GST_EVENT_TYPE(event)) {
      case GST_EVENT_CAPS: {
        GstCaps* caps = nullptr;
        gst_event_parse_caps(event, &caps);
        gchar* const text = gst_caps_to_string(caps);
        track.caps = text;
        g_free(text);
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
        GstClockTime start = 0;
        GstClockTime duration = 0;
        gst_event_parse_gap(event, &start, &duration);
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

  Owned<GstElement> pipeline_;
  Owned<GstElement> demux_;
  Owned<GstBus> bus_;
  std::mutex mutex_;
  std::map<std::string, Track> tracks_;
  std::vector<GstElement*> after_;  ///< the pipeline's
};

TEST(AedatDemux, HandsOutTheEventsOfEveryVersion) {
  recordings::Random random(7);
  auto made = recordings::random_events(random, sensor, 30'000, 200'000);
  const auto first = made.front().t;
  std::map<std::string, Bytes> files;
  for (const int compression : {0, 1, 2, 3, 4})
    files["4, compression " + std::to_string(compression)] =
        aedat4(made, static_cast<Aedat4Compression>(compression));
  files["4, without a table"] = aedat4(made, Aedat4Compression::lz4, false);
  files["4, of today"] = aedat4(shifted(made, of_1970));
  files["3"] = eventcamera::aedat_files::aedat3(made, "DAVIS346", 1000);
  files["3, camera unknown"] = eventcamera::aedat_files::aedat3(made, "a camera", 1000);
  files["2"] = eventcamera::aedat_files::aedat2_davis(made, sensor, "eu.seebetter.DAVIS346");
  for (const auto& [name, bytes] : files) {
    const File file(bytes);
    for (const char* between : {"", "identity"}) {
      SCOPED_TRACE(name + ", " + between);
      Player player(file.path(), between);
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
    }
  }
}

/// Runs a line to its end; what fakesink "out" got, and the warnings.
struct Played {
  explicit Played(const std::string& launch) {
    gst_init(nullptr, nullptr);
    GError* error = nullptr;
    const Owned<GstElement> pipeline(gst_parse_launch(launch.c_str(), &error));
    EXPECT_EQ(error, nullptr) << error->message;
    const Owned<GstElement> out(gst_bin_get_by_name(GST_BIN(pipeline.get()), "out"));
    g_object_set(out.get(), "signal-handoffs", TRUE, nullptr);
    g_signal_connect(out.get(), "handoff",
                     G_CALLBACK(+[](GstElement*, GstBuffer* buffer, GstPad*, Events* seen) {
                       const auto start = static_cast<Microseconds>(GST_BUFFER_PTS(buffer) / 1000);
                       for (const auto& e : events_of(buffer))
                         seen->push_back({start + e.t, e.x, e.y_p});
                     }),
                     &events);
    const Owned<GstBus> bus(gst_element_get_bus(pipeline.get()));
    gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
    bool ended = false;
    while (!ended) {
      const Owned<GstMessage> message(gst_bus_timed_pop_filtered(
          bus.get(), 20 * GST_SECOND,
          static_cast<GstMessageType>(GST_MESSAGE_EOS | GST_MESSAGE_ERROR | GST_MESSAGE_WARNING)));
      ended = !message || GST_MESSAGE_TYPE(message.get()) != GST_MESSAGE_WARNING;
      if (!message) error_text = "nothing happens";
      if (message && GST_MESSAGE_TYPE(message.get()) != GST_MESSAGE_EOS)
        (ended ? error_text : warnings) += text_of(message.get());
    }
    gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  }

  Events events;
  std::string warnings;
  std::string error_text;
};

TEST(AedatDemux, Aedat2WithoutACameraHasTheSizeThatIsAskedFor) {
  namespace files = eventcamera::aedat_files;
  recordings::Random random(3);
  constexpr SensorSize davis240{240, 180};
  const auto events = recordings::random_events(random, davis240, 20'000, 200'000);
  const File file(files::aedat2_v2e(events, davis240));
  const std::string demux = "filesrc location=" + in_quotes(file.path()) + " ! ";
  for (const std::string between : {"", "identity ! "}) {
    SCOPED_TRACE(between);
    const Played assumed(demux + between + "aedatdemux ! fakesink name=out");
    EXPECT_TRUE(assumed.events == events) << assumed.error_text;
    EXPECT_NE(assumed.warnings.find("assuming 240x180 pixels"), std::string::npos);

    auto moved = events;  // by what a DAVIS346 has more of
    for (auto& e : moved) e = AbsoluteEvent::at(e.x + 106, e.y() + 80, e.t, e.polarity());
    for (const char* way :
         {"aedatdemux width=346 height=260 ! fakesink name=out",
          "aedatdemux ! application/x-event-camera,width=346,height=260 ! fakesink name=out"}) {
      const Played asked(demux + between + way);
      EXPECT_TRUE(asked.events == moved) << way << ": " << asked.error_text;
      EXPECT_EQ(asked.warnings, "");
    }
  }

  const auto few = recordings::random_events(random, {128, 128}, 20'000, 200'000);
  const File of_matlab(files::aedat2_of_matlab(few));
  const Played dvs128("filesrc location=" + in_quotes(of_matlab.path()) +
                      " ! aedatdemux ! application/x-event-camera,width=128,height=128 ! fakesink "
                      "name=out");
  EXPECT_TRUE(dvs128.events == few) << dvs128.error_text;
  EXPECT_EQ(dvs128.warnings, "");
}

TEST(AedatDemux, PiecesOfAnySizeChangeNothing) {
  const auto events = steady_events(300'000, 100);
  const File file(aedat4_with_frames(events, PixelFormat::grey8, 7));
  for (const int size : {1, 7, 100, 4096}) {
    Player player(file.path(), "identity");
    Owned<GstElement> source(gst_bin_get_by_name(GST_BIN(player.pipeline()), "source"));
    g_object_set(source.get(), "blocksize", size, nullptr);
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
    const File file(aedat4_with_frames(events, format, 50));
    Player player(file.path());
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
    EXPECT_EQ(player.duration(), 2'002'001 * 1000);
  }
}

TEST(AedatDemux, ReadsTheRecordingOfADavis) {
  const auto bytes = eventcamera::shared_data::events_file(davis);
  if (bytes.empty()) GTEST_SKIP() << "no shared data";
  const File file(bytes);
  for (const char* between : {"", "identity"}) {
    Player player(file.path(), between);
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
  const File file(aedat4(events));
  Player player(file.path());
  ASSERT_TRUE(player.play()) << player.error;
  const auto track = player.track("events_0");
  EXPECT_TRUE(track.events == events);
  EXPECT_LE(track.buffers + track.gaps, 8U);
  EXPECT_GE(track.gaps, 1U);
}

/// Frames continue after the end of events, and events after the end of frames.
TEST(AedatDemux, KeepsSilentStreamsGoing) {
  const auto few = steady_events(10'000, 100);
  const File frames(aedat4_with_frames(few, PixelFormat::grey8, 250));
  Player player(frames.path());
  ASSERT_TRUE(player.play()) << player.error;
  EXPECT_GE(player.track("events_0").end, 9 * GST_SECOND);
  const File events(aedat4_with_frames(steady_events(10'000'000, 1'000), PixelFormat::grey8, 2));
  Player other(events.path());
  ASSERT_TRUE(other.play()) << other.error;
  EXPECT_GE(other.track("video_0").end, 9 * GST_SECOND);
  EXPECT_LE(other.track("video_0").gaps, 20U);
}

TEST(AedatDemux, Seeks) {
  const auto events = steady_events(10'000'000, 200, of_1970);
  const std::map<std::string, Bytes> files{
      {"by the table", aedat4(events)},
      {"without a table", aedat4(events, Aedat4Compression::zstd, false)},
      {"AEDAT 3", eventcamera::aedat_files::aedat3(shifted(events, -of_1970), "DAVIS346", 1000)}};
  for (const auto& [name, bytes] : files) {
    SCOPED_TRACE(name);
    const Microseconds zero = name == "AEDAT 3" ? 0 : of_1970;
    const auto expected = shifted(events, zero - of_1970);
    const File file(bytes);
    Player player(file.path());
    player.preroll();
    if (name == "by the table") {
      EXPECT_EQ(player.duration(), 9'999'801 * 1000LL);
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
    EXPECT_EQ(player.duration(), 9'999'801 * 1000LL);
    ASSERT_TRUE(player.seek(2 * GST_SECOND, 3 * GST_SECOND));
    ASSERT_TRUE(player.wait()) << player.error;
    const auto track = player.track("events_0");
    EXPECT_EQ(track.events.front().t, zero + 2'000'000);
    EXPECT_EQ(track.events.back().t, zero + 2'999'800);
    // The stop position is kept, which is before this.
    EXPECT_FALSE(gst_element_seek(player.pipeline(), 1, GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH,
                                  GST_SEEK_TYPE_SET, 5 * GST_SECOND, GST_SEEK_TYPE_NONE, -1));
    ASSERT_TRUE(player.seek(0, 3 * GST_SECOND, GST_SEEK_FLAG_SEGMENT));
    ASSERT_TRUE(player.wait()) << player.error;
    EXPECT_EQ(player.track("events_0").eos, 0U);
    EXPECT_FALSE(gst_element_seek(player.pipeline(), -1, GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH,
                                  GST_SEEK_TYPE_SET, 0, GST_SEEK_TYPE_SET, GST_SECOND));
    EXPECT_TRUE(player.warnings.empty());
  }
}

TEST(AedatDemux, SeeksWhilePlayingAgainAndAgain) {
  const auto events = steady_events(10'000'000, 100);
  const File file(aedat4_with_frames(events, PixelFormat::bgr, 250));
  Player player(file.path());
  player.preroll();
  ASSERT_TRUE(player.seek(GST_SECOND));
  EXPECT_EQ(player.flushes, 2) << "the bin sends a seek to both sinks; it is done once";
  player.set_state(GST_STATE_PLAYING);
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

/// The first corruption, as found by the decoder alone.
std::uint64_t place_of_corruption(const Bytes& bytes) {
  Aedat4Decoder decoder;
  decoder.push(bytes);
  decoder.finish();
  while (decoder.next()) continue;
  EXPECT_GT(decoder.corruption().places, 0U);
  return decoder.corruption().first_at;
}

TEST(AedatDemux, DeliversWhatIsWholeOfBrokenFiles) {
  const auto events = steady_events(2'000'000, 50);
  const auto whole = aedat4(events);
  const auto expected = std::set<Microseconds>([&] {
    std::set<Microseconds> times;
    for (const auto& event : events) times.insert(event.t);
    return times;
  }());
  recordings::Random random(11);
  for (int i = 0; i < 12; ++i) {
    SCOPED_TRACE(i);
    auto bytes = whole;
    const auto at = 2000 + static_cast<std::size_t>(
                               recordings::below(random, static_cast<int>(bytes.size()) - 4000));
    if (i % 3 == 0)
      for (std::size_t k = 0; k < 40; ++k) bytes[at + k] ^= 0x5a;
    else if (i % 3 == 1)
      bytes.resize((bytes.size() + at) / 2);
    else
      bytes.erase(bytes.begin() + static_cast<std::ptrdiff_t>(at),
                  bytes.begin() + static_cast<std::ptrdiff_t>(at) + 33);
    const File file(bytes);
    // In pull mode its table is missing, too; the first corruption is reported.
    const auto first_corruption = place_of_corruption(bytes);
    for (const char* between : {"", "identity"}) {
      Player player(file.path(), between);
      ASSERT_TRUE(player.play()) << player.error;
      ASSERT_FALSE(player.warnings.empty());
      EXPECT_TRUE(player.warnings.front().starts_with("Corrupt data at byte " +
                                                      std::to_string(first_corruption) + ": "))
          << player.warnings.front();
      EXPECT_EQ(
          std::count_if(player.warnings.begin(), player.warnings.end(),
                        [](const auto& text) { return text.find("at byte") != std::string::npos; }),
          1);
      EXPECT_GE(player.stat("corrupt-places"), 1U);
      const auto track = player.track("events_0");
      EXPECT_GT(track.events.size(), events.size() / 3);
      for (const auto& event : track.events) EXPECT_TRUE(expected.contains(event.t));
    }
  }
}

TEST(AedatDemux, SaysWhereTheTableIsWrong) {
  const auto events = steady_events(2'000'000, 50);
  const auto whole = aedat4(events);
  Aedat4Decoder decoder;
  decoder.push(whole);
  while (decoder.next()) continue;
  const auto table_at = decoder.table_at().value();
  Aedat4Encoder encoder({sensor, "a camera", Aedat4Compression::lz4, false, true});
  Bytes ignored;
  encoder.finish(ignored);
  const auto field_at = encoder.patch().value().position;

  struct Fault {
    std::size_t at;
    const char* what;
    Bytes bytes;
  };
  auto overwritten = whole;
  for (auto i = table_at + 8; i < overwritten.size(); ++i) overwritten[i] ^= 0x5a;
  auto cut = whole;
  cut.resize(table_at);
  auto far = whole;
  far[field_at + 5] = 1;
  auto near = whole;
  near[field_at] ^= 0x10;
  const Fault faults[] = {
      {table_at, "the packet table that the header states is missing", overwritten},
      {table_at, "the file ends before its packet table", cut},
      {field_at, "the header has a wrong position for the packet table", far},
      {field_at, "the header has a wrong position for the packet table", near}};
  for (const auto& fault : faults) {
    const File file(fault.bytes);
    Player player(file.path());
    ASSERT_TRUE(player.play()) << player.error;
    ASSERT_EQ(player.warnings.size(), 1U);
    EXPECT_TRUE(player.warnings.front().starts_with("Corrupt data at byte " +
                                                    std::to_string(fault.at) + ": " + fault.what))
        << player.warnings.front();
    EXPECT_TRUE(player.track("events_0").events == events);
    EXPECT_EQ(player.stat("corrupt-places"), 1U);
  }
}

TEST(AedatDemux, SaysWhereSomethingIsNotAedat) {
  const Bytes png{0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n', 0, 0, 0, 13, 'I', 'H', 'D', 'R'};
  Bytes old;
  eventcamera::aedat_files::add(old, "#!AER-DAT1.0\r\n#\r\n");
  Bytes half = aedat4(steady_events(1'000, 10));
  half.resize(40);
  for (const auto& bytes : {png, old, half, Bytes{}, Bytes{'#'}}) {
    const File file(bytes);
    for (const char* between : {"", "identity"}) {
      Player player(file.path(), between);
      EXPECT_FALSE(player.play());
      EXPECT_NE(player.error.find("AEDAT"), std::string::npos) << player.error;
      EXPECT_EQ(player.pads(), 0U);
    }
  }
}

/// Result of playing a file with decodebin: the type of the last message, or GST_MESSAGE_UNKNOWN.
GstMessageType decoded(const std::string& path, const std::string& between = "") {
  gst_init(nullptr, nullptr);
  const Owned<GstElement> pipeline(
      gst_parse_launch(("filesrc location=" + in_quotes(path) + " ! " + between +
                        "decodebin caps=application/x-event-camera,format=XYTP ! fakesink")
                           .c_str(),
                       nullptr));
  const Owned<GstBus> bus(gst_element_get_bus(pipeline.get()));
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const Owned<GstMessage> message(gst_bus_timed_pop_filtered(
      bus.get(), 5 * GST_SECOND, static_cast<GstMessageType>(GST_MESSAGE_EOS | GST_MESSAGE_ERROR)));
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  return message ? GST_MESSAGE_TYPE(message.get()) : GST_MESSAGE_UNKNOWN;
}

/// decodebin drops errors while it is adding an element, whose state it locks.
TEST(AedatDemux, TellsDecodebinOfErrors) {
  auto bytes = aedat4(steady_events(100'000, 70));
  bytes[17] = 0x7f;  // the size of the header
  const File file(bytes);
  for (int i = 0; i < 30; ++i) {
    ASSERT_EQ(decoded(file.path()), GST_MESSAGE_ERROR) << i;
    ASSERT_EQ(decoded(file.path(), "queue ! "), GST_MESSAGE_ERROR) << i;
  }

  const Owned<GstElement> pipeline(gst_parse_launch(
      ("filesrc location=" + in_quotes(file.path()) + " ! aedatdemux name=d").c_str(), nullptr));
  const Owned<GstBus> bus(gst_element_get_bus(pipeline.get()));
  const Owned<GstElement> demux(gst_bin_get_by_name(GST_BIN(pipeline.get()), "d"));
  gst_element_set_locked_state(demux.get(), TRUE);
  gst_element_set_state(pipeline.get(), GST_STATE_PAUSED);
  gst_element_set_state(demux.get(), GST_STATE_PAUSED);
  EXPECT_FALSE(Owned<GstMessage>(
      gst_bus_timed_pop_filtered(bus.get(), 50 * GST_MSECOND, GST_MESSAGE_ERROR)));
  gst_element_set_locked_state(demux.get(), FALSE);
  EXPECT_TRUE(
      Owned<GstMessage>(gst_bus_timed_pop_filtered(bus.get(), 20 * GST_SECOND, GST_MESSAGE_ERROR)));
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
}

/// Any byte of the header may be wrong: decodebin ends with EOS or an error.
TEST(AedatDemux, EndsWhereTheHeaderIsDamaged) {
  const auto ends = [](Bytes bytes, std::size_t at) {
    bytes[at] = 0x7f;
    const File file(bytes);
    EXPECT_NE(decoded(file.path()), GST_MESSAGE_UNKNOWN) << at;
  };
  const auto made = aedat4_with_frames(steady_events(100'000, 70), PixelFormat::grey8, 3);
  for (std::size_t at = 0; at < 200; at += 3) ends(made, at);
  const auto recorded = eventcamera::shared_data::events_file(davis);
  for (const std::size_t at : {11, 17, 33, 110, 111, 112, 3123})
    if (!recorded.empty()) ends(recorded, at);
}

TEST(AedatDemux, SaysWhereAFileHasNoEvents) {
  const File empty(eventcamera::aedat_files::aedat4_header(""));
  Player player(empty.path());
  EXPECT_FALSE(player.play());
  EXPECT_NE(player.error.find("neither events nor frames"), std::string::npos) << player.error;
  // There is a stream of events here, though it is empty.
  const File silent(aedat4({}));
  Player other(silent.path());
  EXPECT_TRUE(other.play()) << other.error;
  EXPECT_EQ(other.track("events_0").eos, 1U);
}

TEST(AedatDemux, PlaysAgainAfterAStop) {
  const auto events = steady_events(500'000, 100);
  const File file(aedat4_with_frames(events, PixelFormat::grey8, 10));
  for (const char* between : {"", "identity"}) {
    Player player(file.path(), between);
    for (int times = 0; times < 3; ++times) {
      ASSERT_TRUE(player.play()) << player.error;
      EXPECT_EQ(player.track("events_0").events.size(), events.size());
      EXPECT_EQ(player.track("video_0").pictures.size(), 10U);
      player.stop();
    }
  }
}

TEST(AedatDemux, GoesThroughAllStates) {
  gst_init(nullptr, nullptr);
  for (const char* name : {"aedatdemux", "aedatmux"}) {
    Owned<GstElement> element(gst_element_factory_make(name, nullptr));
    ASSERT_TRUE(element);
    for (int times = 0; times < 3; ++times)
      for (const auto state : {GST_STATE_READY, GST_STATE_PAUSED, GST_STATE_PLAYING,
                               GST_STATE_PAUSED, GST_STATE_READY, GST_STATE_NULL})
        EXPECT_NE(gst_element_set_state(element.get(), state), GST_STATE_CHANGE_FAILURE);
  }
}

/// After a flush in push mode, a demuxer starts over at the start of the file.
TEST(AedatDemux, BeginsAnewAfterAFlush) {
  gst_init(nullptr, nullptr);
  const auto events = steady_events(200'000, 100);
  const auto bytes = aedat4(events);
  const Owned<GstHarness> h(gst_harness_new_with_padnames("aedatdemux", "sink", nullptr));
  gst_harness_set_src_caps_str(h.get(), "application/x-aedat, version=(int)4");
  static std::size_t count;
  count = 0;
  g_signal_connect(h->element, "pad-added",
                   G_CALLBACK(+[](GstElement*, GstPad* pad, GstHarness* harness) {
                     gst_harness_add_element_src_pad(harness, pad);
                   }),
                   h.get());
  const auto push = [&](std::size_t size) {
    return gst_harness_push(h.get(), gst_buffer_new_memdup(bytes.data(), size));
  };
  EXPECT_EQ(push(bytes.size() / 2), GST_FLOW_OK);
  EXPECT_TRUE(gst_harness_push_event(h.get(), gst_event_new_flush_start()));
  EXPECT_TRUE(gst_harness_push_event(h.get(), gst_event_new_flush_stop(TRUE)));
  while (Buffer(gst_harness_try_pull(h.get()))) continue;
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_BYTES);
  EXPECT_TRUE(gst_harness_push_event(h.get(), gst_event_new_segment(&segment)));
  EXPECT_EQ(push(bytes.size()), GST_FLOW_OK);
  EXPECT_TRUE(gst_harness_push_event(h.get(), gst_event_new_eos()));
  while (const Buffer buffer{gst_harness_try_pull(h.get())})
    count += events_of(buffer.get()).size();
  EXPECT_EQ(count, events.size());
}

/* aedatmux */

struct Content {
  Events events;
  std::vector<std::pair<Microseconds, Bytes>> pictures;
  bool table = false;
  std::vector<eventcamera::StreamInfo> streams;
  Aedat4Compression compression = Aedat4Compression::none;
};

/// Content of a file as read by the decoder alone.
Content content_of(const Bytes& bytes) {
  Content content;
  Aedat4Decoder decoder;
  decoder.push(bytes);
  decoder.finish();
  while (const auto item = decoder.next()) {
    if (const auto* const events = std::get_if<EventItem>(&*item)) {
      content.events.insert(content.events.end(), events->events.begin(), events->events.end());
    } else if (const auto* const picture = std::get_if<FrameItem>(&*item)) {
      const auto& f = picture->frame;
      content.pictures.emplace_back(f.t, Bytes(f.pixels, f.pixels + f.height * f.stride));
    }
  }
  EXPECT_EQ(decoder.corruption().places, 0U) << decoder.corruption().first;
  content.table = decoder.table_at().has_value();
  content.streams = decoder.streams();
  content.compression = decoder.compression();
  return content;
}

bool run(const std::string& launch) {
  gst_init(nullptr, nullptr);
  GError* error = nullptr;
  const Owned<GstElement> pipeline(gst_parse_launch(launch.c_str(), &error));
  EXPECT_EQ(error, nullptr) << error->message;
  const Owned<GstBus> bus(gst_element_get_bus(pipeline.get()));
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const Owned<GstMessage> message(
      gst_bus_timed_pop_filtered(bus.get(), 20 * GST_SECOND,
                                 static_cast<GstMessageType>(GST_MESSAGE_EOS | GST_MESSAGE_ERROR)));
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  if (message && GST_MESSAGE_TYPE(message.get()) == GST_MESSAGE_ERROR)
    ADD_FAILURE() << text_of(message.get());
  return message && GST_MESSAGE_TYPE(message.get()) == GST_MESSAGE_EOS;
}

TEST(AedatMux, WritesWhatTheDemuxerReads) {
  const auto events = steady_events(1'500'000, 70);
  const char* const compressions[] = {"none", "lz4", "lz4-high", "zstd", "zstd-high"};
  const PixelFormat formats[] = {PixelFormat::grey8, PixelFormat::grey16, PixelFormat::bgr,
                                 PixelFormat::bgra, PixelFormat::grey8};
  for (std::size_t i = 0; i < 5; ++i) {
    SCOPED_TRACE(compressions[i]);
    const File in(aedat4_with_frames(events, formats[i], 30));
    const File out{Bytes{}};
    ASSERT_TRUE(run("filesrc location=" + in_quotes(in.path()) +
                    " ! aedatdemux name=d  d.events_0 ! queue ! m.events  d.video_0 ! queue ! "
                    "m.video  aedatmux name=m compression=" +
                    compressions[i] + " ! filesink location=" + in_quotes(out.path())));
    const auto before = content_of(in.bytes());
    const auto after = content_of(out.bytes());
    EXPECT_TRUE(after.table);
    EXPECT_EQ(static_cast<std::size_t>(after.compression), i);
    EXPECT_EQ(after.streams.front().size, sensor);
    EXPECT_TRUE(after.events == shifted(before.events, 3'000));
    ASSERT_EQ(after.pictures.size(), before.pictures.size());
    for (std::size_t k = 0; k < after.pictures.size(); ++k) {
      EXPECT_EQ(after.pictures[k].first, before.pictures[k].first + 3'000);
      EXPECT_TRUE(after.pictures[k].second == before.pictures[k].second);
    }
    // Duration and seek positions come from the table.
    Player player(out.path());
    player.preroll();
    EXPECT_EQ(player.duration(), (before.events.back().t + 3'001) * 1000);
    ASSERT_TRUE(player.seek(GST_SECOND));
    ASSERT_TRUE(player.play());
    EXPECT_TRUE(player.track("events_0").events == from(after.events, 1'000'000));
  }
}

TEST(AedatMux, KeepsTheTimesOfAFile) {
  const auto events = steady_events(300'000, 70, of_1970 + 123'457);
  const File in(aedat4_with_frames(events, PixelFormat::grey8, 5));
  const File out{Bytes{}};
  ASSERT_TRUE(
      run("filesrc location=" + in_quotes(in.path()) +
          " ! aedatdemux name=d  d.events_0 ! queue ! m.events  d.video_0 ! queue ! m.video  "
          "aedatmux name=m ! filesink location=" +
          in_quotes(out.path())));
  const auto before = content_of(in.bytes());
  const auto after = content_of(out.bytes());
  EXPECT_TRUE(after.events == before.events);
  EXPECT_TRUE(after.pictures == before.pictures);
}

TEST(AedatMux, KeepsTheExposureTimesOfFrames) {
  const auto events = steady_events(100'000, 70, of_1970);
  const Bytes pixels(5 * 3, 7);
  const auto t = of_1970 + 50'123;
  Aedat4Encoder encoder({sensor, "", Aedat4Compression::none, true, true});
  Bytes bytes;
  encoder.encode(events, bytes);
  encoder.encode(Frame{t, t - 900, t + 40, t - 800, t - 300, PixelFormat::grey8, 5, 3, 17, 11,
                       pixels.data(), 5},
                 bytes);
  const File in(finished(encoder, bytes));
  const File out{Bytes{}};
  ASSERT_TRUE(run("filesrc location=" + in_quotes(in.path()) +
                  " ! aedatdemux name=d  d.events_0 ! queue ! m.  d.video_0 ! queue ! m.  aedatmux "
                  "name=m ! filesink location=" +
                  in_quotes(out.path())));
  const auto copy = out.bytes();
  Aedat4Decoder decoder;
  decoder.push(copy);
  int frames = 0;
  while (const auto item = decoder.next()) {
    const auto* const some = std::get_if<FrameItem>(&*item);
    if (some == nullptr) continue;
    ++frames;
    EXPECT_EQ(some->frame.t, t);
    EXPECT_EQ(some->frame.begin, t - 900);
    EXPECT_EQ(some->frame.end, t + 40);
    EXPECT_EQ(some->frame.exposure_begin, t - 800);
    EXPECT_EQ(some->frame.exposure_end, t - 300);
    EXPECT_EQ(some->frame.x, 17);
    EXPECT_EQ(some->frame.y, 11);
  }
  EXPECT_EQ(frames, 1);
}

TEST(AedatMux, KeepsTriggersAndImuSamples) {
  using eventcamera::ImuSample;
  using eventcamera::Trigger;
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
  const File in(finished(encoder, bytes));
  for (const char* between : {"", "identity ! "}) {
    const File out{Bytes{}};
    ASSERT_TRUE(run("filesrc location=" + in_quotes(in.path()) + " ! " + between +
                    "aedatdemux ! queue ! aedatmux ! filesink location=" + in_quotes(out.path())));
    const auto copy = out.bytes();
    Aedat4Decoder decoder;
    decoder.push(copy);
    decoder.finish();
    std::vector<Trigger> triggers_found;
    std::vector<ImuSample> samples_found;
    Events events_found;
    while (const auto item = decoder.next()) {
      if (const auto* const of_triggers = std::get_if<eventcamera::TriggerItem>(&*item))
        triggers_found.insert(triggers_found.end(), of_triggers->triggers.begin(),
                              of_triggers->triggers.end());
      else if (const auto* const imu = std::get_if<eventcamera::ImuItem>(&*item))
        samples_found.insert(samples_found.end(), imu->samples.begin(), imu->samples.end());
      else if (const auto* const some = std::get_if<EventItem>(&*item))
        events_found.insert(events_found.end(), some->events.begin(), some->events.end());
    }
    EXPECT_EQ(triggers_found, triggers);
    EXPECT_EQ(samples_found, samples);
    EXPECT_EQ(events_found, events);
    EXPECT_EQ(decoder.corruption().places, 0U) << decoder.corruption().first;
  }
}

TEST(AedatMux, KeepsTriggersOfOtherFormats) {
  using eventcamera::Trigger;
  const auto events = steady_events(300'000, 70);
  const std::vector<Trigger> triggers{{200'000, 0, true}, {200'070, 1, true}, {250'000, 0, false}};
  const auto encoder =
      eventcamera::make_prophesee_raw_encoder(eventcamera::EvtFormat::evt3, sensor);
  Bytes bytes;
  auto rest = std::span(events);
  for (const auto& trigger : triggers) {
    const auto end = std::ranges::upper_bound(rest, trigger.t, {}, &AbsoluteEvent::t);
    encoder->encode(rest.first(static_cast<std::size_t>(end - rest.begin())), bytes);
    encoder->encode_trigger(trigger, bytes);
    rest = rest.subspan(static_cast<std::size_t>(end - rest.begin()));
  }
  encoder->encode_trigger({rest.front().t, 9, true}, bytes);  // AEDAT 4 has no such input
  encoder->encode(rest, bytes);
  const File in(bytes);
  const File out{Bytes{}};
  ASSERT_TRUE(run("filesrc location=" + in_quotes(in.path()) +
                  " ! evtdec ! aedatmux ! filesink location=" + in_quotes(out.path())));
  const auto copy = out.bytes();
  Aedat4Decoder decoder;
  decoder.push(copy);
  std::vector<Trigger> found;
  while (const auto item = decoder.next())
    if (const auto* const some = std::get_if<eventcamera::TriggerItem>(&*item))
      found.insert(found.end(), some->triggers.begin(), some->triggers.end());
  EXPECT_EQ(found, triggers);
  EXPECT_TRUE(content_of(copy).events == events);
}

TEST(AedatMux, LearnsFromItsCapsWhatComesToAPad) {
  const auto events = steady_events(300'000, 70, of_1970 + 123'457);
  const File in(aedat4_with_frames(events, PixelFormat::grey8, 5));
  const auto before = content_of(in.bytes());
  const std::string from = "filesrc location=" + in_quotes(in.path()) + " ! aedatdemux name=d  ";
  const std::string to = "  aedatmux name=m ! filesink location=";
  for (const char* links : {"d.events_0 ! queue ! m.  d.video_0 ! queue ! m.",
                            "d.video_0 ! queue ! m.  d.events_0 ! queue ! m."}) {
    SCOPED_TRACE(links);
    const File out{Bytes{}};
    ASSERT_TRUE(run(from + links + to + in_quotes(out.path())));
    const auto after = content_of(out.bytes());
    EXPECT_TRUE(after.events == before.events);
    EXPECT_TRUE(after.pictures == before.pictures);
  }

  const Owned<GstElement> pipeline(gst_parse_launch(
      (from + "d.events_0 ! tee name=t  t. ! queue ! m.  t. ! queue ! m.  aedatmux "
              "name=m ! fakesink")
          .c_str(),
      nullptr));
  const Owned<GstBus> bus(gst_element_get_bus(pipeline.get()));
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const Owned<GstMessage> message(
      gst_bus_timed_pop_filtered(bus.get(), 20 * GST_SECOND, GST_MESSAGE_ERROR));
  ASSERT_TRUE(message);
  EXPECT_EQ(
      text_of(message.get()),
      "Cannot write two streams of events into one file; link one stream of events and one of "
      "video.");
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
}

TEST(AedatMux, NeedsNoSeeking) {
  const auto events = steady_events(300'000, 70);
  const File in(aedat4(events));
  const File out{Bytes{}};
  // The branch of the tee continues as a stream.
  ASSERT_TRUE(run("filesrc location=" + in_quotes(in.path()) +
                  " ! aedatdemux ! aedatmux ! aedatdemux ! aedatmux compression=none ! filesink "
                  "location=" +
                  in_quotes(out.path())));
  const auto content = content_of(out.bytes());
  EXPECT_TRUE(content.events == events);
  EXPECT_EQ(content.streams.front().source, "a camera");
}

GstBuffer* events_buffer(GstClockTime pts, const std::vector<GstEventCameraEvent>& events) {
  gst_init(nullptr, nullptr);
  GstBuffer* buffer =
      gst_buffer_new_memdup(events.data(), events.size() * sizeof(GstEventCameraEvent));
  GST_BUFFER_PTS(buffer) = pts;
  GST_BUFFER_DURATION(buffer) = 10 * GST_MSECOND;
  return buffer;
}

constexpr const char* xytp =
    "application/x-event-camera, format=XYTP, width=346, height=260, framerate=0/1";

/// Output up to EOS that is not pulled yet.
Bytes rest_of_file(GstHarness* h) {
  Bytes bytes;
  bool ended = false;
  while (!ended) {
    const Owned<GstEvent> event(gst_harness_pull_event(h));
    if (!event) break;
    ended = GST_EVENT_TYPE(event.get()) == GST_EVENT_EOS;
  }
  EXPECT_TRUE(ended);
  while (const Buffer buffer{gst_harness_try_pull(h)}) {
    const auto piece = bytes_of(buffer.get());
    bytes.insert(bytes.end(), piece.begin(), piece.end());
  }
  return bytes;
}

/// Pushes buffers into the muxer and returns its output.
Bytes muxed(const std::vector<GstBuffer*>& buffers, std::vector<std::string>* warnings = nullptr) {
  const Owned<GstHarness> h(gst_harness_new_with_padnames("aedatmux", "events", "src"));
  const Owned<GstBus> bus(gst_bus_new());
  gst_element_set_bus(h->element, bus.get());
  gst_harness_set_src_caps_str(h.get(), xytp);
  for (GstBuffer* buffer : buffers) EXPECT_EQ(gst_harness_push(h.get(), buffer), GST_FLOW_OK);
  EXPECT_TRUE(gst_harness_push_event(h.get(), gst_event_new_eos()));
  const auto bytes = rest_of_file(h.get());
  while (const Owned<GstMessage> message{gst_bus_pop_filtered(bus.get(), GST_MESSAGE_WARNING)})
    if (warnings != nullptr) warnings->push_back(text_of(message.get()));
  gst_element_set_bus(h->element, nullptr);
  return bytes;
}

TEST(AedatMux, WritesTheTimesOfTheStream) {
  const auto content =
      content_of(muxed({events_buffer(5 * GST_SECOND + 999, {{0, 1, 2}, {7, 3, 0x8004}}),
                        events_buffer(5 * GST_SECOND + 10 * GST_MSECOND, {{9'999, 345, 259}})}));
  const Events expected{AbsoluteEvent::at(1, 2, 5'000'000, Polarity::off),
                        AbsoluteEvent::at(3, 4, 5'000'007, Polarity::on),
                        AbsoluteEvent::at(345, 259, 5'019'999, Polarity::off)};
  EXPECT_TRUE(content.events == expected);
  EXPECT_FALSE(content.table) << "nothing could seek to where the header tells of it";
}

TEST(AedatMux, LeavesOutWhatDoesNotFit) {
  std::vector<std::string> warnings;
  GstBuffer* const timeless = events_buffer(0, {{0, 1, 1}});
  GST_BUFFER_PTS(timeless) = GST_CLOCK_TIME_NONE;
  const auto content =
      content_of(muxed({events_buffer(GST_SECOND, {{0, 346, 2}, {1, 3, 260}, {5, 6, 7}, {4, 6, 7}}),
                        timeless, events_buffer(0, {{0, 1, 1}}), gst_buffer_new_memdup("123", 3),
                        events_buffer(2 * GST_SECOND, {{0, 1, 1}})},
                       &warnings));
  EXPECT_TRUE((content.events == Events{AbsoluteEvent::at(6, 7, 1'000'005, Polarity::off),
                                        AbsoluteEvent::at(1, 1, 2'000'000, Polarity::off)}));
  ASSERT_EQ(warnings.size(), 3U);
  EXPECT_TRUE(warnings[0].starts_with("Left out a buffer without a timestamp"));
  EXPECT_TRUE(warnings[1].starts_with("Left out 2 events earlier than"));
  EXPECT_TRUE(warnings[2].starts_with("Left out 2 events outside"));
}

TEST(AedatMux, WritesFramesInTheSizeOfTheirCaps) {
  const Owned<GstHarness> h(gst_harness_new_with_padnames("aedatmux", "video", "src"));
  gst_harness_set_src_caps_str(h.get(),
                               "video/x-raw, format=GRAY8, width=4, height=3, framerate=0/1");
  // Rows of 16 bytes; the meta's frame is larger than the memory.
  Bytes pixels(3 * 16);
  std::iota(pixels.begin(), pixels.end(), std::uint8_t{0});
  GstBuffer* const buffer = gst_buffer_new_memdup(pixels.data(), pixels.size());
  gsize offsets[GST_VIDEO_MAX_PLANES] = {0};
  gint strides[GST_VIDEO_MAX_PLANES] = {16};
  gst_buffer_add_video_meta_full(buffer, GST_VIDEO_FRAME_FLAG_NONE, GST_VIDEO_FORMAT_GRAY8, 16, 999,
                                 1, offsets, strides);
  GST_BUFFER_PTS(buffer) = GST_SECOND;
  EXPECT_EQ(gst_harness_push(h.get(), buffer), GST_FLOW_OK);
  EXPECT_TRUE(gst_harness_push_event(h.get(), gst_event_new_eos()));
  const auto bytes = rest_of_file(h.get());
  Aedat4Decoder decoder;
  decoder.push(bytes);
  int frames = 0;
  while (const auto item = decoder.next()) {
    const auto* const some = std::get_if<FrameItem>(&*item);
    if (some == nullptr) continue;
    ++frames;
    ASSERT_EQ(some->frame.width, 4);
    ASSERT_EQ(some->frame.height, 3);
    for (int y = 0; y < 3; ++y)
      for (int x = 0; x < 4; ++x)
        EXPECT_EQ(some->frame.pixels[y * some->frame.stride + x], 16 * y + x);
  }
  EXPECT_EQ(frames, 1);
}

TEST(AedatMux, WritesAnewAfterAFlush) {
  gst_init(nullptr, nullptr);
  const Owned<GstHarness> h(gst_harness_new_with_padnames("aedatmux", "events", "src"));
  gst_harness_set_src_caps_str(h.get(), xytp);
  EXPECT_EQ(gst_harness_push(h.get(), events_buffer(GST_SECOND, {{0, 1, 2}})), GST_FLOW_OK);
  EXPECT_TRUE(Buffer(gst_harness_pull(h.get())));  // the header, so the file has begun
  EXPECT_TRUE(gst_harness_push_event(h.get(), gst_event_new_flush_start()));
  EXPECT_TRUE(gst_harness_push_event(h.get(), gst_event_new_flush_stop(TRUE)));
  while (Buffer(gst_harness_try_pull(h.get()))) continue;
  // The running time of the continued stream is 0 again.
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  segment.start = segment.time = 500 * GST_MSECOND;
  EXPECT_TRUE(gst_harness_push_event(h.get(), gst_event_new_segment(&segment)));
  EXPECT_EQ(gst_harness_push(h.get(), events_buffer(600 * GST_MSECOND, {{0, 3, 4}, {7, 5, 6}})),
            GST_FLOW_OK);
  EXPECT_TRUE(gst_harness_push_event(h.get(), gst_event_new_eos()));
  const auto content = content_of(rest_of_file(h.get()));
  EXPECT_TRUE((content.events == Events{AbsoluteEvent::at(3, 4, 600'000, Polarity::off),
                                        AbsoluteEvent::at(5, 6, 600'007, Polarity::off)}));
}

TEST(AedatMux, HasOnePadOfAKind) {
  gst_init(nullptr, nullptr);
  const Owned<GstElement> mux(gst_element_factory_make("aedatmux", nullptr));
  GstPad* const events = gst_element_request_pad_simple(mux.get(), "events");
  GstPad* const video = gst_element_request_pad_simple(mux.get(), "video");
  ASSERT_NE(events, nullptr);
  ASSERT_NE(video, nullptr);
  GstPadTemplate* const of_events = gst_pad_get_pad_template(events);
  EXPECT_EQ(gst_element_request_pad(mux.get(), of_events, nullptr, nullptr), nullptr);
  gst_object_unref(of_events);
  for (GstPad* pad : {events, video}) {
    gst_element_release_request_pad(mux.get(), pad);
    gst_object_unref(pad);
  }
}

}  // namespace
