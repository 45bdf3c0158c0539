// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <optional>
#include <span>
#include <vector>

#include "src/formats/decoder.hpp"

/// Triggers and IMU samples on their way from a reader to a writer: serialized custom events, which
/// other elements forward. docs/formats.md describes them. They precede the buffer or GAP of their
/// interval. An empty one, before the first buffer, announces that there may be more.
///
/// Times count like the stream, as floor(PTS / 1000) microseconds.
GstEvent* new_sensor_event(std::span<const eventcamera::Trigger> triggers);
GstEvent* new_sensor_event(std::span<const eventcamera::ImuSample> samples);

/// True if an event holds triggers or IMU samples.
bool is_sensor_event(GstEvent* event);

/// Return the content of an event; nothing if it is another event.
std::optional<std::vector<eventcamera::Trigger>> triggers_of(GstEvent* event);
std::optional<std::vector<eventcamera::ImuSample>> imu_samples_of(GstEvent* event);
