// SPDX-License-Identifier: LGPL-2.1-or-later
// Shared by the solvers of many pixels: vector versions of elementary.hpp and random.hpp. Included
// once per SIMD target, after foreach_target.h.
#if defined(EVENTCAMERA_SOLVER_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef EVENTCAMERA_SOLVER_INL
#undef EVENTCAMERA_SOLVER_INL
#else
#define EVENTCAMERA_SOLVER_INL
#endif

#include <cstdint>
#include <numbers>

#include "src/core/simd-inl.hpp"
#include "src/dvs/random.hpp"
#include "src/dvs/row_filter.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {

/// One lane per pixel.
using Doubles = hn::CappedTag<double, max_lanes / 2>;
using Floats = hn::Rebind<float, Doubles>;
using Words = hn::Rebind<std::int32_t, Doubles>;
using Bits = hn::RebindToUnsigned<Doubles>;
using Values = hn::Vec<Doubles>;
using Mask = hn::Mask<Doubles>;

HWY_INLINE Values all(double value) {
  return hn::Set(Doubles(), value);
}

/// exp(-x)
HWY_INLINE Values decays(Values x) {
  const Doubles doubles;
  const Bits bits;
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
HWY_INLINE Values logarithms(Values x) {
  const Doubles doubles;
  const Bits bits;
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
HWY_INLINE void cosines_and_sines(Values x, Values& cosines, Values& sines) {
  const auto x2 = x * x;
  const auto next = [&](double a, Values rest) HWY_ATTR { return all(a) + x2 * rest; };
  cosines = next(1, next(-1.0 / 2, next(1.0 / 24, next(-1.0 / 720, all(1.0 / 40320)))));
  sines = x + x * x2 * next(-1.0 / 6, next(1.0 / 120, next(-1.0 / 5040, all(1.0 / 362880))));
}

/// Random numbers of a vector of pixels for one purpose.
class RandomSeries {
 public:
  using Numbers = hn::Vec<Bits>;

  struct Normals {
    Values first;
    Values second;
  };

  // Not defaulted: GCC 12 compiles a defaulted constructor without the target's instructions.
  RandomSeries() {}  // NOLINT(*-member-init,*-use-equals-default)

  RandomSeries(const Random& random, Numbers pixels, Random::Purpose purpose) {
    const Bits bits;
    const auto of_pixels = mixed(hn::Set(bits, random.key()) + pixels);
    hashes_ = mixed(of_pixels + hn::Set(bits, static_cast<std::uint64_t>(purpose)));
  }

  /// Like Random::normals().
  HWY_INLINE Normals normals(Numbers counters) const {
    const Doubles doubles;
    const Bits bits;
    const auto first = mixed(hashes_ + counters);
    const auto logarithm = hn::Min(hn::Zero(doubles), logarithms(to_uniform(first)));
    const auto radius = hn::Sqrt(hn::Set(doubles, -2) * logarithm);
    const auto second = mixed(first + hn::Set(bits, 1));
    const auto angle =
        hn::Set(doubles, std::numbers::pi / 4) * to_uniform(hn::ShiftLeft<3>(second));
    Values cosine;
    Values sine;
    cosines_and_sines(angle, cosine, sine);
    const auto swap = hn::Set(bits, std::uint64_t{1} << 61);
    const auto is_swapped = hn::RebindMask(doubles, hn::And(second, swap) == swap);
    return {mirrored(radius * hn::IfThenElse(is_swapped, sine, cosine), second),
            mirrored(radius * hn::IfThenElse(is_swapped, cosine, sine), hn::ShiftLeft<1>(second))};
  }

 private:
  static HWY_INLINE Values to_uniform(Numbers numbers) {
    const Bits bits;
    const auto from_1_to_2 =
        hn::Or(hn::ShiftRight<12>(numbers), hn::Set(bits, std::uint64_t{1023} << 52));
    return hn::BitCast(Doubles(), from_1_to_2) - hn::Set(Doubles(), 1 - 0x1p-53);
  }

  static HWY_INLINE Values mirrored(Values values, Numbers numbers) {
    const auto sign = hn::Set(Bits(), std::uint64_t{1} << 63);
    return hn::Xor(values, hn::BitCast(Doubles(), hn::And(numbers, sign)));
  }

  static HWY_INLINE Numbers mixed(Numbers z) {
    const Bits bits;
    z = hn::Xor(z, hn::ShiftRight<30>(z)) * hn::Set(bits, 0xbf58476d1ce4e5b9);
    z = hn::Xor(z, hn::ShiftRight<27>(z)) * hn::Set(bits, 0x94d049bb133111eb);
    return hn::Xor(z, hn::ShiftRight<31>(z));
  }

  Numbers hashes_;
};

}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per target
