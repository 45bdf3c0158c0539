// SPDX-License-Identifier: LGPL-2.1-or-later
// How well each method of eventdenoise tells noise from signal: filters the labelled events of a
// CSV file with a range of settings, and prints what is kept.
//
//     denoise_bench FILE.csv WIDTH HEIGHT NOISE_RATE
//
// Lines: noise rate (Hz, as given), method, setting, share of signal kept, share of noise kept.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <vector>

#include "src/filter/denoise_filter.hpp"
#include "src/formats/text/csv_decoder.hpp"

namespace {

using namespace eventcamera;

struct Labelled {
  std::vector<Event> events;
  std::vector<Label> labels;
};

Labelled read_labelled(const char* path) {
  std::ifstream file(path, std::ios::binary);
  const std::vector<std::uint8_t> bytes{std::istreambuf_iterator<char>(file), {}};
  const auto decoder = make_csv_decoder();
  Decoded decoded;
  decoder->decode(bytes, decoded);
  decoder->finish(decoded);
  Labelled result;
  for (const auto& event : decoded.events) {
    const auto t = static_cast<std::uint32_t>(event.t - decoded.events.front().t);
    result.events.push_back({t, event.x, event.y_p});
    result.labels.push_back(label_of(event));
  }
  return result;
}

double count_of(std::span<const Label> labels, Cause cause) {
  return static_cast<double>(
      std::ranges::count_if(labels, [&](const Label& label) { return label.cause == cause; }));
}

void print(const char* rate, const char* method, double setting, const Labelled& all,
           SensorSize sensor, const DenoiseFilter::Settings& settings) {
  DenoiseFilter filter(sensor);
  Labelled copy = all;
  const auto kept = filter.filter({copy.events, copy.labels}, 0, settings);
  const auto share = [&](Cause cause) {
    return count_of(kept.labels, cause) / count_of(all.labels, cause);
  };
  std::printf("%s %s %g %.6f %.6f\n", rate, method, setting, share(Cause::light),
              share(Cause::shot_noise));
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 5) {
    std::fprintf(stderr, "usage: denoise_bench FILE.csv WIDTH HEIGHT NOISE_RATE\n");
    return 2;
  }
  const SensorSize sensor{std::atoi(argv[2]), std::atoi(argv[3])};
  const char* const rate = argv[4];
  const Labelled all = read_labelled(argv[1]);
  if (count_of(all.labels, Cause::light) == 0 || count_of(all.labels, Cause::shot_noise) == 0) {
    std::fprintf(stderr, "%s: no labelled signal and noise\n", argv[1]);
    return 1;
  }
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
