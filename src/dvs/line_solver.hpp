// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "src/dvs/pixel_solver.hpp"

namespace eventcamera {

/// Like solve_pixels(), for signals that are straight lines, and events that are crossings without
/// latency, after which the reference is the level.
void solve_lines(const RowToSolve& row);

/// Like solve_lines(), with thresholds that vary: by adaptation, and by jitter without mismatch.
void solve_varying_thresholds(const RowToSolve& row);

}  // namespace eventcamera
