// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/presets.hpp"

namespace eventcamera {
namespace {

// Rebecq et al., ESIM, CoRL 2018, with the thresholds of rpg_vid2e and the offset of esim_py.
constexpr DvsSettings esim{
    .response = Response::log,
    .log_eps = 1e-3,
    .positive_threshold = 0.2,
    .negative_threshold = 0.2,
};

// Hu, Liu, Delbruck, v2e, CVPRW 2021: set_dvs_params("clean").
constexpr DvsSettings v2e_clean{
    .response = Response::lin_log,
    .positive_threshold = 0.2,
    .negative_threshold = 0.2,
    .threshold_sigma = 0.02,
};

// The same, "noisy": dim light.
constexpr DvsSettings v2e_noisy{
    .response = Response::lin_log,
    .cutoff_hz = 30,
    .positive_threshold = 0.2,
    .negative_threshold = 0.2,
    .threshold_sigma = 0.05,
    .leak_rate_hz = 0.1,
    .leak_spread = 0.1,
    .shot_noise_rate_hz = 5,
};

// Joubert et al., Event camera simulator improvements via characterized parameters, Front.
// Neurosci. 2021, with the parameters of its example: white is 10 klux, the response ln(lux + 1),
// that is ln(1e-4 + I) and a constant; the time constant 40 us at 1 klux, falling as lux + 1, so
// that white's is 4 us; noise of 0.1 Hz ON and 0.01 Hz OFF, which is one rate here.
constexpr DvsSettings icns{
    .response = Response::log,
    .log_eps = 1e-4,
    .cutoff_hz = 39'789,
    .dark_light = 1e-4,
    .positive_threshold = 0.4,
    .negative_threshold = 0.4,
    .threshold_sigma = 0.01,
    .threshold_jitter = 0.01,
    .shot_noise_rate_hz = 0.11,
    .refractory_period = 100,
    .refractory_reset = RefractoryReset::signal,
    .latency = 100,
    .latency_jitter = 10,
};

// v2e's own defaults, which its authors chose as those of their DAVIS346 in good light: mismatch,
// bandwidth, noise, refractory period. The leak of 0.1 Hz is what DVS-Voltmeter was fitted with on
// recordings of that camera. 12 million events a second is what its data sheet gives for the
// readout. Response by the same authors. The share of hot pixels, here and below, is a guess.
constexpr DvsSettings davis346{
    .response = Response::lin_log,
    .cutoff_hz = 300,
    .positive_threshold = 0.2,
    .negative_threshold = 0.2,
    .threshold_sigma = 0.03,
    .leak_rate_hz = 0.1,
    .leak_spread = 0.1,
    .shot_noise_rate_hz = 0.001,
    .hot_pixels = 1e-4,
    .refractory_period = 500,
    .max_event_rate = 12e6,
};

// Thresholds, refractory period and noise as OpenEB's own simulator samples them for its cameras
// (thresholds 0.15 and 0.1, refractory period 10 to 1000 us, leak and shot noise up to 1 Hz,
// cutoff up to 900 Hz: their middles, on scales that fit). Finateu et al., ISSCC 2020: 1.066 Geps
// of readout, latency below 220 us with 5 lux and some 100 us in office light.
constexpr DvsSettings gen4{
    .response = Response::lin_log,
    .cutoff_hz = 450,
    .positive_threshold = 0.15,
    .negative_threshold = 0.1,
    .threshold_sigma = 0.005,
    .leak_rate_hz = 0.1,
    .leak_spread = 0.1,
    .shot_noise_rate_hz = 0.1,
    .hot_pixels = 1e-5,
    .refractory_period = 100,
    .refractory_reset = RefractoryReset::signal,
    .latency = 100,
    .latency_jitter = 20,
    .max_event_rate = 1.066e9,
};

}  // namespace

DvsSettings settings_of(DvsPreset preset) {
  switch (preset) {
    case DvsPreset::esim:
      return esim;
    case DvsPreset::v2e_clean:
      return v2e_clean;
    case DvsPreset::v2e_noisy:
      return v2e_noisy;
    case DvsPreset::icns:
      return icns;
    case DvsPreset::davis346:
      return davis346;
    case DvsPreset::gen4:
      return gen4;
    case DvsPreset::ideal:
      break;
  }
  return {};
}

}  // namespace eventcamera
