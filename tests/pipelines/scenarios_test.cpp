// SPDX-License-Identifier: LGPL-2.1-or-later
// The scenarios of gst-validate-1.0, which Debian does not package, on every reader and player:
// scrub, pause, fast forward, stop at a position, and change states intensively.
#include <utility>

#include "tests/elements/recording_files.hpp"

namespace {

using namespace recording_files;

constexpr GstClockTime ms = GST_MSECOND;
constexpr GstClockTime end_of_file = length * GST_USECOND;
/// A picture lasts 33 ms, a buffer of events 10 ms.
constexpr GstClockTime tolerance = 40 * ms;
constexpr auto accurate = static_cast<GstSeekFlags>(GST_SEEK_FLAG_FLUSH | GST_SEEK_FLAG_ACCURATE);

/// Launch line that plays a file, with a fakesink named "sink". Its source of late pads is "it".
struct Line {
  const char* name;
  std::string (*launch)(const File& file);
};

std::string player(const std::string& name, const File& file) {
  gchar* const uri = gst_filename_to_uri(file.path().c_str(), nullptr);
  const auto line =
      name + " uri=" + in_quotes(uri) + " video-sink=\"fakesink name=sink sync=true\"";
  g_free(uri);
  return line;
}

const Line lines[] = {
    {"reader",
     [](const File& file) {
       return "filesrc location=" + in_quotes(file.path()) + " ! " + file.reader +
              " name=it  fakesink name=sink sync=true";
     }},
    {"pushed_reader",
     [](const File& file) {
       return "filesrc location=" + in_quotes(file.path()) + " ! queue ! " + file.reader +
              " name=it  fakesink name=sink sync=true";
     }},
    {"decodebin",
     [](const File& file) {
       return "filesrc location=" + in_quotes(file.path()) +
              " ! decodebin name=it  fakesink name=sink sync=true";
     }},
    {"playbin", [](const File& file) { return player("playbin", file); }},
    {"playbin3", [](const File& file) { return player("playbin3", file); }},
};

/// A file being played; errors and warnings fail the test.
class Playback {
 public:
  explicit Playback(const std::string& line) : pipeline_(line) {
    sink_.reset(gst_bin_get_by_name(GST_BIN(pipeline_.get()), "sink"));
    is_player_ = sink_ == nullptr;
    if (is_player_) {  // its sink is a property until it starts
      GstElement* sink = nullptr;
      g_object_get(pipeline_.get(), "video-sink", &sink, nullptr);
      sink_.reset(sink);
    } else {
      harness::link_late_pads(pipeline_["it"], sink_.get());
    }
  }
  ~Playback() { check_messages(); }
  Playback(const Playback&) = delete;
  Playback& operator=(const Playback&) = delete;

  /// Does not wait, except for playbin3, which may deadlock when it is stopped while it finds the
  /// type of a file, and at times never starts on a busy machine (GStreamer 1.22): then it has to
  /// start again.
  void set(GstState state) {
    old_buffers_ = buffers();
    const auto change = [&] {
      pipeline_.set(state);
      return !is_player_ || gst_element_get_state(pipeline_.get(), nullptr, nullptr,
                                                  20 * GST_SECOND) != GST_STATE_CHANGE_ASYNC;
    };
    for (int restarts = 5; !change() && restarts > 0; --restarts) pipeline_.set(GST_STATE_NULL);
  }

  void reach(GstState state) {
    set(state);
    wait_for_state();
  }

  void seek(GstClockTime to, GstSeekFlags flags = accurate, gdouble rate = 1,
            GstClockTime stop = GST_CLOCK_TIME_NONE) {
    last_seek_ = g_get_monotonic_time();
    EXPECT_TRUE(gst_element_seek(pipeline_.get(), rate, GST_FORMAT_TIME, flags, GST_SEEK_TYPE_SET,
                                 static_cast<gint64>(to), GST_SEEK_TYPE_SET,
                                 static_cast<gint64>(stop)))
        << "to " << to / ms << " ms";
    wait_for_state();
    old_buffers_ = buffers();
  }

  GstClockTime position() const {
    const auto position = pipeline_.position();
    EXPECT_TRUE(GST_CLOCK_TIME_IS_VALID(position));
    return position;
  }

  void expect_position(GstClockTime from, GstClockTime to) const {
    const auto at = position();
    EXPECT_TRUE(at + tolerance >= from && at <= to + tolerance)
        << at / ms << " ms, not " << from / ms << " to " << to / ms << " ms";
  }

  /// Waits for buffers, and checks that the position is no later than the time since the last seek
  /// allows.
  void expect_progress(GstClockTime from, gdouble rate = 1) const {
    for (int i = 0; i < 6000 && buffers() < old_buffers_ + 3; ++i) g_usleep(10'000);
    EXPECT_GE(buffers(), old_buffers_ + 3) << "nothing is shown";
    const auto elapsed = static_cast<gdouble>(g_get_monotonic_time() - last_seek_) * GST_USECOND;
    expect_position(from, from + static_cast<GstClockTime>(rate * elapsed));
  }

  void play_to_end() {
    set(GST_STATE_PLAYING);
    EXPECT_TRUE(pipeline_.wait()) << pipeline_.error;
    check_messages();
  }

 private:
  void wait_for_state() {
    EXPECT_EQ(gst_element_get_state(pipeline_.get(), nullptr, nullptr, 60 * GST_SECOND),
              GST_STATE_CHANGE_SUCCESS);
    check_messages();
  }

  /// Drops all messages.
  void check_messages() {
    for (const auto& warning : std::exchange(pipeline_.warnings, {})) ADD_FAILURE() << warning;
    const Owned<GstBus> bus(gst_element_get_bus(pipeline_.get()));
    while (const Owned<GstMessage> message{gst_bus_pop_filtered(
        bus.get(), static_cast<GstMessageType>(GST_MESSAGE_ERROR | GST_MESSAGE_WARNING))})
      ADD_FAILURE() << harness::text_of(message.get());
  }

  /// Number of buffers that the sink has rendered.
  guint64 buffers() const { return harness::stat_of(sink_.get(), "rendered"); }

  Pipeline pipeline_;
  Owned<GstElement> sink_;
  bool is_player_;
  guint64 old_buffers_ = 0;  ///< at the last state change or seek
  gint64 last_seek_ = 0;     ///< monotonic time, microseconds
};

/* scenarios */

void scrub(Playback& playback) {
  playback.reach(GST_STATE_PAUSED);
  const int steps = repetitions(4, 100);
  const auto seek_to_step = [&](int i) {
    const auto to = end_of_file / static_cast<GstClockTime>(steps) * static_cast<GstClockTime>(i);
    playback.seek(to);
    playback.expect_position(to, to);
  };
  for (int i = 0; i < steps; ++i) seek_to_step(i);
  for (int i = steps - 1; i >= 0; --i) seek_to_step(i);
}

void pause(Playback& playback) {
  playback.reach(GST_STATE_PLAYING);
  for (int times = repetitions(1, 10); times > 0; --times) {
    playback.seek(1000 * ms);
    playback.expect_progress(1000 * ms);
    playback.reach(GST_STATE_PAUSED);
    const auto at = playback.position();
    g_usleep(50'000);
    EXPECT_EQ(playback.position(), at) << "does not pause";
    playback.reach(GST_STATE_PLAYING);
    playback.expect_progress(at);
  }
}

void fast_forward(Playback& playback) {
  playback.reach(GST_STATE_PLAYING);
  for (const double rate : {2., 4., 8., 16., 0.5, 1.}) {
    playback.seek(1000 * ms, accurate, rate);
    playback.expect_progress(1000 * ms, rate);
  }
  playback.reach(GST_STATE_PAUSED);
  playback.seek(0, static_cast<GstSeekFlags>(GST_SEEK_FLAG_FLUSH | GST_SEEK_FLAG_TRICKMODE), 32);
  playback.play_to_end();
}

void stop_at_a_position(Playback& playback) {
  playback.reach(GST_STATE_PAUSED);
  playback.seek(1000 * ms, accurate, 1, 1100 * ms);
  playback.play_to_end();
  playback.expect_position(1100 * ms, 1100 * ms);
  playback.reach(GST_STATE_PAUSED);
  playback.seek(4900 * ms);
  playback.play_to_end();
}

void change_state_intensive(Playback& playback) {
  for (int times = repetitions(4, 50); times > 0; --times) {
    for (const auto state : {GST_STATE_PLAYING, GST_STATE_NULL, GST_STATE_PAUSED, GST_STATE_PLAYING,
                             GST_STATE_PAUSED, GST_STATE_READY, GST_STATE_PAUSED, GST_STATE_NULL})
      playback.set(state);
    playback.reach(GST_STATE_PAUSED);
    playback.seek(4000 * ms);
    playback.reach(GST_STATE_PLAYING);
    playback.set(GST_STATE_NULL);
  }
}

struct Scenario {
  const char* name;
  void (*play)(Playback& playback);
};

const Scenario scenarios[] = {
    {"scrub", scrub},
    {"pause", pause},
    {"fast_forward", fast_forward},
    {"stop_at_a_position", stop_at_a_position},
    {"change_state_intensive", change_state_intensive},
};

struct Play {
  Line line;
  File file;
  Scenario scenario;
};

/// All combinations in the soak, else two scenarios of each file on each line.
std::vector<Play> plays() {
  constexpr int count = std::size(scenarios);
  std::vector<Play> plays;
  for (std::size_t line = 0; line < std::size(lines); ++line)
    for (std::size_t file = 0; file < files().size(); ++file)
      for (int i = repetitions(2, count); i > 0; --i)
        plays.push_back({lines[line], files()[file],
                         scenarios[(line + file + static_cast<std::size_t>(i)) % count]});
  return plays;
}

class EveryLine : public testing::TestWithParam<Play> {};
INSTANTIATE_TEST_SUITE_P(, EveryLine, testing::ValuesIn(plays()), [](const auto& test) {
  const Play& play = test.param;
  return test_name(std::string(play.line.name) + "_" + play.file.name + "_" + play.scenario.name);
});

TEST_P(EveryLine, PlaysTheScenario) {
  Playback playback(GetParam().line.launch(GetParam().file));
  GetParam().scenario.play(playback);
}

}  // namespace
