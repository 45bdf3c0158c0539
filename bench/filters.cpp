// SPDX-License-Identifier: LGPL-2.1-or-later
// Filters events of 1280x720 pixels on one core: million events per second at the best of several
// runs, and the time as a multiple of that of a memcpy of the events. Names are FILTER/STREAM.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
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
  const char* data = std::getenv("SHARED_DATA");
  const auto path =
      std::filesystem::path(data != nullptr ? data : "") / "events/evt3-1280x720-triggers.raw";
  std::ifstream file(path, std::ios::binary);
  const std::vector<std::uint8_t> bytes{std::istreambuf_iterator<char>(file), {}};
  Stream stream{"real", {}, 1};
  if (bytes.empty()) {
    std::fprintf(stderr, "%s is missing: no figures for real events\n", path.c_str());
    return stream;
  }
  Decoded decoded;
  make_prophesee_raw_decoder()->decode(bytes, decoded);
  const auto& recorded = decoded.events;
  const Microseconds first = recorded.front().t;
  const Microseconds length = recorded.back().t - first + 1;
  for (Microseconds shift = 0; stream.events.size() < count; shift += length)
    for (const auto& event : recorded)
      stream.events.push_back(
          {static_cast<std::uint32_t>(event.t - first + shift), event.x, event.y_p});
  stream.duration = stream.events.back().t + 1;
  return stream;
}

/// Times a filter on buffers as they come from a camera.
template <class Core>
void register_filter(const std::string& name, const Stream& stream,
                     const typename Core::Settings& settings) {
  benchmark::RegisterBenchmark((name + "/" + stream.name).c_str(), [&stream, settings](
                                                                       benchmark::State& state) {
    constexpr std::size_t buffer_size = 1 << 15;
    Core core(sensor);
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
        const auto left =
            core.filter({std::span(scratch).subspan(done, size), {}}, start, settings);
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

/// The check of all events that elements do before they filter.
struct Validation {
  struct Settings {};

  explicit Validation(SensorSize size) : sensor_size(size) {}
  LabelledEvents filter(LabelledEvents events, Microseconds, const Settings&) const {
    InvalidEvents invalid;
    return keep_valid(events, sensor_size, UINT32_MAX, invalid);
  }

  SensorSize sensor_size;
};

/// Size of the output of filters that change it: a quarter of the sensor.
constexpr SensorSize quarter{sensor.width / 2, sensor.height / 2};

struct Crop : CropFilter {
  explicit Crop(SensorSize size) : CropFilter(size, quarter) {}
};

struct Scale : ScaleFilter {
  explicit Scale(SensorSize size) : ScaleFilter(size, quarter) {}
};

struct Rotation {
  struct Settings {};

  explicit Rotation(SensorSize size) : flip(size, {.transpose = true, .mirror_x = true}) {}
  LabelledEvents filter(LabelledEvents events, Microseconds, const Settings&) const {
    return flip.filter(events);
  }

  FlipFilter flip;
};

/// Drops the pixels of one column in eight.
struct Mask {
  struct Settings {};

  explicit Mask(SensorSize size) : mask(size) {
    for (int y = 0; y < size.height; ++y)
      for (int x = 0; x < size.width; ++x)
        if (x % 8 != 0) mask.keep(x, y);
  }
  LabelledEvents filter(LabelledEvents events, Microseconds, const Settings&) const {
    return mask.filter(events);
  }

  PixelMask mask;
};

/// Of a wide-angle lens.
struct Undistort {
  struct Settings {};

  explicit Undistort(SensorSize size)
      : undistort(size, {.fx = 900,
                         .fy = 900,
                         .cx = size.width / 2.0,
                         .cy = size.height / 2.0,
                         .distortion = {-0.3, 0.1, 0, 0, 0}}) {}
  LabelledEvents filter(LabelledEvents events, Microseconds, const Settings&) const {
    return undistort.filter(events);
  }

  UndistortFilter undistort;
};

void register_all(const Stream& stream) {
  register_filter<Validation>("validation", stream, {});
  register_filter<Crop>("crop", stream, {.left = 320, .right = 320, .top = 180, .bottom = 180});
  register_filter<Rotation>("rotation", stream, {});
  register_filter<PolarityFilter>("polarity", stream, {.keep = PolarityFilter::Kept::on});
  register_filter<Mask>("mask", stream, {});
  register_filter<Scale>("scale", stream, {});
  register_filter<Scale>("scale-counted", stream, {.min_events = 4});
  register_filter<Undistort>("undistortion", stream, {});
  register_filter<RefractoryFilter>("refractory", stream, {});
  register_filter<HotPixelFilter>("hot-pixel", stream, {});
  register_filter<TrailFilter>("trail", stream, {});
  register_filter<TrailFilter>("stc-cut-trail", stream, {.mode = TrailMode::stc_cut_trail});
  register_filter<FlickerFilter>("anti-flicker", stream, {});
  register_filter<RateFilter>("rate-control", stream, {.max_rate = 1'000'000});
  register_filter<DenoiseFilter>("baf", stream, {.method = DenoiseMethod::baf});
  register_filter<DenoiseFilter>("stcf", stream, {.method = DenoiseMethod::stcf});
  register_filter<DenoiseFilter>("time-kernel", stream, {.method = DenoiseMethod::time_kernel});
  register_filter<DenoiseFilter>("dwf", stream, {.method = DenoiseMethod::dwf});
}

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  const Stream streams[] = {real_stream(), random_stream()};
  for (const auto& stream : streams)
    if (!stream.events.empty()) register_all(stream);
  benchmark::RunSpecifiedBenchmarks();
}
