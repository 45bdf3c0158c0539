// SPDX-License-Identifier: LGPL-2.1-or-later
// Random for vectors of pixels. Included once per SIMD target, after foreach_target.h.
#if defined(EVENTCAMERA_RANDOM_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef EVENTCAMERA_RANDOM_INL
#undef EVENTCAMERA_RANDOM_INL
#else
#define EVENTCAMERA_RANDOM_INL
#endif

#include <cstdint>
#include <numbers>

#include "src/core/simd-inl.hpp"
#include "src/dvs/elementary-inl.hpp"
#include "src/dvs/random.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {

/// The numbers of a vector of pixels for one purpose.
template <class Doubles>
class RandomSeries {
 public:
  using Bits = hn::RebindToUnsigned<Doubles>;
  using Numbers = hn::Vec<Bits>;
  using Values = hn::Vec<Doubles>;

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
