// SPDX-License-Identifier: LGPL-2.1-or-later
// The naive implementations give the same events as the frame simulator and the dense path, and,
// with the same flow, as the reference equations.
#include <gtest/gtest.h>

#include "bench/methods.hpp"
#include "bench/scenes.hpp"
#include "src/simulate/interpolation.hpp"
#include "tests/reference/dense.hpp"
#include "tests/reference/diff.hpp"
#include "tests/reference/sparse.hpp"
#include "tests/simulate/scene.hpp"

namespace {

using namespace eventcamera;

class Naive : public testing::TestWithParam<int> {
 protected:
  std::vector<Event> events_of(Simulator& simulator, int threshold) const {
    const double grey_levels = threshold;
    std::vector<LumaView> views;
    for (const auto& frame : frames) views.push_back(scene::luma(frame));
    return scene::last_interval(simulator, {grey_levels, grey_levels, 10, GetParam()}, views);
  }

  /// Tracks of points from one frame to the next, for the reference equations.
  static std::vector<Track> tracks_of(const Image<std::uint8_t>& from,
                                      const Image<std::uint8_t>& to,
                                      const std::vector<Point>& points) {
    naive::OpenCvTracker tracker;
    tracker.push(from.view(), 1);
    tracker.push(to.view(), 1);
    std::vector<cv::Point2f> places;
    places.reserve(points.size());
    for (const auto& [x, y] : points)
      places.emplace_back(static_cast<float>(x), static_cast<float>(y));
    const auto& found = tracker.track(places, 1);
    std::vector<Track> tracks;
    for (std::size_t i = 0; i < places.size(); ++i) {
      const cv::Point2f flow = found.ends[i] - places[i];
      tracks.push_back({{flow.x, flow.y}, found.found[i] != 0});
    }
    return tracks;
  }

  // The patch leaves at the right and the bottom; the background is static.
  const bench::Clip frames = bench::moving_patch(330, 200, 0.9, 3);
  const Image<std::uint8_t>& last = frames[1];
  const Image<std::uint8_t>& now = frames[2];
  const LumaFormat format{330, 200, 8};
  const StepTimes steps{scene::frame_time, 11};
};

INSTANTIATE_TEST_SUITE_P(Threads, Naive, testing::Values(1, 2));

TEST_P(Naive, FrameEqualsTheSimulator) {
  naive::FrameSimulator naive_simulator(format);
  const auto events = events_of(naive_simulator, 20);
  EXPECT_GT(events.size(), 100U);
  EXPECT_TRUE(events == events_of(*make_frame_simulator(format), 20));
}

TEST_P(Naive, DenseAfterTheFlowEqualsTheKernel) {
  ThreadPool threads;
  threads.set_threads(GetParam());
  for (const auto method : {FlowMethod::dis_lq, FlowMethod::dis_hq, FlowMethod::farneback}) {
    naive::OpenCvFlow finder(method, format.width, format.height);
    const auto flow = finder.find(last.view(), now.view(), 1);
    StepBuckets naive_events;
    naive::DenseInterpolation(format.width, format.height)
        .fire(last.view(), now.view(), flow, steps, {3, 3}, threads, naive_events);
    StepBuckets events;
    InterpolationKernel().fire(
        InterpolatedInterval<std::uint8_t>{
            {last.view(), now.view(), steps.count()}, flow, Interpolation::forward, steps, {3, 3}},
        threads, events);
    EXPECT_GT(events.size(), 100U);
    EXPECT_TRUE(scene::copy(naive_events) == scene::copy(events));
  }
}

TEST_P(Naive, DenseEqualsTheReference) {
  for (const auto method : {FlowMethod::dis_lq, FlowMethod::dis_hq, FlowMethod::farneback}) {
    naive::OpenCvFlow finder(method, format.width, format.height);
    const auto flow = finder.find(last.view(), now.view(), 1);
    naive::DenseSimulator simulator(format, method);
    EXPECT_TRUE(events_of(simulator, 3) ==
                reference::dense(last, now, flow, Interpolation::forward, steps, {3, 3}));
  }
}

TEST_P(Naive, SparseEqualsTheReference) {
  const auto points = reference::changed(last, now, 6);
  const auto expected = reference::sparse<std::uint8_t>(
      last, now, points, tracks_of(last, now, points), steps, {6, 6});
  EXPECT_GT(expected.size(), 100U);
  naive::SparseSimulator simulator(format);
  EXPECT_TRUE(events_of(simulator, 6) == expected);
}

TEST_P(Naive, DiffEqualsTheReference) {
  const auto before = reference::difference_frame(frames[0], last, {19, 19});
  const auto after = reference::difference_frame(last, now, {19, 19});
  const auto tracked = [&](int sign) {
    const auto from = reference::part_of(before, sign, 8);
    const auto points = reference::points_of(from);
    return reference::Tracked{points, tracks_of(from, reference::part_of(after, sign, 8), points)};
  };
  const auto expected = reference::diff(before, after, tracked(1), tracked(-1), steps);
  EXPECT_GT(expected.size(), 100U);
  naive::DiffSimulator simulator(format);
  EXPECT_TRUE(events_of(simulator, 19) == expected);
}

}  // namespace
