// SPDX-License-Identifier: LGPL-2.1-or-later
// In steady state, a simulator allocates nothing per frame.
#include <gtest/gtest.h>

#include <atomic>
#include <cerrno>
#include <cstddef>

#include "src/dvs/dvs_simulator.hpp"
#include "src/render/accumulator.hpp"
#include "src/simulate/interpolation.hpp"
#include "src/simulate/simulators.hpp"
#include "tests/simulate/scene.hpp"

/// In place of src/core/thread_pool.cpp: deals the rounds of every loop out to the threads in turn,
/// so that each needs its memory in the same rounds of every run.
namespace eventcamera {

ThreadPool::~ThreadPool() = default;

void ThreadPool::set_threads(int threads) {
  workers_.resize(static_cast<std::size_t>(threads - 1));
}

void ThreadPool::run(int count, Round round, const void* body) {
  for (int i = 0; i < count; ++i) round(body, i, i % threads());
}

}  // namespace eventcamera

/// Heap allocations of the process, operator new included, on all threads.
static std::atomic<int> allocations = 0;

// Replace glibc's functions, and call these by their other names.
extern "C" {

void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* memory, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

__attribute__((visibility("default"))) void* malloc(std::size_t size) {
  ++allocations;
  return __libc_malloc(size);
}

__attribute__((visibility("default"))) void* calloc(std::size_t count, std::size_t size) {
  ++allocations;
  return __libc_calloc(count, size);
}

__attribute__((visibility("default"))) void* realloc(void* memory, std::size_t size) {
  ++allocations;
  return __libc_realloc(memory, size);
}

__attribute__((visibility("default"))) void* aligned_alloc(std::size_t alignment,
                                                           std::size_t size) {
  ++allocations;
  return __libc_memalign(alignment, size);
}

__attribute__((visibility("default"))) int posix_memalign(void** memory, std::size_t alignment,
                                                          std::size_t size) {
  ++allocations;
  *memory = __libc_memalign(alignment, size);
  return *memory == nullptr ? ENOMEM : 0;
}
}

namespace {

using namespace eventcamera;

constexpr int width = 160;
constexpr int height = 120;
constexpr int threads = 2;

/// Frames that are repeated until a simulator is in steady state.
constexpr int frames_a_round = 6;

template <class Frame>
int allocations_in_steady_state(const Frame& take_frame) {
  int before = 0;
  for (int i = 0; i < 5 * frames_a_round; ++i) {
    if (i == 2 * frames_a_round) before = allocations;
    take_frame(i % frames_a_round);
  }
  return allocations - before;
}

template <class Pixel>
std::vector<Image<Pixel>> frames_of_a_drift(int bits) {
  std::vector<Image<Pixel>> frames;
  for (int i = 0; i < frames_a_round; ++i)
    frames.push_back(scene::texture<Pixel>(width, height, bits, 1.7 * i, 0.6 * i));
  return frames;
}

/// Allocations per frame of the simulator that `make` creates.
template <class Pixel>
int allocations_of(std::unique_ptr<Simulator> (*make)(const LumaFormat&), int bits) {
  const auto frames = frames_of_a_drift<Pixel>(bits);
  const auto simulator = make({width, height, bits});
  const Settings settings{.positive_threshold = 5, .negative_threshold = 5, .threads = threads};
  Nanoseconds time = 0;
  std::size_t events = 0;
  const int counted = allocations_in_steady_state([&](int i) {
    const auto luma = scene::luma(frames[static_cast<std::size_t>(i)].view(), bits);
    if (const auto* made = simulator->push(luma, time += scene::frame_time, settings))
      events += made->size();
  });
  EXPECT_GT(events, 10'000U);
  return counted;
}

TEST(Allocations, AreNotMadeByTheDifferenceFrame) {
  EXPECT_EQ(allocations_of<std::uint8_t>(make_frame_simulator, 8), 0);
  EXPECT_EQ(allocations_of<std::uint16_t>(make_frame_simulator, 12), 0);
}

TEST(Allocations, AreNotMadeByMethodsThatTrackPixels) {
  EXPECT_EQ(allocations_of<std::uint8_t>(make_sparse_simulator, 8), 0);
  EXPECT_EQ(allocations_of<std::uint16_t>(make_sparse_simulator, 12), 0);
  EXPECT_EQ(allocations_of<std::uint8_t>(make_diff_simulator, 8), 0);
  EXPECT_EQ(allocations_of<std::uint16_t>(make_diff_simulator, 12), 0);
}

TEST(Allocations, AreNotMadeByDenseInterpolationWithOurOwnFlow) {
  const auto with_farneback = [](const LumaFormat& format) -> std::unique_ptr<Simulator> {
    auto simulator = make_dense_simulator(format);
    simulator->set_flow(FlowMethod::farneback);
    return simulator;
  };
  EXPECT_EQ(allocations_of<std::uint8_t>(with_farneback, 8), 0);
  EXPECT_EQ(allocations_of<std::uint16_t>(with_farneback, 12), 0);
}

TEST(Allocations, AreNotMadeByPhysicalPixels) {
  const auto ideal = [](const LumaFormat& format) -> std::unique_ptr<Simulator> {
    return make_dvs_simulator(format);
  };
  EXPECT_EQ(allocations_of<std::uint8_t>(ideal, 8), 0);
  const auto limited = [](const LumaFormat& format) -> std::unique_ptr<Simulator> {
    auto simulator = make_dvs_simulator(format);
    // The limit of the readout is constant.
    simulator->set({.cutoff_frequency = 100, .refractory_period = 100'000, .max_rate = 2e5});
    return simulator;
  };
  EXPECT_EQ(allocations_of<std::uint16_t>(limited, 12), 0);
}

/// Interpolation along a rotating flow, so that tiles differ from frame to frame.
template <class Pixel>
int allocations_of_interpolation(int bits, Interpolation interpolation) {
  const auto frames = frames_of_a_drift<Pixel>(bits);
  std::vector<Image<Flow>> flows;
  for (int i = 0; i < frames_a_round; ++i) {
    flows.emplace_back(width, height);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        flows.back().at(x, y) = {0.1F * static_cast<float>(x * i % 30),
                                 0.02F * static_cast<float>(y)};
  }
  ThreadPool pool;
  pool.set_threads(threads);
  InterpolationKernel kernel;
  StepBuckets events;
  return allocations_in_steady_state([&](int i) {
    const auto& last = frames[static_cast<std::size_t>(i)];
    const auto& now = frames[static_cast<std::size_t>((i + 1) % frames_a_round)];
    const StepTimes steps(scene::frame_time, 11);
    kernel.fire(InterpolatedInterval<Pixel>{{last.view(), now.view(), steps.count()},
                                            flows[static_cast<std::size_t>(i)].view(),
                                            interpolation,
                                            steps,
                                            {3 << (bits - 8), 3 << (bits - 8)}},
                pool, events);
    EXPECT_GT(events.size(), 1000U);
  });
}

TEST(Allocations, AreNotMadeByDenseInterpolationOnceTheFlowIsFound) {
  for (const auto interpolation : {Interpolation::forward, Interpolation::blend}) {
    EXPECT_EQ(allocations_of_interpolation<std::uint8_t>(8, interpolation), 0);
    EXPECT_EQ(allocations_of_interpolation<std::uint16_t>(12, interpolation), 0);
  }
}

TEST(Allocations, AreNotMadeByCopyingOrDrawingEvents) {
  const auto frames = frames_of_a_drift<std::uint8_t>(8);
  const auto simulator = make_frame_simulator({width, height, 8});
  const Settings settings{.positive_threshold = 5, .negative_threshold = 5, .threads = threads};
  simulator->push(scene::luma(frames[0]), 0, settings);
  const auto* events = simulator->push(scene::luma(frames[1]), scene::frame_time, settings);
  std::vector<Event> copied(events->size());
  Accumulator accumulator(width, height);
  std::vector<std::byte> picture(std::size_t{width} * height);
  EXPECT_EQ(allocations_in_steady_state([&](int) {
              events->write_to(copied.data(), simulator->threads());
              accumulator.add(*events, simulator->threads());
              accumulator.draw(palette(PaletteName::dark), {}, picture.data(), width,
                               simulator->threads());
            }),
            0);
}

}  // namespace
