// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

namespace eventcamera {

/// What the photoreceptor makes of light, before its bandwidth limit.
enum class Response {
  log,      ///< ln(log_eps + I)
  lin_log,  ///< of x = 255 I: x ln(20)/20 up to 20, ln(x) above (v2e)
  linear,   ///< ln(255) I: for video whose gamma has made it nearly logarithmic already
};

/// How the light changes from one frame to the next.
enum class Upsampling {
  linear,  ///< on a straight line in each pixel, in units of the response
  motion,  ///< moves along the optical flow, in steps of at most one pixel
};

/// Where the reference level of a pixel is after an event.
enum class RefractoryReset {
  level,   ///< at the level that was crossed; crossings within the refractory period are lost
  signal,  ///< at the signal when the refractory period ends
};

/// All parameters of a pixel array. Every stage but response and upsampling is off where its
/// numbers are 0.
struct DvsSettings {
  double denoise = 0;         ///< frame differences up to this size are noise; white is 255
  bool linear_light = false;  ///< undo the transfer function of sRGB first
  Response response = Response::lin_log;
  double log_eps = 1e-3;  ///< of the response log; white is 1

  Upsampling upsampling = Upsampling::linear;
  int max_steps = 32;  ///< between two frames, with motion

  double cutoff_hz = 0;              ///< of the photoreceptor, at white
  double dark_light = 20.0 / 255.0;  ///< light that is always there; white is 1

  double positive_threshold = 0.2;  ///< units of the response
  double negative_threshold = 0.2;  ///< units of the response, a magnitude
  double threshold_sigma = 0;       ///< from pixel to pixel, units of the response
  double threshold_jitter = 0;      ///< from event to event, units of the response

  double leak_rate_hz = 0;        ///< ON events per second of a pixel whose light is constant
  double leak_spread = 0;         ///< of the leak rate from pixel to pixel, decades
  double shot_noise_rate_hz = 0;  ///< events per second of a dark pixel, both polarities
  double hot_pixels = 0;          ///< share of all pixels
  double dead_pixels = 0;         ///< share of all pixels

  double refractory_period = 0;  ///< microseconds
  RefractoryReset refractory_reset = RefractoryReset::level;

  double exposure_pulse = 0;  ///< of all signals when an exposure begins, units of the response
  double exposure_lead = 0;   ///< microseconds from the start of the exposure to the frame's time

  double latency = 0;         ///< microseconds from the crossing to the event
  double latency_jitter = 0;  ///< its standard deviation, microseconds
  double max_event_rate = 0;  ///< of the readout, events per second; 0 = no limit

  std::uint64_t seed = 0;

  friend bool operator==(const DvsSettings&, const DvsSettings&) = default;
};

/// Settings that belong together; their numbers are in presets.cpp.
enum class DvsPreset {
  ideal,      ///< neither noise nor delay
  esim,       ///< ESIM
  v2e_clean,  ///< v2e, its model "clean"
  v2e_noisy,  ///< v2e, its model "noisy"
  icns,       ///< IEBCS, the simulator of the ICNS
  davis346,   ///< iniVation DAVIS346
  gen4,       ///< Prophesee and Sony Gen4.1 (IMX636)
};

DvsSettings settings_of(DvsPreset preset);

}  // namespace eventcamera
