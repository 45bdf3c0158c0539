// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>

#include "src/tensor/tensor_settings.hpp"

namespace eventcamera {

/// Values must be finite. Normalization::mean_std subtracts the mean of the nonzero values and
/// divides by their standard deviation (E2VID's event preprocessing); zeros stay 0, and so do
/// values that are all equal.
void normalize(std::span<float> values, Normalization normalization);

/// Writes IEEE 754 half-precision numbers, rounded to nearest, ties to even; beyond 65504,
/// infinite.
void write_float16(std::span<const float> values, std::uint16_t* out);

/// A byte is zero + steps * value, rounded to nearest, ties to even, and clamped.
struct ByteScale {
  float steps;
  float zero;
};

void write_uint8(std::span<const float> values, const ByteScale& scale, std::uint8_t* out);

}  // namespace eventcamera
