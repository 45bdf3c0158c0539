// SPDX-License-Identifier: LGPL-2.1-or-later
// Filters keep the same events of recordings of cameras as their plain definitions.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "src/filter/denoise_filter.hpp"
#include "src/filter/flicker_filter.hpp"
#include "src/filter/hot_pixel_filter.hpp"
#include "src/filter/refractory_filter.hpp"
#include "src/filter/trail_filter.hpp"
#include "src/formats/evt/raw.hpp"
#include "tests/filter/streams.hpp"
#include "tests/formats/recordings.hpp"
#include "tests/reference/filters.hpp"

namespace {

using namespace eventcamera;
using streams::Events;

class RecordedFilters : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    const char* shared = std::getenv("SHARED_DATA");
    const auto path =
        std::filesystem::path(shared != nullptr ? shared : "") / "events" / GetParam();
    std::ifstream file(path, std::ios::binary);
    if (!file) GTEST_SKIP() << "no " << path;
    const std::vector<std::uint8_t> bytes{std::istreambuf_iterator<char>(file), {}};
    const auto decoder = make_prophesee_raw_decoder();
    events = recordings::decode(*decoder, bytes).events;
    sensor = decoder->size();
    constexpr std::size_t enough = 10'000;
    ASSERT_GT(events.size(), enough);
    events.resize(enough);
  }

  template <class Core>
  Events filtered(const typename Core::Settings& settings) const {
    Core core(sensor);
    return streams::filtered(core, events, settings, 5000);
  }

  Events events;
  SensorSize sensor;
};

TEST_P(RecordedFilters, KeepTheEventsOfTheReference) {
  EXPECT_TRUE(filtered<RefractoryFilter>({}) == reference::refractory(events, 1000));
  EXPECT_TRUE(filtered<TrailFilter>({.mode = TrailMode::stc_cut_trail}) ==
              reference::trail(events, reference::BurstPart::second, 10'000));
  EXPECT_TRUE(filtered<FlickerFilter>({}) ==
              reference::flicker(events, {50, 520, 0.5, 6, 4}, false));
  EXPECT_TRUE(filtered<HotPixelFilter>({.learning_period = 20'000'000}) ==
              reference::without_hot_pixels(events, sensor, 20'000, 10, 5));
  EXPECT_TRUE(filtered<DenoiseFilter>({.method = DenoiseMethod::baf}) ==
              reference::stcf(events, 2000, 1, false));
  EXPECT_TRUE(filtered<DenoiseFilter>({.match_polarity = true}) ==
              reference::stcf(events, 25'000, 2, true));
  EXPECT_TRUE(filtered<DenoiseFilter>({.method = DenoiseMethod::time_kernel}) ==
              reference::time_kernel(events, 32'000, 3));
  EXPECT_TRUE(filtered<DenoiseFilter>({.method = DenoiseMethod::dwf}) ==
              reference::double_window(events, 9));
}

INSTANTIATE_TEST_SUITE_P(Recordings, RecordedFilters,
                         testing::Values("evt3-1280x720-triggers.raw",
                                         "evt3-640x480-triggers.raw"));

}  // namespace
