// SPDX-License-Identifier: LGPL-2.1-or-later
// Memory, threads and file descriptors do not grow: while elements run, and over starts and stops.
#include <gst/app/gstappsrc.h>
#include <gst/rtp/gstrtpbuffer.h>
#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <iostream>
#include <random>
#include <tuple>
#include <utility>
#include <vector>

#include "tests/elements/element_lines.hpp"
#include "tests/elements/event_buffer.hpp"
#include "tests/elements/pipeline.hpp"
#include "tests/wire/rtp_packets.hpp"

namespace {

using namespace harness;
using namespace element_lines;
namespace rtp_packets = eventcamera::rtp_packets;

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

guint64 rendered_buffers(GstElement* pipeline) {
  const Owned<GstElement> sink(gst_bin_get_by_name(GST_BIN(pipeline), "sink"));
  return stat_of(sink.get(), "rendered");
}

/// Nearly every pixel fires in every frame.
TEST(Noise, NeedsNoMoreMemoryOverTime) {
  const auto pipeline = launched(
      "videotestsrc pattern=snow ! video/x-raw,format=GRAY8,width=1280,height=720,framerate=30/1 ! "
      "eventsim-dvs preset=v2e-noisy ! application/x-event-camera ! fakesink name=sink");
  const auto wait_for_buffers = [&pipeline](guint64 count) {
    while (rendered_buffers(pipeline.get()) < count) g_usleep(10'000);
  };
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  wait_for_buffers(5);
  const auto after_some = Resources::now();
  g_usleep(static_cast<gulong>(repetitions(0, 600)) * G_USEC_PER_SEC);
  wait_for_buffers(15);
  const auto at_the_end = Resources::now();
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  std::cout << after_some << "\n" << at_the_end << "\n";
  EXPECT_LE(at_the_end.resident, after_some.resident + (16U << 20U));
}

/// RTP packets: one in five continues a stream; the others are random bytes, or have a random SSRC
/// or sequence number.
class Flood {
 public:
  GstBuffer* next() {
    const auto kind = random_() % 10;
    if (kind < 3) return random_bytes();
    const bool is_sent = kind >= 8;
    if (is_sent) ++sequence_number_;
    const auto& packet = packets_[(is_sent ? sequence_number_ : random_()) % packets_.size()];
    const auto size = static_cast<guint>(packet.payload.size());
    GstBuffer* buffer = gst_rtp_buffer_new_allocate(size, 0, 0);
    GstRTPBuffer rtp = GST_RTP_BUFFER_INIT;
    gst_rtp_buffer_map(buffer, GST_MAP_WRITE, &rtp);
    std::ranges::copy(packet.payload, static_cast<guint8*>(gst_rtp_buffer_get_payload(&rtp)));
    gst_rtp_buffer_set_marker(&rtp, packet.marker ? TRUE : FALSE);
    gst_rtp_buffer_set_ssrc(&rtp, kind < 6 ? static_cast<guint32>(random_()) : 1);
    gst_rtp_buffer_set_seq(
        &rtp, kind < 6 || is_sent ? sequence_number_ : static_cast<guint16>(random_()));
    gst_rtp_buffer_unmap(&rtp);
    return buffer;
  }

 private:
  GstBuffer* random_bytes() {
    GstBuffer* buffer = gst_rtp_buffer_new_allocate(static_cast<guint>(random_() % 600), 0, 0);
    constexpr gsize header_size = 12;
    for (gsize i = header_size; i < gst_buffer_get_size(buffer); ++i) {
      const auto byte = static_cast<guint8>(random_());
      gst_buffer_fill(buffer, i, &byte, 1);
    }
    return buffer;
  }

  std::mt19937 random_{1};  // NOLINT(bugprone-random-generator-seed): reproducible
  eventcamera::RtpPacker packer_{{346, 260}, eventcamera::RtpEventFormat::evt3};
  std::vector<rtp_packets::Packet> packets_ =
      rtp_packets::packets_of(rtp_packets::random_intervals({346, 260}, 40, 1), packer_, 536, 0);
  guint16 sequence_number_ = 0;
};

TEST(RtpFlood, NeedsNoMoreMemoryOverTime) {
  mallopt(M_ARENA_MAX, 1);
  const int packets = repetitions(100'000, 20'000'000);
  const auto pipeline = launched(
      "appsrc name=source format=time block=true max-buffers=1 max-bytes=0 "
      "caps=\"application/x-rtp,media=application,clock-rate=1000000,"
      "encoding-name=X-EVENT-CAMERA,width=346,height=260\" "
      "! rtpeventdepay name=it ! fakesink async=false sync=false enable-last-sample=false");
  const Owned<GstElement> source(gst_bin_get_by_name(GST_BIN(pipeline.get()), "source"));
  const Owned<GstElement> depayloader(gst_bin_get_by_name(GST_BIN(pipeline.get()), "it"));
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  Flood flood;
  Resources after_some;
  for (int i = 0; i < packets; ++i) {
    GstBuffer* const packet = flood.next();
    GST_BUFFER_PTS(packet) = static_cast<GstClockTime>(i) * GST_USECOND;
    ASSERT_EQ(gst_app_src_push_buffer(GST_APP_SRC(source.get()), packet), GST_FLOW_OK);
    if (i == packets / 5) after_some = Resources::now();
  }
  const auto at_the_end = Resources::now();
  gst_app_src_end_of_stream(GST_APP_SRC(source.get()));
  const auto end = wait_for(pipeline.get(), GST_MESSAGE_EOS | GST_MESSAGE_ERROR);
  ASSERT_TRUE(end);
  EXPECT_EQ(GST_MESSAGE_TYPE(end.get()), GST_MESSAGE_EOS);
  EXPECT_EQ(stat_of(depayloader.get(), "packets") + stat_of(depayloader.get(), "late-packets") +
                stat_of(depayloader.get(), "rejected-packets"),
            static_cast<guint64>(packets));
  EXPECT_GT(stat_of(depayloader.get(), "packets"), static_cast<guint64>(packets) / 5);
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  std::cout << after_some << "\n" << at_the_end << "\n";
  EXPECT_LE(at_the_end.heap, after_some.heap + 512 * 1024);
  EXPECT_LE(at_the_end.resident, after_some.resident + 1024 * 1024);
}

}  // namespace
