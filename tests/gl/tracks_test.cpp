// SPDX-License-Identifier: LGPL-2.1-or-later
// Sparse and difference interpolation on the GPU: given its tracks, the events are those of the
// plain reference, event for event.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <span>
#include <vector>

#include "src/gl/point_tracker.hpp"
#include "src/gl/simulator.hpp"
#include "tests/gl/every_api.hpp"
#include "tests/reference/diff.hpp"
#include "tests/reference/sparse.hpp"
#include "tests/simulate/scene.hpp"

namespace {

using namespace eventcamera;
using gl_test::EveryApi;
using gl_test::Texture;

using Picture = Image<std::uint8_t>;

constexpr int frame_count = 3;

/// A texture seen by a moving camera, without black pixels, which would be no points.
std::vector<Picture> frames_of(const LumaFormat& format) {
  std::vector<Picture> frames;
  for (int i = 0; i < frame_count; ++i) {
    auto& frame = frames.emplace_back(
        scene::texture<std::uint8_t>(format.width, format.height, 8, 2.6 * i, -1.3 * i));
    for (int y = 0; y < format.height; ++y)
      for (int x = 0; x < format.width; ++x)
        frame.at(x, y) = std::max<std::uint8_t>(frame.at(x, y), 1);
  }
  return frames;
}

class Tracks : public EveryApi {
 protected:
  /// The GPU's tracks of points from one picture to the next.
  std::vector<Track> track(const Picture& from, const Picture& to, const std::vector<Point>& points,
                           int block_side) {
    const LumaFormat format{from.width(), from.height(), 8};
    const gl::PointTracker tracker(context, format, block_side);
    const gl::Pyramid pyramids[] = {{context, format}, {context, format}};
    upload(from, pyramids[0].picture());
    upload(to, pyramids[1].picture());
    for (const auto& pyramid : pyramids) tracker.build(pyramid);
    Picture is_point(from.width(), from.height());
    for (const auto& [x, y] : points) is_point.at(x, y) = 1;
    const gl::Pyramid marks(context, format);
    upload(is_point, marks.picture());
    std::vector<Flow> flows(gl::pixel_count(format));
    gl::Buffer buffer(context, GL_DYNAMIC_READ);
    buffer.reserve(flows.size() * sizeof(Flow));
    tracker.find_points(marks, buffer);
    tracker.track(pyramids[0], pyramids[1], buffer);
    buffer.read(std::as_writable_bytes(std::span(flows)));
    std::vector<Track> tracks;
    for (const auto& [x, y] : points) {
      const Flow& flow = flows[static_cast<std::size_t>(y * format.width + x)];
      tracks.push_back({flow, std::bit_cast<std::uint32_t>(flow.x) != 0x7fffffff});
    }
    return tracks;
  }

  /// Events of the last interval.
  std::vector<Event> events_of(gl::Simulator& simulator, const std::vector<Picture>& frames) const {
    Texture texture(frames[0].width(), frames[0].height(), 1);
    std::vector<Event> events;
    for (int i = 0; i < frame_count; ++i) {
      const auto& frame = frames[static_cast<std::size_t>(i)];
      const auto* made = gl_test::events_until(simulator, texture.show(gl_test::bytes_of(frame)),
                                               i * scene::frame_time, settings);
      if (made != nullptr) events = scene::copy(*made);
    }
    return events;
  }

  const std::vector<LumaFormat> formats = {{7, 5}, {33, 40}, {97, 61}};
  const Settings settings{.positive_threshold = 9, .negative_threshold = 14};
  const Thresholds thresholds = Thresholds::of(settings, 8);
  const StepTimes steps{scene::frame_time, settings.interpolated_frames + 1};
};
INSTANTIATE_TEST_SUITE_P(, Tracks, testing::Bool(), gl_test::name_of_api);

TEST_P(Tracks, GiveTheEventsOfTheSparseReference) {
  for (const auto& format : formats) {
    const auto frames = frames_of(format);
    const auto& last = frames[1];
    const auto& now = frames[2];
    const auto points =
        reference::changed(last, now, std::min(thresholds.positive, thresholds.negative));
    const auto tracks = track(last, now, points, 2);
    EXPECT_TRUE(std::ranges::any_of(tracks, &Track::found) || format.width < 15);
    EXPECT_EQ(events_of(*gl::make_sparse_simulator(context, format), frames),
              reference::sparse(last, now, std::span<const Point>(points),
                                std::span<const Track>(tracks), steps, thresholds));
  }
}

TEST_P(Tracks, GiveTheEventsOfTheDifferenceReference) {
  for (const auto& format : formats) {
    const auto frames = frames_of(format);
    const auto before = reference::difference_frame(frames[0], frames[1], thresholds);
    const auto now = reference::difference_frame(frames[1], frames[2], thresholds);
    const auto follow = [&](int sign) {
      const auto from = reference::part_of(before, sign, 8);
      reference::Tracked tracked{reference::points_of(from), {}};
      tracked.tracks = track(from, reference::part_of(now, sign, 8), tracked.points, 1);
      EXPECT_TRUE(std::ranges::any_of(tracked.tracks, &Track::found) || format.width < 15);
      return tracked;
    };
    EXPECT_EQ(events_of(*gl::make_diff_simulator(context, format), frames),
              reference::diff(before, now, follow(1), follow(-1), steps));
  }
}

}  // namespace
