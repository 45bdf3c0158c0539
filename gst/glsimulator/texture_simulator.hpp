// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/video/video.h>

#include <memory>

#include "gst/glsimulator/gleventsimulator.hpp"
#include "gst/glsimulator/shared_context.hpp"

/// Creates the simulator that `make` returns, in the context of an element.
std::unique_ptr<VideoSimulator> make_texture_simulator(GstElement* element, SharedContext& shared,
                                                       const GstVideoInfo& video,
                                                       MakeGlSimulator make);
