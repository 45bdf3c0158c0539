// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "src/core/event.hpp"

namespace eventcamera {

/// Converts time to microseconds, the unit of the pixel model.
constexpr double in_microseconds(Nanoseconds time) {
  return static_cast<double>(time) / 1000;
}

/// Response of the photoreceptor to light, before its bandwidth limit.
enum class Response {
  log,      ///< ln(log_eps + I)
  lin_log,  ///< with x = 255 I: x ln(20)/20 up to 20, ln(x) above (v2e)
  linear,   ///< ln(255) I: for video that is nearly logarithmic already, due to its gamma
};

/// Model of light between two frames.
enum class Upsampling {
  linear,  ///< linear interpolation per pixel, in units of the response
  motion,  ///< motion along the optical flow, in steps of a pixel, or more if it is fast
};

/// Reference level of a pixel after an event.
enum class RefractoryReset {
  level,   ///< the level that was crossed; crossings within the refractory period are lost
  signal,  ///< the signal at the end of the refractory period
};

/// Parameters of a pixel array. Every stage except response and upsampling is off if its parameters
/// are 0.
struct DvsSettings {
  double denoise = 0;                  ///< Settings::denoise
  bool linear_light = false;           ///< undo the sRGB transfer function first
  bool exposure_compensation = false;  ///< divide out the gain of the frame camera's exposure
  Response response = Response::lin_log;
  double log_eps = 1e-3;         ///< of Response::log; white is 1
  double overexposed_light = 1;  ///< of pixels that are white in the frame; white is 1

  Upsampling upsampling = Upsampling::linear;
  int max_interpolated_frames = 31;  ///< between two frames, for Upsampling::motion
  Nanoseconds exposure_time = 0;  ///< of frames if long, for motion; a frame's time is its middle

  double cutoff_frequency = 0;       ///< cutoff of the photoreceptor at white
  double dark_light = 20.0 / 255.0;  ///< background illuminance; white is 1

  double positive_threshold = 0.2;  ///< units of the response
  double negative_threshold = 0.2;  ///< units of the response, a magnitude
  double threshold_sigma = 0;       ///< std-dev between pixels, units of the response
  double threshold_jitter = 0;      ///< std-dev between events, units of the response

  double leak_rate = 0;        ///< ON events per second of a pixel in constant light
  double leak_spread = 0;      ///< std-dev of the leak rate between pixels, decades
  double shot_noise_rate = 0;  ///< events per second of a dark pixel, ON plus OFF
  double hot_pixels = 0;       ///< fraction of all pixels
  double dead_pixels = 0;      ///< fraction of all pixels

  double adaptation = 0;                     ///< growth of the thresholds by an event, a fraction
  Nanoseconds adaptation_time = 10'000'000;  ///< decay time of the growth from one event

  Nanoseconds refractory_period = 0;
  RefractoryReset refractory_reset = RefractoryReset::level;

  double exposure_pulse = 0;      ///< rise of all signals at the start of an exposure, same units
  Nanoseconds exposure_lead = 0;  ///< from the start of the exposure to the frame's time

  Nanoseconds pixel_latency = 0;         ///< from the crossing to the event
  Nanoseconds pixel_latency_jitter = 0;  ///< std-dev of the latency
  double max_rate = 0;                   ///< limit of the readout, events per second; 0 = no limit

  std::uint64_t seed = 0;

  friend bool operator==(const DvsSettings&, const DvsSettings&) = default;
};

/// Named sets of settings; their values are in presets.cpp.
enum class DvsPreset {
  standard,   ///< a typical event camera, for frames of any camera
  ideal,      ///< no noise, no delay
  esim,       ///< ESIM
  v2e_clean,  ///< v2e, its model "clean"
  v2e_noisy,  ///< v2e, its model "noisy"
  icns,       ///< IEBCS, the simulator of the ICNS
  davis240c,  ///< iniVation DAVIS240C
  davis346,   ///< iniVation DAVIS346
  gen4,       ///< Prophesee and Sony Gen4.1 (IMX636)
  hs_ergb,    ///< the event camera of TimeLens' HS-ERGB data, a Prophesee Gen4
};

DvsSettings settings_of(DvsPreset preset);

}  // namespace eventcamera
