// SPDX-License-Identifier: LGPL-2.1-or-later
// In steady state, a simulator allocates nothing per frame.
#include <gtest/gtest.h>

#include <atomic>
#include <cerrno>
#include <cstddef>
#include <functional>
#include <memory>
#include <utility>

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

using Make = std::function<std::unique_ptr<Simulator>(const LumaFormat&)>;

/// Allocations of a simulator in steady state.
template <class Pixel>
int allocations_of(const Make& make, int bits) {
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

/// With our own flow; OpenCV's allocates.
Make dense(Interpolation interpolation) {
  return [interpolation](const LumaFormat& format) {
    auto simulator = make_dense_simulator(format);
    simulator->set_flow(FlowMethod::farneback);
    simulator->set_interpolation(interpolation);
    return simulator;
  };
}

TEST(Allocations, AreNotMadeBySimulators) {
  const std::pair<const char*, Make> simulators[] = {
      {"frame", make_frame_simulator},
      {"sparse", make_sparse_simulator},
      {"diff", make_diff_simulator},
      {"dense", dense(Interpolation::forward)},
      {"dense, blended", dense(Interpolation::blend)},
      {"dvs", make_dvs_simulator},
      {"dvs of limited bandwidth and rate", [](const LumaFormat& format) {
         auto simulator = make_dvs_simulator(format);
         // The limit of the readout is constant.
         simulator->set({.cutoff_frequency = 100, .refractory_period = 100'000, .max_rate = 2e5});
         return simulator;
       }}};
  for (const auto& [name, make] : simulators) {
    EXPECT_EQ(allocations_of<std::uint8_t>(make, 8), 0) << name;
    EXPECT_EQ(allocations_of<std::uint16_t>(make, 12), 0) << name;
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
