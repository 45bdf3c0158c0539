// SPDX-License-Identifier: LGPL-2.1-or-later
// evtparse: what V4L2 drivers, serial lines and sockets are described to deliver, made here; no
// camera. tests/formats/word_scanner_test.cpp has the words, this the element.
#include <gst/app/gstappsrc.h>

#include "src/formats/evt/raw.hpp"
#include "tests/elements/pipeline.hpp"
#include "tests/elements/recording_files.hpp"

namespace {

using namespace harness;
using namespace eventcamera;
using Bytes = std::vector<std::uint8_t>;
using Events = std::vector<AbsoluteEvent>;

constexpr SensorSize sensor{320, 320};
constexpr auto size = " width=320 height=320 ";
constexpr auto padded_caps = "video/x-raw,format=GRAY8,width=4096,height=4,framerate=100/1";
constexpr std::size_t buffer_size = 4096 * 4;

/// Events 37 us apart, from 3 s on.
Events some_events(int count, Microseconds start = 3'000'000) {
  Events events;
  for (int i = 0; i < count; ++i)
    events.push_back(AbsoluteEvent::at(i % 320, i / 7 % 320, start + 37 * i,
                                       i % 3 == 0 ? Polarity::off : Polarity::on));
  return events;
}

Bytes words_of(const Events& events, EvtFormat format) {
  const auto encoder = make_evt_encoder(format, sensor);
  Bytes bytes;
  encoder->encode(events, bytes);
  return bytes;
}

/// A camera that sends the events of 10 ms in each transfer.
class Camera {
 public:
  explicit Camera(EvtFormat format) : encoder_(make_evt_encoder(format, sensor)) {}

  /// The next transfer; `end` is the camera's time then.
  Bytes next(const Events& events, Microseconds end) {
    Bytes words;
    const auto first = events.begin() + static_cast<std::ptrdiff_t>(sent_);
    const auto last = std::ranges::find_if(
        first, events.end(), [&](const AbsoluteEvent& event) { return event.t >= end; });
    encoder_->encode(std::span(first, last), words);
    sent_ = static_cast<std::size_t>(last - events.begin());
    return words;
  }

 private:
  std::unique_ptr<Encoder> encoder_;
  std::size_t sent_ = 0;
};

/// A buffer as of v4l2src: EVT3 words, the end marker, and the bytes of an earlier transfer.
GstBuffer* padded(Bytes words, GstClockTime pts, guint64 number) {
  words.push_back(0x19);
  words.push_back(0xe0);
  words.resize(buffer_size, 0x26);
  GstBuffer* const buffer = gst_buffer_new_memdup(words.data(), words.size());
  GST_BUFFER_PTS(buffer) = pts;
  GST_BUFFER_OFFSET(buffer) = number;
  return buffer;
}

/// Events that a pipeline reads from buffers.
class Reading : public Player {
 public:
  Reading(const std::string& caps, const std::string& settings)
      : Player("appsrc name=camera format=time caps=" + in_quotes(caps) +
               " ! evtparse name=parse " + settings + " ! evtdec name=decoder") {}

  void push(GstBuffer* buffer) { gst_app_src_push_buffer(GST_APP_SRC((*this)["camera"]), buffer); }
  bool finish() {
    gst_app_src_end_of_stream(GST_APP_SRC((*this)["camera"]));
    return play();
  }
};

TEST(EvtParse, ReadsPaddedBuffersOfV4l2) {
  const auto sent = some_events(20'000);
  const GstClockTime impossible[] = {0, GST_CLOCK_TIME_NONE, G_MAXUINT64 - 1, G_MAXINT64,
                                     GstClockTime{1} << 62};
  for (const bool has_wrong_times : {true, false}) {
    Camera camera(EvtFormat::evt3);
    Reading reading(padded_caps, "format=EVT3" + std::string(size));
    for (int i = 0; i < 80; ++i) {
      const bool is_wrong = has_wrong_times && i % 4 == 3;
      reading.push(padded(camera.next(sent, 3'010'000 + 10'000 * i),
                          is_wrong ? impossible[i / 4 % 5] : (i + 1) * 10 * GST_MSECOND,
                          static_cast<guint64>(i)));
    }
    EXPECT_TRUE(reading.finish()) << reading.error;
    EXPECT_EQ(reading.events.size(), sent.size());
    if (has_wrong_times) continue;
    EXPECT_EQ(reading.events, sent);
    EXPECT_EQ(reading.stat("parse", "events"), sent.size());
    EXPECT_EQ(reading.stat("parse", "buffers"), 80U);
    EXPECT_EQ(reading.stat("parse", "lost-bytes"), 0U);
    EXPECT_EQ(reading.stat("parse", "gaps"), 0U);
    EXPECT_EQ(reading.stat("decoder", "corrupt-places"), 0U);
  }
}

TEST(EvtParse, CountsTheBuffersThatTheDriverDropped) {
  const auto sent = some_events(20'000);
  Camera camera(EvtFormat::evt3);
  Reading reading(padded_caps, "format=EVT3" + std::string(size));
  std::size_t dropped = 0;
  for (int i = 0; i < 80; ++i) {
    const auto before = 3'000'000 + 10'000 * i;
    const auto words = camera.next(sent, before + 10'000);
    if (i == 20 || i == 21 || i == 50)
      dropped += static_cast<std::size_t>(std::ranges::count_if(
          sent, [&](const auto& event) { return event.t >= before && event.t < before + 10'000; }));
    else
      reading.push(padded(words, (i + 1) * 10 * GST_MSECOND, static_cast<guint64>(i)));
  }
  EXPECT_TRUE(reading.finish()) << reading.error;
  EXPECT_EQ(reading.stat("parse", "lost-buffers"), 3U);
  EXPECT_EQ(reading.stat("parse", "gaps"), 2U);
  EXPECT_EQ(reading.events.size() + dropped + reading.stat("parse", "lost-events"), sent.size());
  EXPECT_TRUE(
      std::ranges::includes(sent, reading.events, {}, &AbsoluteEvent::t, &AbsoluteEvent::t));
}

TEST(EvtParse, LeavesOutThePaddingOfRows) {
  const auto sent = some_events(2'000);
  const auto words = words_of(sent, EvtFormat::evt3);
  constexpr gsize width = 512;
  constexpr gsize stride = 576;
  constexpr guint height = 40;
  Bytes rows(stride * height, 0xff);
  auto marked = words;
  marked.insert(marked.end(), {0x19, 0xe0});
  ASSERT_LT(marked.size(), width * height);
  for (gsize at = 0; at < marked.size(); ++at) rows[at / width * stride + at % width] = marked[at];
  GstBuffer* const buffer = gst_buffer_new_memdup(rows.data(), rows.size());
  add_video_meta(buffer, GST_VIDEO_FORMAT_GRAY8, width, height, {{0, stride}});
  Reading reading("video/x-raw,format=GRAY8,width=512,height=40,framerate=0/1",
                  "format=EVT3" + std::string(size));
  reading.push(buffer);
  EXPECT_TRUE(reading.finish()) << reading.error;
  EXPECT_EQ(reading.events, sent);
}

TEST(EvtParse, TakesFormatAndOrderFromTheFourcc) {
  const auto sent = some_events(2'000);
  const std::pair<const char*, EvtFormat> formats[] = {{"PSEE", EvtFormat::evt2},
                                                       {"PSE1", EvtFormat::evt21_legacy},
                                                       {"PSE2", EvtFormat::evt21},
                                                       {"PSE3", EvtFormat::evt3}};
  for (const auto& [code, format] : formats) {
    SCOPED_TRACE(code);
    const auto words = words_of(sent, format);
    Reading reading("video/x-camera-words,width=320,height=320,format=" + std::string(code), "");
    reading.push(gst_buffer_new_memdup(words.data(), words.size()));
    EXPECT_TRUE(reading.finish()) << reading.error;
    EXPECT_EQ(reading.events, sent);
  }
}

TEST(EvtParse, ReadsASerialLine) {
  const auto sent = some_events(20'000);
  for (const auto& [name, format, missed] :
       {std::tuple{"EVT2", EvtFormat::evt2, 0},
        {"EVT3", EvtFormat::evt3, 0},
        {"EVT3", EvtFormat::evt3, 1001}}) {  // joined amid a word
    auto words = words_of(sent, format);
    words.erase(words.begin(), words.begin() + missed);
    const TemporaryFile line(words);
    Player player("filesrc blocksize=500 location=" + in_quotes(line.path()) +
                  " ! evtparse name=parse format=" + name + size + "! evtdec");
    EXPECT_TRUE(player.play()) << player.error;
    EXPECT_EQ(player.events.size(), player.stat("parse", "events"));
    EXPECT_GE(player.events.size(), sent.size() - static_cast<std::size_t>(missed) / 2);
    EXPECT_EQ(player.events.back(), sent.back());
    EXPECT_TRUE(
        std::ranges::includes(sent, player.events, {}, &AbsoluteEvent::t, &AbsoluteEvent::t));
    if (missed == 0) {
      EXPECT_EQ(player.events, sent);
      EXPECT_EQ(player.stat("parse", "lost-bytes"), 0U);
    }
  }
}

/// evtparse alone, fed with padded buffers.
struct Parse : Harness {
  explicit Parse(const std::string& settings = "format=EVT3")
      : Harness("evtparse" + std::string(size) + settings) {
    gst_harness_set_src_caps_str(get(), padded_caps);
  }

  /// Running time of a time of the camera.
  GstClockTime running(GstClockTime pts) {
    while (const Owned<GstEvent> event{gst_harness_try_pull_event(get())})
      if (GST_EVENT_TYPE(event.get()) == GST_EVENT_SEGMENT)
        gst_event_copy_segment(event.get(), &segment);
    return gst_segment_to_running_time(&segment, GST_FORMAT_TIME, pts);
  }

  GstSegment segment{};
};

TEST(EvtParse, MapsADriftingClockToRunningTime) {
  constexpr double drift = 200e-6;
  const auto sent = some_events(1'620'000);  // a minute
  Camera camera(EvtFormat::evt3);
  Parse parse;
  gint64 worst = 0;
  for (int i = 1; i <= 5900; ++i) {
    // The camera's clock is slow; transfers are late by up to 6 ms.
    const auto now = i * 10 * GST_MSECOND;
    const auto slow = static_cast<Microseconds>(static_cast<double>(now / 1000) * (1 - drift));
    parse.push(padded(camera.next(sent, 3'000'000 + slow),
                      now + static_cast<GstClockTime>(i % 4) * 2 * GST_MSECOND,
                      static_cast<guint64>(i)));
    while (const auto buffer = parse.pull()) {
      const auto end = GST_BUFFER_PTS(buffer.get()) + GST_BUFFER_DURATION(buffer.get());
      const auto error = GST_CLOCK_DIFF(now, parse.running(end));
      if (i > 10) worst = std::max<gint64>(worst, std::abs(error));
    }
  }
  EXPECT_LT(worst, static_cast<gint64>(2 * GST_MSECOND));
  GstStructure* stats = nullptr;
  g_object_get(parse.element(), "stats", &stats, nullptr);
  gdouble ppm = 0;
  gst_structure_get_double(stats, "clock-drift", &ppm);
  EXPECT_NEAR(ppm, 200, 5);
  gint64 offset = 0;
  gst_structure_get_int64(stats, "clock-offset", &offset);
  EXPECT_NEAR(static_cast<double>(offset), -3e9 + 59e9 * drift, 2e6);
  gst_structure_free(stats);
  EXPECT_GE(stat_of(parse.element(), "clock-corrections"), 8U);
  EXPECT_LE(stat_of(parse.element(), "clock-corrections"), 16U);
  // One transfer, and its delay.
  EXPECT_GE(gst_harness_query_latency(parse.get()), 10 * GST_MSECOND);
  EXPECT_LE(gst_harness_query_latency(parse.get()), 20 * GST_MSECOND);
}

TEST(EvtParse, StartsOverAfterAFlush) {
  const auto sent = some_events(2'000);
  const auto words = words_of(sent, EvtFormat::evt3);
  Parse parse;
  parse.push(padded(words, GST_SECOND, 1));
  EXPECT_TRUE(parse.pull());
  EXPECT_EQ(parse.out_caps(),
            "application/x-event-camera, format=(string)EVT3, width=(int)320, height=(int)320, "
            "framerate=(fraction)0/1");
  flush({parse.get()});
  push_segment(parse.get());
  parse.push(padded(words, 2 * GST_SECOND, 1));
  const auto again = parse.pull();
  ASSERT_TRUE(again);
  EXPECT_TRUE(GST_BUFFER_IS_DISCONT(again.get()));
  EXPECT_EQ(stat_of(parse.element(), "events"), 2 * sent.size());
}

TEST(EvtParse, PassesOnTheLastWordsBeforeOtherCapsAndTheEnd) {
  const auto sent = some_events(2'000);
  Harness parse("evtparse" + std::string(size));
  gst_harness_set_src_caps_str(parse.get(),
                               "application/x-event-camera,format=EVT2,width=320,height=320");
  const auto push = [&](EvtFormat format) {
    const auto words = words_of(sent, format);
    parse.push(gst_buffer_new_memdup(words.data(), words.size()));
  };
  push(EvtFormat::evt2);
  gst_harness_set_src_caps_str(parse.get(),
                               "application/x-event-camera,format=EVT3,width=320,height=320");
  push(EvtFormat::evt3);
  EXPECT_LT(stat_of(parse.element(), "events"), 2 * sent.size());
  push_eos(parse.get());
  EXPECT_EQ(stat_of(parse.element(), "events"), 2 * sent.size());
  EXPECT_EQ(stat_of(parse.element(), "lost-bytes"), 0U);
}

TEST(EvtParse, SaysWhatIsMissing) {
  Harness unknown("evtparse format=EVT3");
  gst_harness_set_src_caps_str(unknown.get(), padded_caps);
  EXPECT_TRUE(contains(unknown.error(), "Set format, width and height"));

  Parse wrong("format=EVT2");
  const auto words = words_of(some_events(50'000), EvtFormat::evt3);
  for (std::size_t at = 0; at + buffer_size <= words.size(); at += buffer_size)
    wrong.push(gst_buffer_new_memdup(words.data() + at, buffer_size));
  EXPECT_TRUE(contains(wrong.warning(), "not valid in this format"));
  EXPECT_EQ(wrong.warning(), "");
}

TEST(EvtParse, SaysAtTheEndThatThereWereNoEvents) {
  // Padding of Lucid's cameras, and too few zeros to be most of a camera's data.
  for (const auto& [bytes, has_events] : {std::pair{Bytes(4096, 0x99), false},
                                          {Bytes(4096, 0x00), false},
                                          {words_of(some_events(100), EvtFormat::evt3), true}}) {
    Harness parse("evtparse format=EVT3" + std::string(size));
    gst_harness_set_src_caps_str(parse.get(), "application/octet-stream");
    parse.push(gst_buffer_new_memdup(bytes.data(), bytes.size()));
    EXPECT_EQ(parse.warning(), "");
    push_eos(parse.get());
    EXPECT_EQ(parse.warning().starts_with("No events were found"), !has_events);
    EXPECT_EQ(parse.warning(), "");
  }
}

}  // namespace
