// SPDX-License-Identifier: LGPL-2.1-or-later Vector versions of elementary.hpp. Included once per
// SIMD target, after foreach_target.h.
#if defined(EVENTCAMERA_ELEMENTARY_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef EVENTCAMERA_ELEMENTARY_INL
#undef EVENTCAMERA_ELEMENTARY_INL
#else
#define EVENTCAMERA_ELEMENTARY_INL
#endif

#include <cstdint>

#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {

/// exp(-x)
template <class Values>
HWY_INLINE Values decays(Values x) {
  const hn::DFromV<Values> doubles;
  const hn::RebindToUnsigned<decltype(doubles)> bits;
  const auto all = [=](double value) HWY_ATTR { return hn::Set(doubles, value); };
  const auto to_integers = all(0x1.8p52);
  x = hn::Min(x, all(700));
  const auto shifted = x * all(1.4426950408889634) + to_integers;
  const auto r = (shifted - to_integers) * all(0.6931471805599453) - x;
  const auto r2 = r * r;
  const auto r4 = r2 * r2;
  const auto line = [&](double a, double b) HWY_ATTR { return all(a) + r * all(b); };
  const auto low = all(1) + r + r2 * line(1.0 / 2, 1.0 / 6);
  const auto middle = line(1.0 / 24, 1.0 / 120) + r2 * line(1.0 / 720, 1.0 / 5040);
  const auto high = line(1.0 / 40320, 1.0 / 362880) + r2 * all(1.0 / 3628800);
  const auto mantissa = low + r4 * (middle + r4 * high);
  const auto exponent =
      hn::Set(bits, std::uint64_t{1023} << 52) - hn::ShiftLeft<52>(hn::BitCast(bits, shifted));
  return mantissa * hn::BitCast(doubles, exponent);
}

/// ln(x)
template <class Values>
HWY_INLINE Values logarithms(Values x) {
  const hn::DFromV<Values> doubles;
  const hn::RebindToUnsigned<decltype(doubles)> bits;
  const auto all = [=](double value) HWY_ATTR { return hn::Set(doubles, value); };
  const auto word = hn::BitCast(bits, x);
  // 2^52 + e has the exponent e in its lowest bits.
  const auto exponent = hn::BitCast(doubles, hn::Or(hn::ShiftRight<52>(word),
                                                    hn::Set(bits, std::uint64_t{0x433} << 52))) -
                        all(0x1p52 + 1023);
  const auto mantissa =
      hn::BitCast(doubles, hn::Or(hn::And(word, hn::Set(bits, (std::uint64_t{1} << 52) - 1)),
                                  hn::Set(bits, std::uint64_t{1023} << 52)));
  const auto root = all(1.4142135623730951);
  const auto s = (mantissa - root) / (mantissa + root);
  const auto s2 = s * s;
  auto sum = all(1.0 / 15);
  for (int i = 13; i > 0; i -= 2) sum = sum * s2 + all(1.0 / i);
  return (exponent + all(0.5)) * all(0.6931471805599453) + (s + s) * sum;
}

/// Cosines and sines of angles from 0 to pi/4.
template <class Values>
HWY_INLINE void cosines_and_sines(Values x, Values& cosines, Values& sines) {
  const hn::DFromV<Values> doubles;
  const auto x2 = x * x;
  const auto next = [&](double a, Values rest) HWY_ATTR { return hn::Set(doubles, a) + x2 * rest; };
  const auto last = [=](double a) HWY_ATTR { return hn::Set(doubles, a); };
  cosines = next(1, next(-1.0 / 2, next(1.0 / 24, next(-1.0 / 720, last(1.0 / 40320)))));
  sines = x + x * x2 * next(-1.0 / 6, next(1.0 / 120, next(-1.0 / 5040, last(1.0 / 362880))));
}

}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per target
