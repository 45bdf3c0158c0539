// SPDX-License-Identifier: LGPL-2.1-or-later
// eventsim-dvs clip by clip: with the state that one leaves behind, the next makes the events that
// the whole video has.
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "tests/elements/pipeline.hpp"
#include "tests/elements/recording_files.hpp"

namespace {

using namespace harness;

const std::string noisy = "eventsim-dvs preset=davis346 shot-noise-rate=20 seed=3 label=true ";

struct Output {
  GstClockTime pts;
  std::string events;
  std::string labels;

  friend bool operator==(const Output&, const Output&) = default;
};

/// Frames [first, last) of a ball that moves.
void push_frames(Harness& h, int first, int last) {
  for (int i = first; i < last; ++i)
    h.push(h.frame(GST_SECOND + static_cast<GstClockTime>(i) * 40 * GST_MSECOND, [i](int x, int y) {
      return (x - 6 * i) * (x - 6 * i) + (y - 20) * (y - 20) < 100 ? 220 : 60;
    }));
}

void pull_all(Harness& h, std::vector<Output>& outputs) {
  while (const auto buffer = h.pull()) {
    const auto* meta = gst_buffer_get_event_camera_label_meta(buffer.get());
    ASSERT_NE(meta, nullptr);
    outputs.push_back({GST_BUFFER_PTS(buffer.get()),
                       bytes_of(buffer.get()),
                       {reinterpret_cast<const char*>(meta->labels),
                        meta->n_labels * sizeof(GstEventCameraLabel)}});
  }
}

void start(Harness& h) {
  h.caps("video/x-raw, format=GRAY8, width=64, height=48, framerate=25/1");
}

std::string state() {
  return recording_files::Folder::path("state");
}

/// The state after four frames.
void write_state() {
  Harness h(noisy + "final-state=" + in_quotes(state()));
  start(h);
  push_frames(h, 0, 4);
  gst_harness_push_event(h.get(), gst_event_new_eos());
}

TEST(Clips, JoinWithoutASeam) {
  std::vector<Output> whole;
  Harness one(noisy);
  start(one);
  push_frames(one, 0, 12);
  pull_all(one, whole);
  ASSERT_EQ(whole.size(), 11U);

  std::vector<Output> joined;
  const int cuts[] = {0, 1, 5, 12};
  for (int i = 0; i < 3; ++i) {
    Harness h(noisy + "final-state=" + in_quotes(state()) +
              (i > 0 ? " initial-state=" + in_quotes(state()) : ""));
    start(h);
    push_frames(h, cuts[i] / 2, cuts[i + 1]);  // frames before the state are skipped
    gst_harness_push_event(h.get(), gst_event_new_eos());
    pull_all(h, joined);
    EXPECT_EQ(h.error() + h.warning(), "");
  }
  EXPECT_EQ(joined, whole);
}

TEST(Clips, JoinWithoutASeamAtAGap) {
  const auto gap = [](Harness& h) {
    gst_harness_push_event(h.get(),
                           gst_event_new_gap(GST_SECOND + 80 * GST_MSECOND, 200 * GST_MSECOND));
  };
  std::vector<Output> whole;
  Harness one(noisy);
  start(one);
  push_frames(one, 0, 2);
  gap(one);
  push_frames(one, 7, 9);
  pull_all(one, whole);

  std::vector<Output> joined;
  Harness first(noisy + "final-state=" + in_quotes(state()));
  start(first);
  push_frames(first, 0, 2);
  gst_harness_push_event(first.get(), gst_event_new_eos());
  pull_all(first, joined);
  Harness second(noisy + "initial-state=" + in_quotes(state()));
  start(second);
  gap(second);
  push_frames(second, 7, 9);
  pull_all(second, joined);
  EXPECT_EQ(joined, whole);
}

TEST(Clips, WithoutFramesPassTheStateOn) {
  write_state();
  const auto passed = recording_files::Folder::path("passed");
  Harness empty(noisy + "initial-state=" + in_quotes(state()) +
                " final-state=" + in_quotes(passed));
  start(empty);
  gst_harness_push_event(empty.get(), gst_event_new_eos());
  EXPECT_EQ(empty.error() + empty.warning(), "");
  const auto bytes_at = [](const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(file), {});
  };
  EXPECT_FALSE(bytes_at(passed).empty());
  EXPECT_TRUE(bytes_at(passed) == bytes_at(state()));
}

/// As that of a clip in a file of its own, which begins with its first frame.
TEST(Clips, LetTheirSegmentBeginWithTheState) {
  write_state();
  Harness h(noisy + "initial-state=" + in_quotes(state()));
  start(h);
  const GstClockTime state_time = GST_SECOND + 120 * GST_MSECOND;
  GstSegment in;
  gst_segment_init(&in, GST_FORMAT_TIME);
  in.start = in.position = in.time = state_time + 40 * GST_MSECOND;
  gst_harness_push_event(h.get(), gst_event_new_segment(&in));
  push_frames(h, 4, 6);
  const auto seam = h.pull();
  ASSERT_TRUE(seam);
  EXPECT_EQ(GST_BUFFER_PTS(seam.get()), state_time);
  GstSegment out;
  while (const auto event = h.pull_event(GST_EVENT_SEGMENT))
    gst_event_copy_segment(event.get(), &out);
  EXPECT_EQ(out.start, state_time);
  for (const auto to_time : {gst_segment_to_running_time, gst_segment_to_stream_time})
    EXPECT_EQ(to_time(&out, GST_FORMAT_TIME, in.start), to_time(&in, GST_FORMAT_TIME, in.start));
}

TEST(Clips, WarnIfAllFramesAreBeforeTheState) {
  for (const bool has_state : {false, true}) {
    Harness h(noisy + "final-state=" + in_quotes(state()) +
              (has_state ? " initial-state=" + in_quotes(state()) : ""));
    start(h);
    push_frames(h, 0, 4);
    gst_harness_push_event(h.get(), gst_event_new_eos());
    EXPECT_EQ(h.warning().starts_with("No events: all frames are before the state"), has_state);
  }
}

TEST(Clips, ContinueAgainAfterASeek) {
  write_state();
  Harness h(noisy + "initial-state=" + in_quotes(state()));
  start(h);
  std::vector<Output> outputs[2];
  for (auto& output : outputs) {
    push_frames(h, 2, 7);
    pull_all(h, output);
    flush({h.get()});
    push_segment(h.get());
  }
  EXPECT_EQ(outputs[0].size(), 3U);
  EXPECT_EQ(outputs[0], outputs[1]);
}

TEST(Clips, RefuseStatesOfOthers) {
  {
    Harness h("eventsim-dvs seed=1 final-state=" + in_quotes(state()));
    start(h);
    push_frames(h, 0, 2);
    gst_harness_push_event(h.get(), gst_event_new_eos());
  }
  const auto error_of = [](const std::string& properties) {
    Harness h("eventsim-dvs " + properties);
    start(h);
    push_frames(h, 0, 1);
    return h.error();
  };
  const std::string initial = " initial-state=" + in_quotes(state());
  EXPECT_EQ(error_of("seed=1" + initial), "");
  EXPECT_NE(error_of("seed=2" + initial).find("it is of other properties"), std::string::npos);
  EXPECT_NE(error_of("initial-state=/nowhere/state").find("No such file"), std::string::npos);
  std::ofstream(state()) << "no state";
  EXPECT_NE(error_of("seed=1" + initial).find("Cannot continue from the state"), std::string::npos);
}

TEST(Clips, ReportAStateThatCannotBeWritten) {
  Harness h("eventsim-dvs final-state=/nowhere/state");
  start(h);
  push_frames(h, 0, 2);
  gst_harness_push_event(h.get(), gst_event_new_eos());
  EXPECT_NE(h.error().find("Cannot write the state to \"/nowhere/state\""), std::string::npos);
}

TEST(Clips, LeaveADeviceInItsPlace) {
  Harness h("eventsim-dvs final-state=/dev/null");
  start(h);
  push_frames(h, 0, 2);
  gst_harness_push_event(h.get(), gst_event_new_eos());
  EXPECT_EQ(h.error(), "");
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/null"));
}

}  // namespace
