// SPDX-License-Identifier: LGPL-2.1-or-later
// Malformed buffers into every element that takes events or frames: each stream ends in EOS or in
// an error that says why, and a well-formed stream plays afterwards.
#include <gst/app/gstappsrc.h>

#include "tests/elements/element_lines.hpp"
#include "tests/elements/event_buffer.hpp"

namespace {

using namespace harness;
using namespace element_lines;
using eventcamera::Event;
using eventcamera::Polarity;

constexpr int width = 64;
constexpr int height = 48;
constexpr GstClockTime interval = 10 * GST_MSECOND;

/// Makes the buffers of streams, in the same order at every run.
class BufferMaker {
 public:
  GstBuffer* well_formed(GstClockTime pts, bool of_frames) {
    return of_frames ? frame(pts, width * height) : events(pts, false);
  }

  GstBuffer* hostile(GstClockTime pts, bool of_frames) {
    GstBuffer* const buffer =
        of_frames
            ? frame(pts, static_cast<gsize>(one_in(4) ? below(2 * width * height) : width * height))
            : events(pts, true);
    if (of_frames && one_in(2)) add_any_video_meta(buffer);
    if (!of_frames && one_in(4))
      gst_buffer_set_size(buffer, below(static_cast<int>(gst_buffer_get_size(buffer)) + 1));
    if (one_in(3)) GST_BUFFER_PTS(buffer) = hostile_time(pts);
    if (one_in(3)) GST_BUFFER_DURATION(buffer) = one_in(2) ? GST_CLOCK_TIME_NONE : 0;
    if (one_in(10)) GST_BUFFER_FLAG_SET(buffer, GST_BUFFER_FLAG_DISCONT);
    if (one_in(10)) GST_BUFFER_FLAG_SET(buffer, GST_BUFFER_FLAG_GAP);
    return buffer;
  }

  int below(int end) { return std::uniform_int_distribution(0, end - 1)(random_); }
  bool one_in(int count) { return below(count) == 0; }

 private:
  /// Gaps between a second and hours are left out: all their pictures may be drawn, or written.
  GstClockTime hostile_time(GstClockTime pts) {
    const GstClockTime times[] = {GST_CLOCK_TIME_NONE,
                                  0,
                                  pts - std::min(pts, 5 * interval),
                                  pts + 50 * interval,
                                  1'700'000'000 * GST_SECOND,
                                  G_MAXINT64 - 1,
                                  G_MAXINT64,
                                  GST_CLOCK_TIME_NONE - 1};
    return times[below(static_cast<int>(std::size(times)))];
  }

  /// Hostile ones may be unsorted, outside the sensor, or past the end of the interval.
  GstBuffer* events(GstClockTime pts, bool hostile) {
    std::vector<Event> events;
    for (int count = below(200); count > 0; --count) {
      events.push_back(Event::at(below(width), below(height),
                                 static_cast<std::uint32_t>(below(10'000)),
                                 one_in(2) ? Polarity::on : Polarity::off));
      if (hostile && one_in(100)) events.back().t = static_cast<std::uint32_t>(below(500'000));
      if (hostile && one_in(50)) events.back().x = static_cast<std::uint16_t>(random_());
      if (hostile && one_in(50)) events.back().y_p = static_cast<std::uint16_t>(random_());
      if (hostile && one_in(150'000)) events.back().t = 0xffff'ffff;
    }
    if (!hostile || one_in(2)) std::ranges::sort(events, {}, &Event::t);
    return buffer_of(pts, events, interval);
  }

  GstBuffer* frame(GstClockTime pts, gsize size) {
    return filled(size, static_cast<guint8>(random_()), pts, interval);
  }

  void add_any_video_meta(GstBuffer* buffer) {
    const std::vector<Plane> planes{{static_cast<gsize>(below(100)), below(3 * width) - width}};
    add_video_meta(buffer, one_in(4) ? GST_VIDEO_FORMAT_NV12 : GST_VIDEO_FORMAT_GRAY8,
                   1 + below(2 * width), 1 + below(2 * height), planes);
  }

  std::mt19937 random_{1};  // NOLINT(bugprone-random-generator-seed): reproducible
};

void expect_text_and_cause(GstMessage* message) {
  GError* error = nullptr;
  gchar* cause = nullptr;
  if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_ERROR)
    gst_message_parse_error(message, &error, &cause);
  else
    gst_message_parse_warning(message, &error, &cause);
  EXPECT_GT(std::string_view(error->message).size(), 10U) << error->message;
  EXPECT_TRUE(cause != nullptr && *cause != '\0') << error->message;
  g_clear_error(&error);
  g_free(cause);
}

/// An element with an appsrc at each sink pad.
class Consumer {
 public:
  explicit Consumer(const Kind& kind) {
    std::string line = kind.launch();
    for (const auto& pad : kind.pads(GST_PAD_SINK))
      line += "  appsrc name=" + pad.name + " format=time ! it." + pad.name;
    pipeline_ = launched(line);
    for (const auto& pad : kind.pads(GST_PAD_SINK))
      inputs_.push_back(
          {Owned<GstElement>(gst_bin_get_by_name(GST_BIN(pipeline_.get()), pad.name.c_str())),
           pad.takes_frames()});
  }
  ~Consumer() { gst_element_set_state(pipeline_.get(), GST_STATE_NULL); }
  Consumer(const Consumer&) = delete;
  Consumer& operator=(const Consumer&) = delete;

  /// Plays a stream of 15 buffers. Returns how it ended: GST_MESSAGE_EOS or GST_MESSAGE_ERROR.
  GstMessageType play(BufferMaker& maker, bool hostile) {
    for (auto& input : inputs_) set_caps(input, 1);
    gst_element_set_state(pipeline_.get(), GST_STATE_PLAYING);
    const int rarity = 1 + maker.below(6);
    for (auto& input : inputs_) push(input, maker, hostile ? rarity : 0);
    GstMessageType end = GST_MESSAGE_UNKNOWN;
    while (end != GST_MESSAGE_EOS && end != GST_MESSAGE_ERROR) {
      const auto message =
          wait_for(pipeline_.get(), GST_MESSAGE_EOS | GST_MESSAGE_ERROR | GST_MESSAGE_WARNING);
      if (!message) return GST_MESSAGE_UNKNOWN;
      end = GST_MESSAGE_TYPE(message.get());
      if (end != GST_MESSAGE_EOS) expect_text_and_cause(message.get());
    }
    gst_element_set_state(pipeline_.get(), GST_STATE_NULL);
    return end;
  }

 private:
  struct Input {
    Owned<GstElement> source;
    bool takes_frames;
  };

  /// One in `rarity` buffers is hostile; none if it is 0.
  static void push(Input& input, BufferMaker& maker, int rarity) {
    GstAppSrc* const source = GST_APP_SRC(input.source.get());
    for (GstClockTime pts = 0; pts < 15 * interval; pts += interval) {
      const bool is_hostile = rarity > 0 && maker.one_in(rarity);
      if (is_hostile && maker.one_in(50)) set_caps(input, 2);
      gst_app_src_push_buffer(source, is_hostile ? maker.hostile(pts, input.takes_frames)
                                                 : maker.well_formed(pts, input.takes_frames));
    }
    gst_app_src_end_of_stream(source);
  }

  static void set_caps(Input& input, int scale) {
    const Owned<GstCaps> caps(gst_caps_from_string(input.takes_frames ? frame_caps : event_caps));
    gst_caps_set_simple(caps.get(), "width", G_TYPE_INT, width * scale, "height", G_TYPE_INT,
                        height * scale, nullptr);
    gst_app_src_set_caps(GST_APP_SRC(input.source.get()), caps.get());
  }

  Owned<GstElement> pipeline_;
  std::vector<Input> inputs_;
};

class EveryConsumer : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(, EveryConsumer, testing::ValuesIn(consumers()), element_lines::test_name);

TEST_P(EveryConsumer, SurvivesHostileBuffers) {
  Consumer consumer{Kind(GetParam())};
  BufferMaker maker;
  // Without a GPU, its emulator compiles the shaders anew for each.
  const int usual = GetParam().starts_with("gl") ? 6 : 60;
  for (int streams = repetitions(usual, 2'500); streams > 0; --streams)
    ASSERT_NE(consumer.play(maker, true), GST_MESSAGE_UNKNOWN) << "neither EOS nor error";
  EXPECT_EQ(consumer.play(maker, false), GST_MESSAGE_EOS);
}

}  // namespace
