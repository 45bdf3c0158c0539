// SPDX-License-Identifier: LGPL-2.1-or-later
// Shared by SIMD kernels. Included once per SIMD target, after foreach_target.h.
#if defined(EVENTCAMERA_SIMD_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef EVENTCAMERA_SIMD_INL
#undef EVENTCAMERA_SIMD_INL
#else
#define EVENTCAMERA_SIMD_INL
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <numeric>

#include "src/core/set_bits.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Bit i is lane i of a mask of at most 64 lanes.
template <class Tag>
std::uint64_t bits_of(Tag tag, hn::Mask<Tag> mask) {
  static_assert(hn::MaxLanes(tag) <= 64);
  std::uint64_t bits = 0;
  hn::StoreMaskBits(tag, mask, reinterpret_cast<std::uint8_t*>(&bits));
  return bits;
}

/// Loads the first `count` elements of a vector; the rest is 0. For the end of a row only: slow.
template <class Tag, class T>
hn::Vec<Tag> load_first(Tag tag, const T* from, int count) {
  HWY_ALIGN T elements[hn::MaxLanes(tag)] = {};
  std::copy_n(from, count, elements);
  return hn::Load(tag, elements);
}

/// Lanes first, first + 1, ... hn::Iota() computes them one after another in memory.
template <class Tag>
HWY_INLINE hn::Vec<Tag> iota(Tag tag, hn::TFromD<Tag> first) {
  using T = hn::TFromD<Tag>;
  HWY_ALIGN static constexpr auto numbers = [] {
    std::array<T, hn::MaxLanes(Tag())> lanes{};
    std::iota(lanes.begin(), lanes.end(), T{0});
    return lanes;
  }();
  return hn::Load(tag, numbers.data()) + hn::Set(tag, first);
}

template <class Vector>
HWY_INLINE Vector lerp(Vector a, Vector b, Vector weight) {
  return a + weight * (b - a);
}

/// Moves the lanes of a mask to the front; the remaining lanes are undefined. Lanes have 4 or 8
/// bytes. Used instead of hn::Compress(), whose table GCC 12 copies to the stack on each call,
/// except on targets without a table.
template <class Tag>
class FirstLanes {
 public:
  using Vector = hn::Vec<Tag>;
  using Integers = hn::RebindToSigned<Tag>;

  explicit FirstLanes(hn::Mask<Tag> mask) : mask_(mask) {
    if constexpr (hn::MaxLanes(Tag()) <= 8) {
      const auto* lanes = set_bits.of[bits_of(Tag(), mask)];
      const hn::Rebind<std::int32_t, Tag> words;
      const auto numbers = hn::PromoteTo(words, hn::LoadU(hn::Rebind<std::uint8_t, Tag>(), lanes));
      if constexpr (sizeof(hn::TFromD<Tag>) == 8)
        indices_ = hn::IndicesFromVec(Tag(), hn::PromoteTo(Integers(), numbers));
      else
        indices_ = hn::IndicesFromVec(Tag(), numbers);
    }
  }

  HWY_INLINE Vector operator()(Vector vector) const {
    if constexpr (hn::MaxLanes(Tag()) <= 8)
      return hn::TableLookupLanes(vector, indices_);
    else
      return hn::Compress(vector, mask_);
  }

 private:
  hn::Mask<Tag> mask_;
  decltype(hn::IndicesFromVec(Tag(), hn::Zero(Integers()))) indices_;
};

/// Table lookup in two consecutive vectors of floats.
template <class Floats>
class Lookup {
 public:
  using Vector = hn::Vec<Floats>;
  using Words = hn::RebindToSigned<Floats>;

#if HWY_TARGET == HWY_AVX3 || HWY_TARGET == HWY_AVX3_DL
  static_assert(hn::MaxLanes(Floats()) == 16);
  explicit Lookup(hn::Vec<Words> lanes) : lanes_(lanes) {}
  HWY_INLINE Vector operator()(Vector low, Vector high) const {
    return Vector{_mm512_permutex2var_ps(low.raw, lanes_.raw, high.raw)};
  }

 private:
  hn::Vec<Words> lanes_;
#else
  explicit Lookup(hn::Vec<Words> lanes)
      : is_low_(hn::RebindMask(Floats(), lanes < hn::Set(Words(), count))),
        lanes_(hn::IndicesFromVec(Floats(), hn::And(lanes, hn::Set(Words(), count - 1)))) {}
  HWY_INLINE Vector operator()(Vector low, Vector high) const {
    return hn::IfThenElse(is_low_, hn::TableLookupLanes(low, lanes_),
                          hn::TableLookupLanes(high, lanes_));
  }

 private:
  static constexpr int count = static_cast<int>(hn::MaxLanes(Floats()));
  hn::Mask<Floats> is_low_;
  decltype(hn::IndicesFromVec(Floats(), hn::Zero(Words()))) lanes_;
#endif
};

}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per target
