// SPDX-License-Identifier: LGPL-2.1-or-later
// Filters events of 1280x720 pixels on one core: million events per second at the best of several
// runs, and the time as a multiple of that of a memcpy of the events. Names are FILTER/STREAM.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "bench/codec_timing.hpp"
#include "src/filter/crop_filter.hpp"
#include "src/filter/denoise_filter.hpp"
#include "src/filter/filter.hpp"
#include "src/filter/flicker_filter.hpp"
#include "src/filter/flip_filter.hpp"
#include "src/filter/hot_pixel_filter.hpp"
#include "src/filter/pixel_mask.hpp"
#include "src/filter/polarity_filter.hpp"
#include "src/filter/rate_filter.hpp"
#include "src/filter/refractory_filter.hpp"
#include "src/filter/scale_filter.hpp"
#include "src/filter/trail_filter.hpp"
#include "src/filter/undistort_filter.hpp"
#include "src/formats/evt/raw.hpp"
#include "tests/formats/recordings.hpp"
#include "tests/formats/shared_data.hpp"

namespace {

using namespace eventcamera;

constexpr SensorSize sensor{1280, 720};
constexpr std::size_t count = 1 << 21;

/// Events with times from 0 to `duration`.
struct Stream {
  std::string name;
  std::vector<Event> events;
  Microseconds duration;
};

/// Random pixels, 10 million per second: the worst case, for which no pixel is in the cache.
Stream random_stream() {
  recordings::Random random(1);
  Stream stream{"random", {}, count / 10 + 1};
  for (std::size_t i = 0; i < count; ++i)
    stream.events.push_back(
        Event::at(recordings::below(random, sensor.width), recordings::below(random, sensor.height),
                  static_cast<std::uint32_t>(i / 10),
                  recordings::below(random, 2) == 0 ? Polarity::off : Polarity::on));
  return stream;
}

/// A recording of a camera, over and over. Without it there are no events.
Stream real_stream() {
  const auto bytes = shared_data::events_file("evt3-1280x720-triggers.raw");
  Stream stream{"real", {}, 1};
  if (bytes.empty()) {
    std::fputs("no recording in $SHARED_DATA: no figures for real events\n", stderr);
    return stream;
  }
  const auto recorded = recordings::decode(*make_prophesee_raw_decoder(), bytes).events;
  const Microseconds first = recorded.front().t;
  const Microseconds length = recorded.back().t - first + 1;
  for (Microseconds shift = 0; stream.events.size() < count; shift += length)
    for (const auto& event : recorded)
      stream.events.push_back(
          {static_cast<std::uint32_t>(event.t - first + shift), event.x, event.y_p});
  stream.duration = stream.events.back().t + 1;
  return stream;
}

/// Times a filter on buffers as they come from a camera. make() returns a function that filters a
/// buffer and gets its start.
template <class Make>
void add(const std::string& name, const Stream& stream, const Make& make) {
  benchmark::RegisterBenchmark((name + "/" + stream.name).c_str(), [=, &stream](
                                                                       benchmark::State& state) {
    constexpr std::size_t buffer_size = 1 << 15;
    auto filter = make();
    Microseconds start = 0;
    std::vector<Event> scratch;
    double kept = 0;
    double seconds = 1;
    for (auto _ : state) {
      scratch = stream.events;
      kept = 0;
      const double begin = bench::seconds_now();
      for (std::size_t done = 0; done < scratch.size(); done += buffer_size) {
        const auto size = std::min(buffer_size, scratch.size() - done);
        const LabelledEvents left = filter({std::span(scratch).subspan(done, size), {}}, start);
        kept += static_cast<double>(left.events.size());
      }
      seconds = std::min(seconds, bench::seconds_now() - begin);
      start += stream.duration;
    }
    const auto size = static_cast<double>(stream.events.size());
    state.counters["Mevents/s"] = size / seconds / 1e6;
    state.counters["memcpys"] = seconds / bench::memcpy_seconds(stream.events);
    state.counters["kept"] = kept / size;
  })->Unit(benchmark::kMillisecond);
}

/// Filter with settings.
template <class Filter>
auto with(const typename Filter::Settings& settings) {
  return [settings] {
    return [settings, filter = Filter(sensor)](LabelledEvents events, Microseconds start) mutable {
      return filter.filter(events, start, settings);
    };
  };
}

/// Filter without settings or state.
template <class Filter>
auto fixed(const Filter& filter) {
  return [&filter] {
    return [&filter](LabelledEvents events, Microseconds) { return filter.filter(events); };
  };
}

/// Size of the output of filters that change it: a quarter of the sensor.
constexpr SensorSize quarter{sensor.width / 2, sensor.height / 2};

struct Crop : CropFilter {
  explicit Crop(SensorSize size) : CropFilter(size, quarter) {}
};

struct Scale : ScaleFilter {
  explicit Scale(SensorSize size) : ScaleFilter(size, quarter) {}
};

/// Keeps the pixels of seven columns in eight.
PixelMask columns() {
  PixelMask mask(sensor);
  for (int y = 0; y < sensor.height; ++y)
    for (int x = 0; x < sensor.width; ++x)
      if (x % 8 != 0) mask.keep(x, y);
  return mask;
}

void register_all(const Stream& stream) {
  static const FlipFilter rotation(sensor, {.transpose = true, .mirror_x = true});
  static const PixelMask mask = columns();
  static const UndistortFilter wide_angle(sensor, {.fx = 900,
                                                   .fy = 900,
                                                   .cx = sensor.width / 2.0,
                                                   .cy = sensor.height / 2.0,
                                                   .distortion = {-0.3, 0.1, 0, 0, 0}});
  add("validation", stream, [] {  // of all events, before elements filter
    return [](LabelledEvents events, Microseconds) {
      InvalidEvents invalid;
      return keep_valid(events, sensor, UINT32_MAX, invalid);
    };
  });
  add("crop", stream, with<Crop>({.left = 320, .right = 320, .top = 180, .bottom = 180}));
  add("rotation", stream, fixed(rotation));
  add("polarity", stream, with<PolarityFilter>({.keep = PolarityFilter::Kept::on}));
  add("mask", stream, fixed(mask));
  add("scale", stream, with<Scale>({}));
  add("scale-counted", stream, with<Scale>({.min_events = 4}));
  add("undistortion", stream, fixed(wide_angle));
  add("refractory", stream, with<RefractoryFilter>({}));
  add("hot-pixel", stream, with<HotPixelFilter>({}));
  add("trail", stream, with<TrailFilter>({}));
  add("stc-cut-trail", stream, with<TrailFilter>({.mode = TrailMode::stc_cut_trail}));
  add("anti-flicker", stream, with<FlickerFilter>({}));
  add("rate-control", stream, with<RateFilter>({.max_rate = 1'000'000}));
  add("baf", stream, with<DenoiseFilter>({.method = DenoiseMethod::baf}));
  add("stcf", stream, with<DenoiseFilter>({.method = DenoiseMethod::stcf}));
  add("time-kernel", stream, with<DenoiseFilter>({.method = DenoiseMethod::time_kernel}));
  add("dwf", stream, with<DenoiseFilter>({.method = DenoiseMethod::dwf}));
}

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  const Stream streams[] = {real_stream(), random_stream()};
  for (const auto& stream : streams)
    if (!stream.events.empty()) register_all(stream);
  benchmark::RunSpecifiedBenchmarks();
}
