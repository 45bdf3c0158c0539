// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "src/flow/dense_flow.hpp"
#include "src/flow/farneback/pyramid.hpp"

namespace eventcamera {

/// Resamples a row of a flow and multiplies it by `factor`. Reads one element past the end of
/// `row`, with weight 0; writes up to a vector past the end of `out`.
void widen_flow(const Flow* row, const Resampling& columns, float factor, Flow* out);

/// Interpolates between two rows; `weight` is that of the lower one. Reads and writes up to a
/// vector past the ends.
void blend_flows(const Flow* upper, const Flow* lower, float weight, int width, Flow* out);

}  // namespace eventcamera
