// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>

#include "src/dvs/dvs_settings.hpp"

namespace eventcamera {
namespace {

struct Row {
  DvsPreset preset;
  Response response;
  double log_eps, dark_light;
  double cutoff_frequency;
  double positive_threshold, negative_threshold, threshold_sigma, threshold_jitter;
  double leak_rate, leak_spread, shot_noise_rate, hot_pixels;
  Nanoseconds refractory_period;
  RefractoryReset refractory_reset;
  Nanoseconds pixel_latency, pixel_latency_jitter;
  double max_rate;
};

using enum Response;
using enum RefractoryReset;
constexpr double dark = 20.0 / 255;  // v2e's

// esim: Rebecq et al., ESIM, CoRL 2018; thresholds of rpg_vid2e, offset of esim_py. v2e: Hu, Liu,
// Delbruck, CVPRW 2021; set_dvs_params("clean") and, for dim light, ("noisy"). icns: Joubert et
// al., Event camera simulator improvements via characterized parameters, Front.
//   Neurosci. 2021, with the parameters of its example. White is 10 klux; the response ln(lux + 1)
//   is ln(1e-4 + I) plus a constant. The time constant is 40 us at 1 klux and proportional to
//   1 / (lux + 1), so 4 us at white. Noise of 0.1 Hz ON and 0.01 Hz OFF is a single rate here.
//   davis346: v2e's own defaults, which its authors chose for their DAVIS346 in good light. The
//   leak of 0.1 Hz is what DVS-Voltmeter was fitted with on recordings of that camera. The readout
//   does 12 million events per second according to the data sheet. gen4: the ranges from which
//   OpenEB's own simulator samples: thresholds 0.15 and 0.1, refractory period 10 to 1000 us, leak
//   and shot noise up to 1 Hz, cutoff up to 900 Hz. These are their middles, on a suitable scale.
//   Finateu et al., ISSCC 2020: 1.066 Gev/s of readout, latency below 220 us at 5 lux and about 100
//   us in office light. The fractions of hot pixels are guesses. Times are nanoseconds.
//   clang-format off
constexpr Row table[] = {
    //                     response  eps   dark     cutoff ON    OFF   sigma  jitter leak  spread
    //                     shot   hot   period   reset   latency  jitter  max rate
    {DvsPreset::ideal, lin_log, 1e-3, dark, 0, 0.2, 0.2, 0, 0, 0, 0, 0, 0, 0, level, 0, 0, 0},
    {DvsPreset::esim, log, 1e-3, dark, 0, 0.2, 0.2, 0, 0, 0, 0, 0, 0, 0, level, 0, 0, 0},
    {DvsPreset::v2e_clean, lin_log, 1e-3, dark, 0, 0.2, 0.2, 0.02, 0, 0, 0, 0, 0, 0, level, 0, 0,
     0},
    {DvsPreset::v2e_noisy, lin_log, 1e-3, dark, 30, 0.2, 0.2, 0.05, 0, 0.1, 0.1, 5, 0, 0, level, 0,
     0, 0},
    {DvsPreset::icns, log, 1e-4, 1e-4, 39'789, 0.4, 0.4, 0.01, 0.01, 0, 0, 0.11, 0, 100'000, signal,
     100'000, 10'000, 0},
    {DvsPreset::davis346, lin_log, 1e-3, dark, 300, 0.2, 0.2, 0.03, 0, 0.1, 0.1, 0.001, 1e-4,
     500'000, level, 0, 0, 12e6},
    {DvsPreset::gen4, lin_log, 1e-3, dark, 450, 0.15, 0.1, 0.005, 0, 0.1, 0.1, 0.1, 1e-5, 100'000,
     signal, 100'000, 20'000, 1.066e9},
};
// clang-format on

}  // namespace

DvsSettings settings_of(DvsPreset preset) {
  const Row& row = *std::ranges::find(table, preset, &Row::preset);
  return {.response = row.response,
          .log_eps = row.log_eps,
          .cutoff_frequency = row.cutoff_frequency,
          .dark_light = row.dark_light,
          .positive_threshold = row.positive_threshold,
          .negative_threshold = row.negative_threshold,
          .threshold_sigma = row.threshold_sigma,
          .threshold_jitter = row.threshold_jitter,
          .leak_rate = row.leak_rate,
          .leak_spread = row.leak_spread,
          .shot_noise_rate = row.shot_noise_rate,
          .hot_pixels = row.hot_pixels,
          .refractory_period = row.refractory_period,
          .refractory_reset = row.refractory_reset,
          .pixel_latency = row.pixel_latency,
          .pixel_latency_jitter = row.pixel_latency_jitter,
          .max_rate = row.max_rate};
}

}  // namespace eventcamera
