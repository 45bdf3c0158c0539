// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

namespace eventcamera {

/// What the photoreceptor makes of light, before its bandwidth.
enum class Response {
  log,      ///< ln(log_eps + I)
  lin_log,  ///< of x = 255 I: x ln(20)/20 up to 20, ln(x) beyond (v2e)
  linear,   ///< ln(255) I: of video whose gamma has made it nearly logarithmic already
};

/// How the light goes from one frame to the next.
enum class Upsampling {
  linear,  ///< in each pixel on a straight line, in what the response gives
  motion,  ///< moves along the optical flow, in steps of a pixel at most
};

/// Where the reference level of a pixel is after an event.
enum class RefractoryReset {
  level,   ///< at the level that was crossed; crossings within the refractory period are lost
  signal,  ///< at the signal as the refractory period ends
};

/// All of a pixel array. Every stage but response and upsampling is off where its numbers are 0.
struct DvsSettings {
  double denoise = 0;         ///< of the frames: differences of this size are noise; white is 255
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

  double leak_rate_hz = 0;        ///< ON events a second of a pixel that sees nothing
  double leak_spread = 0;         ///< of that from pixel to pixel, decades
  double shot_noise_rate_hz = 0;  ///< events a second of a pixel, both polarities, without light
  double hot_pixels = 0;          ///< share of all
  double dead_pixels = 0;         ///< share of all

  double refractory_period = 0;  ///< microseconds
  RefractoryReset refractory_reset = RefractoryReset::level;

  double exposure_pulse = 0;  ///< of all signals as an exposure begins, units of the response
  double exposure_lead = 0;   ///< microseconds from then to the frame's time

  double latency = 0;         ///< microseconds from the crossing to the event
  double latency_jitter = 0;  ///< its deviation, microseconds
  double max_event_rate = 0;  ///< of the readout, events a second; 0 = no limit

  std::uint64_t seed = 0;

  friend bool operator==(const DvsSettings&, const DvsSettings&) = default;
};

}  // namespace eventcamera
