// SPDX-License-Identifier: LGPL-2.1-or-later
// Dense interpolation on the GPU: flow close to the CPU's; given the same flow, the same events.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "src/flow/farneback/farneback.hpp"
#include "src/gl/farneback.hpp"
#include "src/gl/kernels.hpp"
#include "src/gl/simulator.hpp"
#include "src/simulate/interpolation.hpp"
#include "src/simulate/simulators.hpp"
#include "tests/gl/every_api.hpp"
#include "tests/simulate/scene.hpp"

namespace {

using namespace eventcamera;
using gl_test::EveryApi;
using gl_test::matched;
using gl_test::Texture;

/// Flow of all lengths, some of them past the border, and some that are no numbers.
Image<Flow> any_flow(int width, int height, unsigned seed) {
  std::minstd_rand random(seed);
  std::normal_distribution<float> normal;
  const float odd[] = {std::numeric_limits<float>::quiet_NaN(),
                       -std::numeric_limits<float>::quiet_NaN(),
                       std::numeric_limits<float>::infinity(), -1e30F};
  const auto length = [&] {
    const auto kind = random() % 40;
    if (kind < std::size(odd)) return odd[kind];
    return normal(random) * (kind < 20 ? 0.3F : kind < 38 ? 5.0F : 5000.0F);
  };
  Image<Flow> flow(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      flow.at(x, y).x = length();
      flow.at(x, y).y = length();
    }
  return flow;
}

std::vector<Flow> without_padding(const ImageView<Flow>& flow) {
  std::vector<Flow> flows;
  for (int y = 0; y < flow.height; ++y)
    flows.insert(flows.end(), flow.row(y), flow.row(y) + flow.width);
  return flows;
}

TEST_P(EveryApi, InterpolatesAlongAFlowBitForBit) {
  constexpr Thresholds thresholds{6, 9};
  ThreadPool threads;
  std::size_t events = 0;
  const gl::EventListKernels list_kernels(context);
  for (const auto& [width, height] : {std::pair{1, 1}, {7, 3}, {67, 45}, {130, 21}}) {
    const LumaFormat format{width, height, 8};
    const gl::InterpolationKernel kernel(context, format);
    gl::EventList list(context, format, list_kernels);
    const gl::GreyFrame frames[] = {{context, format}, {context, format}};
    gl::Buffer flows(context);
    for (const bool noise : {false, true}) {
      const auto last = noise ? scene::noise<std::uint8_t>(width, height, 8, 3)
                              : scene::texture<std::uint8_t>(width, height, 8, 0, 0);
      const auto now = noise ? scene::noise<std::uint8_t>(width, height, 8, 4)
                             : scene::texture<std::uint8_t>(width, height, 8, 2.3, -1.1);
      upload(last, frames[0]);
      upload(now, frames[1]);
      const auto flow = any_flow(width, height, 5);
      const auto in_raster_order = without_padding(flow.view());
      flows.assign(std::as_bytes(std::span(in_raster_order)));
      for (const auto interpolation : {Interpolation::forward, Interpolation::blend}) {
        for (const int count : {1, 2, 11, 64, 130}) {
          const StepTimes steps(scene::frame_time, count);
          list.begin(steps);
          kernel.run(frames[0], frames[1], flows, interpolation, thresholds, list);
          StepBuckets made;
          list.sort();
          list.read(made);
          StepBuckets expected;
          InterpolationKernel reference;
          reference.fire(
              InterpolatedInterval<std::uint8_t>{
                  {last.view(), now.view(), count}, flow.view(), interpolation, steps, thresholds},
              threads, expected);
          ASSERT_EQ(scene::copy(made), scene::copy(expected))
              << width << "x" << height << ", " << count << " steps, interpolation "
              << static_cast<int>(interpolation);
          events += made.size();
        }
      }
    }
  }
  EXPECT_GT(events, 100'000U);
}

std::vector<Flow> flow_between(gl::FarnebackFlow& flow, const gl::GreyFrame& from,
                               const gl::GreyFrame& to, const LumaFormat& format) {
  flow.push(from);
  flow.push(to);
  std::vector<Flow> found(gl::pixel_count(format));
  flow.find().read(std::as_writable_bytes(std::span(found)));
  return found;
}

TEST_P(EveryApi, FindsTheFlowOfTheCpu) {
  ThreadPool threads;
  for (const auto& [width, height] : {std::pair{1, 1}, {9, 1}, {13, 7}, {97, 61}, {259, 261}}) {
    SCOPED_TRACE(testing::Message() << width << "x" << height);
    const LumaFormat format{width, height, 8};
    const gl::GreyFrame frames[] = {{context, format}, {context, format}};
    gl::FarnebackFlow flow(context, format);
    for (const auto& [from, to] :
         {std::pair{scene::texture<std::uint8_t>(width, height, 8, 0, 0),
                    scene::texture<std::uint8_t>(width, height, 8, 2.3, -1.4)},
          {scene::noise<std::uint8_t>(width, height, 8, 1),
           scene::noise<std::uint8_t>(width, height, 8, 2)}}) {
      upload(from, frames[0]);
      upload(to, frames[1]);
      const auto found = flow_between(flow, frames[0], frames[1], format);
      FarnebackFlow reference;
      const auto expected = without_padding(reference.find(from.view(), to.view(), threads));
      double sum = 0;
      for (std::size_t i = 0; i < found.size(); ++i)
        sum += std::hypot(found[i].x - expected[i].x, found[i].y - expected[i].y);
      EXPECT_LE(sum / static_cast<double>(found.size()), 1e-3);
    }
  }
}

TEST_P(EveryApi, FindsNoFlowBetweenEqualPictures) {
  constexpr LumaFormat format{150, 130, 8};
  const gl::GreyFrame frames[] = {{context, format}, {context, format}};
  const auto picture = scene::noise<std::uint8_t>(format.width, format.height, 8, 1);
  for (const auto& frame : frames) upload(picture, frame);
  gl::FarnebackFlow flow(context, format);
  for (const auto& [x, y] : flow_between(flow, frames[0], frames[1], format)) {
    ASSERT_EQ(x, 0);
    ASSERT_EQ(y, 0);
  }
}

/// The events may differ where the last bits of the flow do. The CPU computes flow only around an
/// object in front of a static background.
TEST_P(EveryApi, FollowsAMovingObjectAsTheCpuDoes) {
  const LumaFormat format{301, 203, 8};
  const auto ours = gl::make_dense_simulator(context, format);
  const auto reference = make_dense_simulator(format);
  reference->set_flow(FlowMethod::farneback);
  const Settings settings{.positive_threshold = 2, .negative_threshold = 3};
  const auto object = scene::texture<std::uint8_t>(30, 24, 8, 40, 70);
  Texture texture(format.width, format.height, 1);
  for (const auto interpolation : {Interpolation::forward, Interpolation::blend}) {
    ours->set_interpolation(interpolation);
    reference->set_interpolation(interpolation);
    ours->reset();
    reference->reset();
    for (int i = 0; i < 3; ++i) {
      auto frame = scene::texture<std::uint8_t>(format.width, format.height, 8, 0, 0);
      for (int y = 0; y < object.height(); ++y)
        for (int x = 0; x < object.width(); ++x)
          frame.at(80 + 2 * i + x, 60 + i + y) = object.at(x, y);
      const auto time = i * scene::frame_time;
      const auto* made =
          gl_test::events_until(*ours, texture.show(gl_test::bytes_of(frame)), time, settings);
      const auto* expected = reference->push(scene::luma(frame), time, settings);
      if (i == 0) continue;
      const auto events = scene::copy(*made);
      const auto wanted = scene::copy(*expected);
      EXPECT_TRUE(scene::sorted(events));
      EXPECT_GT(wanted.size(), 1000U);
      const auto step = static_cast<std::uint32_t>(scene::frame_time / 11 / 1000 + 1);
      EXPECT_GE(matched(events, wanted, step), 0.995);
      EXPECT_GE(matched(wanted, events, step), 0.995);
      EXPECT_NEAR(static_cast<double>(events.size()), static_cast<double>(wanted.size()),
                  0.01 * static_cast<double>(wanted.size()));
    }
  }
}

}  // namespace
