// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <utility>

#include "src/dvs/dvs_settings.hpp"
#include "src/simulate/denoiser.hpp"

namespace eventcamera {
namespace {

using enum Response;
using enum RefractoryReset;

// Settings that are not listed have the defaults of DvsSettings. Sources:
//
// standard: docs/realism.md. Thresholds of cameras differ by a factor of 2.7; these are in the
//   middle.
// esim: Rebecq et al., ESIM, CoRL 2018; thresholds of rpg_vid2e, offset of esim_py.
// v2e: Hu, Liu, Delbruck, CVPRW 2021; set_dvs_params("clean") and, for dim light, ("noisy").
// icns: Joubert et al., Event camera simulator improvements via characterized parameters, Front.
//   Neurosci. 2021, with the parameters of its example. White is 10 klux; the response ln(lux + 1)
//   is ln(1e-4 + I) plus a constant. The time constant is 40 us at 1 klux and proportional to
//   1 / (lux + 1), so 4 us at white. Noise of 0.1 Hz ON and 0.01 Hz OFF is a single rate here.
// davis240c, davis346, hs-ergb: fitted by event-calibrate to recordings of docs/realism.md. The
//   leak of 0.1 Hz is from DVS-Voltmeter's fit to recordings of a DAVIS346, whose readout does 12
//   million events per second according to the data sheet.
// gen4: response and thresholds of standard: a guess, as no recording with frames was fitted. The
//   other values are the middles, on a suitable scale, of the ranges from which OpenEB's simulator
//   samples: refractory period 10 to 1000 us, leak and shot noise up to 1 Hz, cutoff up to 900 Hz.
//   Its thresholds, 0.15 and 0.1, fire two to eight times too many events. Finateu et al., ISSCC
//   2020: 1.066 Gev/s of readout, latency below 220 us at 5 lux and about 100 us in office light.
//
// The fractions of hot pixels are guesses.
constexpr DvsSettings standard = {.denoise = automatic_denoise,
                                  .exposure_compensation = true,
                                  .response = log,
                                  .log_eps = 0.05,
                                  .overexposed_light = 1.5,
                                  .upsampling = Upsampling::motion,
                                  .positive_threshold = 0.26,
                                  .negative_threshold = 0.26,
                                  .adaptation = 0.05};

constexpr DvsSettings gen4 = [] {
  auto settings = standard;
  settings.cutoff_frequency = 450;
  settings.threshold_sigma = 0.005;
  settings.leak_rate = 0.1;
  settings.leak_spread = 0.1;
  settings.shot_noise_rate = 0.1;
  settings.hot_pixels = 1e-5;
  settings.refractory_period = 100'000;
  settings.refractory_reset = signal;
  settings.pixel_latency = 100'000;
  settings.pixel_latency_jitter = 20'000;
  settings.max_rate = 1.066e9;
  return settings;
}();

constexpr std::pair<DvsPreset, DvsSettings> table[] = {
    {DvsPreset::standard, standard},
    {DvsPreset::ideal, {}},
    {DvsPreset::esim, {.response = log}},
    {DvsPreset::v2e_clean, {.threshold_sigma = 0.02}},
    {DvsPreset::v2e_noisy,
     {.cutoff_frequency = 30,
      .threshold_sigma = 0.05,
      .leak_rate = 0.1,
      .leak_spread = 0.1,
      .shot_noise_rate = 5}},
    {DvsPreset::icns,
     {.response = log,
      .log_eps = 1e-4,
      .cutoff_frequency = 39'789,
      .dark_light = 1e-4,
      .positive_threshold = 0.4,
      .negative_threshold = 0.4,
      .threshold_sigma = 0.01,
      .threshold_jitter = 0.01,
      .shot_noise_rate = 0.11,
      .refractory_period = 100'000,
      .refractory_reset = signal,
      .pixel_latency = 100'000,
      .pixel_latency_jitter = 10'000}},
    {DvsPreset::davis240c,
     {.response = log,
      .log_eps = 0.04,
      .upsampling = Upsampling::motion,
      .positive_threshold = 0.49,
      .negative_threshold = 0.417,
      .threshold_jitter = 0.06,
      .leak_rate = 0.1,
      .leak_spread = 0.1,
      .shot_noise_rate = 0.001,
      .hot_pixels = 1e-4,
      .adaptation = 0.1,
      .max_rate = 12e6}},
    {DvsPreset::davis346,
     {.denoise = 4,
      .response = log,
      .log_eps = 0.04,
      .upsampling = Upsampling::motion,
      .positive_threshold = 0.158,
      .negative_threshold = 0.178,
      .threshold_jitter = 0.04,
      .leak_rate = 0.1,
      .leak_spread = 0.1,
      .shot_noise_rate = 0.001,
      .hot_pixels = 1e-4,
      .adaptation = 0.05,
      .max_rate = 12e6}},
    {DvsPreset::gen4, gen4},
    {DvsPreset::hs_ergb,
     {.denoise = 8,
      .linear_light = true,
      .response = log,
      .log_eps = 0.1,
      .positive_threshold = 0.266,
      .negative_threshold = 0.283,
      .threshold_jitter = 0.05,
      .leak_rate = 0.1,
      .leak_spread = 0.1,
      .shot_noise_rate = 0.1,
      .hot_pixels = 1e-5,
      .max_rate = 1.066e9}},
};

}  // namespace

DvsSettings settings_of(DvsPreset preset) {
  return std::ranges::find(table, preset, &std::pair<DvsPreset, DvsSettings>::first)->second;
}

}  // namespace eventcamera
