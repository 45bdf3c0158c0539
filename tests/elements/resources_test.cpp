// SPDX-License-Identifier: LGPL-2.1-or-later
// Memory, threads and file descriptors do not grow: while elements run, and over starts and stops.
#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <iostream>
#include <tuple>
#include <utility>
#include <vector>

#include "tests/elements/element_lines.hpp"
#include "tests/elements/pipeline.hpp"

namespace {

using namespace harness;
using namespace element_lines;

constexpr const char* video = "video/x-raw, format=GRAY8, width=64, height=48, framerate=25/1";

/// A small square that flies over a texture repeatedly; all buffers of a frame share its memory.
class Flight {
 public:
  explicit Flight(const Harness& h) {
    for (int i = 0; i < 8; ++i)
      frames_.emplace_back(h.frame(0, [i](int x, int y) {
        const bool within = x >= 6 * i && x < 6 * i + 5 && y >= 20 && y < 25;
        return within ? 220 : 40 + (x * 7 + y) % 9;
      }));
  }
  /// A buffer with frame i of the stream.
  GstBuffer* frame(int i) const {
    GstBuffer* buffer = gst_buffer_copy(frames_[static_cast<std::size_t>(i) % 8].get());
    GST_BUFFER_PTS(buffer) = static_cast<GstClockTime>(i) * 40 * GST_MSECOND;
    return buffer;
  }

 private:
  std::vector<Buffer> frames_;
};

/// What the process uses.
struct Resources {
  std::size_t heap = 0;      ///< bytes
  std::size_t resident = 0;  ///< bytes
  std::ptrdiff_t threads = 0;
  std::ptrdiff_t files = 0;

  static Resources now() {
    const auto entries_of = [](const char* folder) {
      return std::distance(std::filesystem::directory_iterator(folder), {});
    };
    const auto info = mallinfo2();
    std::size_t pages = 0;
    std::ifstream("/proc/self/statm").ignore(32, ' ') >> pages;
    return {info.uordblks + info.hblkhd, pages * static_cast<std::size_t>(sysconf(_SC_PAGESIZE)),
            entries_of("/proc/self/task"), entries_of("/proc/self/fd")};
  }
};

std::ostream& operator<<(std::ostream& out, const Resources& resources) {
  return out << resources.heap / 1024 << " KiB of heap, " << resources.resident / 1024
             << " KiB resident, " << resources.threads << " threads, " << resources.files
             << " file descriptors";
}

/// An element, and whether it draws.
class Memory : public testing::TestWithParam<std::tuple<const char*, bool>> {};
INSTANTIATE_TEST_SUITE_P(, Memory,
                         testing::Combine(testing::ValuesIn(simulators), testing::Bool()));

TEST_P(Memory, DoesNotGrowFrameByFrame) {
  const auto& [element, draws] = GetParam();
  // A software renderer is slow.
  const int frames = is_on_gpu(element) ? repetitions(100, 500) : repetitions(1'000, 20'000);
  Harness h(element);
  h.caps(video, draws ? pictures_of(element) : GST_EVENT_CAMERA_MEDIA_TYPE);
  const Flight flight(h);
  std::vector<std::ptrdiff_t> growths;  // of the heap in tenths of the stream
  std::size_t last_heap = 0;
  for (int i = 0; i < frames; ++i) {
    ASSERT_EQ(h.push(flight.frame(i)), GST_FLOW_OK);
    const auto buffer = h.pull();
    ASSERT_EQ(buffer != nullptr, draws || i > 0);
    if (i % (frames / 10) != 0) continue;
    const auto heap = Resources::now().heap;
    growths.push_back(static_cast<std::ptrdiff_t>(heap - std::exchange(last_heap, heap)));
  }
  // A leak grows the heap in every tenth, by less than a pointer per frame here. Drivers and their
  // threads allocate late and in steps, on a busy machine in up to half of the tenths.
  std::ranges::sort(growths);
  EXPECT_LE(growths[growths.size() / 4], frames / 10 * 7 + 1024) << testing::PrintToString(growths);
}

class OnTheCpu : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(, OnTheCpu, testing::ValuesIn(cpu_simulators));

TEST_P(OnTheCpu, TakesFramesOf64Megapixels) {
  if (repetitions(0, 1) == 0) GTEST_SKIP() << "only in the soak";
  Player player(
      "videotestsrc pattern=ball num-buffers=3 ! video/x-raw,format=GRAY8,width=8192,height=8192 "
      "! " +
      std::string(GetParam()) + " ! application/x-event-camera");
  EXPECT_TRUE(player.play()) << player.error;
  EXPECT_GT(player.events.size(), 1000U);
  EXPECT_TRUE(std::ranges::any_of(
      player.events, [](const auto& event) { return event.x > 4095 && event.y() > 4095; }));
}

class EveryElement : public testing::TestWithParam<std::string> {
 protected:
  static void SetUpTestSuite() {
    mallopt(M_ARENA_MAX, 1);  // mallinfo2() counts only the main arena
  }
};
INSTANTIATE_TEST_SUITE_P(, EveryElement, testing::ValuesIn(element_names()),
                         element_lines::test_name);

TEST_P(EveryElement, ReleasesEverythingOnStop) {
  const int starts = repetitions(20, 500);
  const std::string line = Kind(GetParam()).launch_with_sources(1'000'000);
  Resources after_some;
  for (int i = 0; i < starts; ++i) {
    if (i == starts / 5) after_some = Resources::now();
    const auto pipeline = launched(line);
    gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
    ASSERT_EQ(gst_element_get_state(pipeline.get(), nullptr, nullptr, 60 * GST_SECOND),
              GST_STATE_CHANGE_SUCCESS);
    gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  }
  auto at_the_end = Resources::now();
  // A thread of the last pipeline may still hold it.
  for (int i = 0; i < 500 && at_the_end.files > after_some.files; ++i) {
    g_usleep(10'000);
    at_the_end = Resources::now();
  }
  std::cout << after_some << "\n" << at_the_end << "\n";
  EXPECT_LE(at_the_end.threads, after_some.threads + 8);  // GLib keeps a few idle
  EXPECT_LE(at_the_end.files, after_some.files);
  // Threads of GLib's pool have their share; GStreamer itself loses about 100 bytes per start.
  EXPECT_LE(at_the_end.heap, after_some.heap + 256 * 1024 + 512 * static_cast<unsigned>(starts));
}

}  // namespace
