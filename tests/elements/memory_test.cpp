// SPDX-License-Identifier: LGPL-2.1-or-later
// Memory does not grow in steady state.
#include <malloc.h>

#include <tuple>

#include "tests/elements/harness.hpp"

namespace {

using namespace harness;

constexpr const char* video = "video/x-raw, format=GRAY8, width=64, height=48, framerate=25/1";
constexpr const char* pictures = "video/x-raw, format=BGRx";

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

/// Heap memory used by the process, bytes.
std::size_t bytes_in_use() {
  const auto info = mallinfo2();
  return info.uordblks + info.hblkhd;
}

class Memory : public testing::TestWithParam<std::tuple<const char*, const char*>> {};
INSTANTIATE_TEST_SUITE_P(, Memory,
                         testing::Combine(testing::ValuesIn(elements),
                                          testing::Values(GST_EVENT_CAMERA_MEDIA_TYPE, pictures)));

TEST_P(Memory, DoesNotGrowOverTenThousandFrames) {
  const auto& [element, out] = GetParam();
  Harness h(element);
  h.caps(video, out);
  const Flight flight(h);
  std::size_t after_a_thousand = 0;
  for (int i = 0; i < 10'000; ++i) {
    ASSERT_EQ(h.push(flight.frame(i)), GST_FLOW_OK);
    const auto buffer = h.pull();
    ASSERT_EQ(buffer != nullptr, out == pictures || i > 0);
    if (i == 1'000) after_a_thousand = bytes_in_use();
  }
  // Less than a pointer per frame.
  EXPECT_LE(bytes_in_use(), after_a_thousand + 64 * 1024);
}

}  // namespace
