// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/tensor/tensor_elements.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#define HWY_TARGET_INCLUDE "src/tensor/tensor_elements.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

using Floats = hn::CappedTag<float, 16>;
using Words = hn::RebindToUnsigned<Floats>;
using SignedWords = hn::RebindToSigned<Floats>;

/// Writes converted(vector) for each vector of values; the last one is filled up with zeros.
template <class Out, class Convert>
void convert(const float* values, std::size_t count, Out* out, const Convert& converted) {
  const Floats floats;
  const hn::Rebind<Out, Floats> outs;
  const std::size_t lanes = hn::Lanes(floats);
  std::size_t i = 0;
  for (; i + lanes <= count; i += lanes)
    hn::StoreU(converted(hn::LoadU(floats, values + i)), outs, out + i);
  if (i == count) return;
  HWY_ALIGN Out last[hn::MaxLanes(outs)];
  hn::Store(converted(load_first(floats, values + i, static_cast<int>(count - i))), outs, last);
  std::copy_n(last, count - i, out + i);
}

float max_magnitude(const float* values, std::size_t count) {
  const Floats floats;
  const std::size_t lanes = hn::Lanes(floats);
  auto max = hn::Zero(floats);
  std::size_t i = 0;
  for (; i + lanes <= count; i += lanes) max = hn::Max(max, hn::Abs(hn::LoadU(floats, values + i)));
  if (i < count)
    max = hn::Max(max, hn::Abs(load_first(floats, values + i, static_cast<int>(count - i))));
  return hn::GetLane(hn::MaxOfLanes(floats, max));
}

/// (value - mean) / divisor; 0 stays 0.
void standardize(float* values, std::size_t count, float mean, float divisor) {
  const Floats floats;
  const auto means = hn::Set(floats, mean);
  const auto divisors = hn::Set(floats, divisor);
  convert(values, count, values, [&](auto value) {
    return hn::IfThenZeroElse(value == hn::Zero(floats), (value - means) / divisors);
  });
}

void to_float16(const float* values, std::size_t count, std::uint16_t* out) {
  const Floats floats;
  const Words words;
  const SignedWords signed_words;
  const hn::Rebind<std::uint16_t, Floats> halves;
  // Both formats as integers: exponent above mantissa, 13 bits of which are rounded away.
  constexpr int dropped_bits = 13;
  constexpr std::uint32_t bias_difference = (127U - 15U) << 10U;
  constexpr std::uint32_t infinity = 0x7c00;
  constexpr std::uint32_t min_normal = (127U - 14U) << 23U;  // 2^-14
  // Between 0.5 and 1, the last bit of a float is worth the last bit of a subnormal half.
  const auto half = hn::Set(floats, 0.5F);
  convert(values, count, out, [&](auto value) {
    const auto magnitude = hn::Abs(value);
    const auto bits = hn::BitCast(words, magnitude);
    const auto is_odd = hn::And(hn::ShiftRight<dropped_bits>(bits), hn::Set(words, 1));
    const auto rounded = hn::ShiftRight<dropped_bits>(
        bits + hn::Set(words, (1U << (dropped_bits - 1)) - 1) + is_odd);
    const auto normal =
        hn::Min(rounded - hn::Set(words, bias_difference), hn::Set(words, infinity));
    const auto subnormal = hn::BitCast(words, magnitude + half) - hn::BitCast(words, half);
    const auto is_subnormal = hn::BitCast(signed_words, bits) <
                              hn::Set(signed_words, static_cast<std::int32_t>(min_normal));
    const auto sign =
        hn::ShiftRight<16>(hn::And(hn::BitCast(words, value), hn::Set(words, 0x80000000U)));
    const auto joined =
        hn::Or(sign, hn::IfThenElse(hn::RebindMask(words, is_subnormal), subnormal, normal));
    return hn::DemoteTo(halves, hn::BitCast(signed_words, joined));
  });
}

void to_uint8(const float* values, std::size_t count, const ByteScale& scale, std::uint8_t* out) {
  const Floats floats;
  const hn::Rebind<std::uint8_t, Floats> bytes;
  const auto steps = hn::Set(floats, scale.steps);
  const auto zero = hn::Set(floats, scale.zero);
  const auto max = hn::Set(floats, 255.0F);
  convert(values, count, out, [&](auto value) {
    const auto scaled = value * steps + zero;
    return hn::DemoteTo(bytes, hn::NearestInt(hn::Min(hn::Max(scaled, hn::Zero(floats)), max)));
  });
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {
namespace {

HWY_EXPORT(max_magnitude);
HWY_EXPORT(standardize);
HWY_EXPORT(to_float16);
HWY_EXPORT(to_uint8);

/// In one order, so that the sums are the same on every processor.
void normalize_by_mean_and_std(std::span<float> values) {
  double sum = 0;
  double squares = 0;
  std::size_t count = 0;
  for (const float value : values) {
    sum += value;
    squares += static_cast<double>(value) * value;
    count += value != 0 ? 1 : 0;
  }
  if (count == 0) return;
  const double mean = sum / static_cast<double>(count);
  const double variance = std::max(0.0, squares / static_cast<double>(count) - mean * mean);
  const auto deviation = static_cast<float>(std::sqrt(variance));
  HWY_DYNAMIC_DISPATCH(standardize)
  (values.data(), values.size(), static_cast<float>(mean), deviation > 0 ? deviation : 1);
}

}  // namespace

void normalize(std::span<float> values, Normalization normalization) {
  switch (normalization) {
    case Normalization::none:
      return;
    case Normalization::mean_std:
      return normalize_by_mean_and_std(values);
    case Normalization::max:
      break;
  }
  const float max = HWY_DYNAMIC_DISPATCH(max_magnitude)(values.data(), values.size());
  if (max > 0) HWY_DYNAMIC_DISPATCH(standardize)(values.data(), values.size(), 0, max);
}

void write_float16(std::span<const float> values, std::uint16_t* out) {
  HWY_DYNAMIC_DISPATCH(to_float16)(values.data(), values.size(), out);
}

void write_uint8(std::span<const float> values, const ByteScale& scale, std::uint8_t* out) {
  HWY_DYNAMIC_DISPATCH(to_uint8)(values.data(), values.size(), scale, out);
}

}  // namespace eventcamera
#endif  // HWY_ONCE
