// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "bench/scenes.hpp"

namespace bench {

/// Every method on a scene, written plainly and ours: SCENE/METHOD/FORMULATION/threads:N.
void register_simulators(const Scene& scene);

/// Events into a buffer, and a buffer into a picture, beside a memcpy of what comes out:
/// SCENE/STEP/FORMULATION/threads:1.
void register_events(const Scene& scene);

/// How the methods' cost grows: growth/AXIS/METHOD/FORMULATION/VALUE.
void register_growth(bool few_frames);

}  // namespace bench
