// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

/// What a simulator can make of video with these caps, events first: the same size and framerate,
/// as events or as accumulated-event video.
GstCaps* event_simulator_output_caps(const GstCaps* video);

/// The video a simulator needs in order to make these caps, events or accumulated-event video.
GstCaps* event_simulator_input_caps(const GstCaps* output);

/// What a simulator makes where downstream leaves it the choice among these caps (not empty):
/// events, if they are among them. Takes the caps.
GstCaps* event_simulator_fixate_output(GstCaps* caps);

/// Whether output caps are those of accumulated-event video, and not of events.
bool event_simulator_draws(const GstCaps* output);
