// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "bench/scenes.hpp"

namespace bench {

/// All methods on a scene: SCENE/METHOD/ours/threads:N.
void register_simulators(const Scene& scene);

/// Dense flow alone, of whole frames, and OpenCV's with the same parameters:
/// SCENE/FLOW/FORMULATION/threads:N.
void register_flows(const Scene& scene);

/// Events to a buffer, and a buffer to a picture, compared to a memcpy of the output:
/// SCENE/STEP/FORMULATION/threads:1.
void register_events(const Scene& scene);

/// All methods on growing frames of the driving scene, two threads, until one takes
/// longer than a thirtieth of a second: sizes/METHOD/SIZE.
void register_sizes(bool few_frames);

/// Scaling of the methods: growth/AXIS/METHOD/VALUE.
void register_growth(bool few_frames);

}  // namespace bench
