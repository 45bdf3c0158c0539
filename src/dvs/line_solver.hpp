// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "src/dvs/pixel_solver.hpp"

namespace eventcamera {

/// Like solve_pixels(), for signals that are straight lines, and events that are crossings without
/// latency, after which the reference is the level.
void solve_lines(const RowToSolve& row);

}  // namespace eventcamera
