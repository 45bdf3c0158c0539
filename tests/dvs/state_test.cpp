// SPDX-License-Identifier: LGPL-2.1-or-later
// A simulator that continues with the state of another one makes the same events, wherever the
// video is cut; corrupt states and those of others are refused.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <random>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "src/dvs/dvs_simulator.hpp"
#include "src/dvs/state_bytes.hpp"
#include "tests/dvs/playback.hpp"
#include "tests/simulate/scene.hpp"

namespace {

using namespace eventcamera;

constexpr int frame_count = 9;

/// Frame of a moving texture, whose exposure changes, at times that vary.
template <class Pixel>
Image<Pixel> frame_of(const LumaFormat& format, int i) {
  auto frame = scene::texture<Pixel>(format.width, format.height, format.bits, 0.7 * i, 0.4 * i);
  const double gain = std::pow(0.9, i % 3);
  for (int y = 0; y < format.height; ++y)
    for (int x = 0; x < format.width; ++x)
      frame.at(x, y) = static_cast<Pixel>(std::lround(gain * frame.at(x, y)));
  return frame;
}

Nanoseconds time_of(int i) {
  return 5'000'000'123 + i * 33'333'333LL + i % 3 * 1'234'567LL;
}

template <class Pixel>
void play(Playback& playback, const LumaFormat& format, int first, int last) {
  for (int i = first; i < last; ++i)
    playback.push(frame_of<Pixel>(format, i), format.bits, time_of(i));
}

/// A simulator of this format and of these settings that has seen a few frames.
Playback played(const LumaFormat& format, const DvsSettings& settings) {
  Playback playback(format, settings);
  play<std::uint8_t>(playback, format, 0, 4);
  return playback;
}

bool are_same(const std::vector<TimedEvent>& a, const std::vector<TimedEvent>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const auto& one, const auto& other) {
    return one.t == other.t && one.x == other.x && one.y == other.y &&
           one.polarity == other.polarity && one.cause == other.cause;
  });
}

template <class Pixel>
void expect_no_seams(const LumaFormat& format, const DvsSettings& settings, bool labels,
                     std::minstd_rand& random) {
  const Settings common{.threads = 2, .labels = labels};
  Playback whole(format, settings, common);
  play<Pixel>(whole, format, 0, frame_count);
  ASSERT_GT(whole.events.size(), 100U);

  std::vector<TimedEvent> joined;
  std::vector<std::uint8_t> state;
  for (int first = 0; first < frame_count;) {
    const int last = std::min<int>(first + 1 + static_cast<int>(random() % 4), frame_count);
    Playback segment(format, settings, common);
    if (first > 0) segment.simulator().restore(state);
    play<Pixel>(segment, format, first, last);
    state = segment.simulator().state();
    joined.insert(joined.end(), segment.events.begin(), segment.events.end());
    first = last;
  }
  EXPECT_TRUE(are_same(joined, whole.events))
      << joined.size() << " and " << whole.events.size() << " events";
}

std::vector<DvsSettings> all_kinds() {
  auto slow = everything();
  slow.max_rate = 5e4;
  auto late = everything();
  late.pixel_latency = 50'000'000;  // beyond the next frame
  auto pulsed = everything();
  pulsed.exposure_lead = 400'000;  // so that pulses do not end with the frame
  std::vector<DvsSettings> kinds{everything(),
                                 pulsed,
                                 slow,
                                 late,
                                 DvsSettings{.refractory_period = 9'000'000},
                                 DvsSettings{.adaptation = 0.4, .adaptation_time = 80'000'000}};
  for (const auto preset :
       {DvsPreset::ideal, DvsPreset::esim, DvsPreset::v2e_noisy, DvsPreset::icns,
        DvsPreset::davis240c, DvsPreset::davis346, DvsPreset::gen4, DvsPreset::hs_ergb})
    kinds.push_back(settings_of(preset));
  return kinds;
}

TEST(State, JoinsSegmentsWithoutASeam) {
  std::minstd_rand random(7);
  for (auto settings : all_kinds())
    for (const auto upsampling : {Upsampling::linear, Upsampling::motion})
      for (const bool compensates : {false, true}) {
        settings.upsampling = upsampling;
        settings.exposure_compensation = compensates;
        settings.seed = random();
        const bool labels = random() % 2 == 0;
        if (random() % 3 > 0)
          expect_no_seams<std::uint8_t>({75, 50, 8}, settings, labels, random);
        else
          expect_no_seams<std::uint16_t>({66, 40, 10}, settings, labels, random);
      }
}

TEST(State, IsOfAnyThreadsAndRepeatable) {
  const LumaFormat format{97, 66, 8};
  auto one = Playback(format, everything(), {.threads = 1});
  play<std::uint8_t>(one, format, 0, 4);
  auto two = played(format, everything());
  EXPECT_EQ(one.simulator().state(), two.simulator().state());
}

/// What restore() throws; empty if nothing.
std::string fault_of(std::span<const std::uint8_t> state, const LumaFormat& format,
                     const DvsSettings& settings) {
  Playback playback(format, settings);
  try {
    playback.simulator().restore(state);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return {};
}

TEST(State, IsRefusedIfOfOthers) {
  const LumaFormat format{40, 30, 8};
  const auto settings = everything();
  const auto state = played(format, settings).simulator().state();
  EXPECT_EQ(fault_of(state, format, settings), "");
  EXPECT_EQ(fault_of(state, {41, 30, 8}, settings), "its frames have another width");
  EXPECT_EQ(fault_of(state, {40, 31, 8}, settings), "its frames have another height");
  EXPECT_EQ(fault_of(state, {40, 30, 10}, settings), "its frames have another bit depth");
  auto others = settings;
  ++others.seed;
  EXPECT_EQ(fault_of(state, format, others), "it is of other properties");
}

TEST(State, HasAReadoutOfAnyRate) {
  const LumaFormat format{40, 30, 8};
  for (const double rate : {1e12, 1.0, 1e-12, 1e-320}) {
    const DvsSettings settings{.max_rate = rate};
    EXPECT_EQ(fault_of(played(format, settings).simulator().state(), format, settings), "") << rate;
  }
}

TEST(State, HasTheRangeOfLuma) {
  const DvsSettings settings{.overexposed_light = 4};
  const auto white = flat(40, 30, 235);
  auto luma = scene::luma(white);
  luma.is_narrow = true;
  Playback before({40, 30, 8}, settings);
  before.simulator().push(luma, 0, {});
  Playback after({40, 30, 8}, settings);
  after.simulator().restore(before.simulator().state());
  const auto* held = after.simulator().hold_until(scene::frame_time);
  ASSERT_NE(held, nullptr);
  EXPECT_EQ(held->size(), 0U);
}

/// With the right checksum.
std::vector<std::uint8_t> sealed(std::vector<std::uint8_t> state) {
  const std::size_t size = state.size() - sizeof(std::uint64_t);
  const auto sum = checksum_of(std::span(state).first(size));
  std::memcpy(state.data() + size, &sum, sizeof sum);
  return state;
}

TEST(State, IsRefusedIfCorrupt) {
  const LumaFormat format{16, 9, 8};
  const auto settings = everything();
  const auto state = played(format, settings).simulator().state();
  for (std::size_t i = 0; i < state.size(); i += 7) {
    auto corrupt = state;
    corrupt[i] ^= 0x40;
    EXPECT_EQ(fault_of(corrupt, format, settings), "its checksum is wrong") << i;
  }
  for (std::size_t size = 8; size < state.size(); size += 31)
    EXPECT_EQ(fault_of(sealed({state.begin(), state.begin() + static_cast<std::ptrdiff_t>(size)}),
                       format, settings),
              "it is too short");
  EXPECT_EQ(fault_of({}, format, settings), "it is too short");
  auto longer = state;
  longer.push_back(0);
  EXPECT_EQ(fault_of(sealed(longer), format, settings), "it is too long");
  auto other = state;
  other[7] = '0';
  EXPECT_EQ(fault_of(sealed(other), format, settings),
            "it is not a state that this version writes");
}

}  // namespace
