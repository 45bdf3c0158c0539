// SPDX-License-Identifier: LGPL-2.1-or-later
// How well each method of eventdenoise tells noise from signal: adds noise of known rates to the
// events of a RAW file, filters them with a range of settings, and prints what is kept.
//
//     denoise_bench FILE.raw WIDTH HEIGHT
//
// Lines: noise rate (Hz per pixel), method, setting, share of signal kept, share of noise kept.
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "src/filter/denoise_filter.hpp"
#include "src/formats/evt/raw.hpp"

namespace {

using namespace eventcamera;

struct Labelled {
  std::vector<Event> events;
  std::vector<Label> labels;
};

std::vector<AbsoluteEvent> read_events(const char* path) {
  std::ifstream file(path, std::ios::binary);
  const std::vector<std::uint8_t> bytes{std::istreambuf_iterator<char>(file), {}};
  Decoded decoded;
  make_prophesee_raw_decoder()->decode(bytes, decoded);
  return decoded.events;
}

/// Signal, with noise of `rate` events per pixel and second at random times.
Labelled with_noise(const std::vector<AbsoluteEvent>& signal, SensorSize sensor, double rate) {
  std::mt19937_64 random(1);
  const Microseconds first = signal.front().t;
  std::exponential_distribution<double> interval(rate * sensor.width * sensor.height / 1e6);
  double noise_time = interval(random);
  Labelled result;
  for (const auto& event : signal) {
    const auto t = static_cast<std::uint32_t>(event.t - first);
    for (; noise_time < t; noise_time += interval(random)) {
      const auto below = [&](int end) {
        return static_cast<int>(random() % static_cast<unsigned>(end));
      };
      result.events.push_back(Event::at(below(sensor.width), below(sensor.height),
                                        static_cast<std::uint32_t>(noise_time),
                                        below(2) == 0 ? Polarity::off : Polarity::on));
      result.labels.push_back({.cause = Cause::shot_noise});
    }
    result.events.push_back({t, event.x, event.y_p});
    result.labels.push_back({.cause = Cause::light});
  }
  return result;
}

double count_of(std::span<const Label> labels, Cause cause) {
  return static_cast<double>(
      std::ranges::count_if(labels, [&](const Label& label) { return label.cause == cause; }));
}

void print(double rate, const char* method, double setting, const Labelled& all, SensorSize sensor,
           const DenoiseFilter::Settings& settings) {
  DenoiseFilter filter(sensor);
  Labelled copy = all;
  const auto kept = filter.filter({copy.events, copy.labels}, 0, settings);
  const auto share = [&](Cause cause) {
    return count_of(kept.labels, cause) / count_of(all.labels, cause);
  };
  std::printf("%g %s %g %.6f %.6f\n", rate, method, setting, share(Cause::light),
              share(Cause::shot_noise));
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fprintf(stderr, "usage: denoise_bench FILE.raw WIDTH HEIGHT\n");
    return 2;
  }
  const SensorSize sensor{std::atoi(argv[2]), std::atoi(argv[3])};
  const auto signal = read_events(argv[1]);
  if (signal.empty()) {
    std::fprintf(stderr, "%s: no events\n", argv[1]);
    return 1;
  }
  for (const double rate : {1.0, 5.0, 10.0}) {
    const Labelled all = with_noise(signal, sensor, rate);
    const auto sweep_time = [&](const char* name, DenoiseFilter::Settings settings) {
      for (double milliseconds = 0.1; milliseconds < 3000; milliseconds *= 1.5) {
        settings.correlation_time = static_cast<Nanoseconds>(milliseconds * 1e6);
        print(rate, name, milliseconds, all, sensor, settings);
      }
    };
    sweep_time("baf", {.method = DenoiseMethod::baf});
    sweep_time("stcf", {});
    sweep_time("stcf-match-polarity", {.match_polarity = true});
    for (double threshold = 0.05; threshold < 12; threshold *= 1.25)
      print(rate, "time-kernel", threshold, all, sensor,
            {.method = DenoiseMethod::time_kernel, .threshold = threshold});
    for (unsigned distance = 0; distance < 40; ++distance)
      print(rate, "dwf", distance, all, sensor,
            {.method = DenoiseMethod::dwf, .search_distance = distance});
    print(rate, "default-baf", 2, all, sensor, {.method = DenoiseMethod::baf});
    print(rate, "default-stcf", 25, all, sensor, {});
    print(rate, "default-time-kernel", 3, all, sensor, {.method = DenoiseMethod::time_kernel});
    print(rate, "default-dwf", 9, all, sensor, {.method = DenoiseMethod::dwf});
  }
}
