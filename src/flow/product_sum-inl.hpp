// SPDX-License-Identifier: LGPL-2.1-or-later
// Sums of products of 16-bit values. Included once per SIMD target, after foreach_target.h.
#if defined(EVENTCAMERA_PRODUCT_SUM_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef EVENTCAMERA_PRODUCT_SUM_INL
#undef EVENTCAMERA_PRODUCT_SUM_INL
#else
#define EVENTCAMERA_PRODUCT_SUM_INL
#endif

#include <cstdint>

#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {

/// Lane-wise sums of the products of 16-bit vectors, exact in 32 bits.
template <class Factors>
class ProductSum {
 public:
  using Factor = hn::Vec<Factors>;
  using Lanes = hn::Repartition<std::int32_t, Factors>;

  // Not defaulted: GCC 12 compiles a defaulted constructor without the target's instructions.
  ProductSum() : low_(hn::Zero(Lanes())), high_(hn::Zero(Lanes())) {}
  void add(Factor a, Factor b) { low_ = hn::ReorderWidenMulAccumulate(Lanes(), a, b, low_, high_); }
  hn::Vec<Lanes> lanes() const { return low_ + high_; }

 private:
  hn::Vec<Lanes> low_;
  hn::Vec<Lanes> high_;
};

#if HWY_TARGET != HWY_SCALAR
/// In each 128-bit block, lane c of the result is the sum of the lanes of sum c.
template <class Lanes, class Value = hn::Vec<Lanes>>
HWY_INLINE Value add_lanes(Lanes lanes, Value sum0, Value sum1, Value sum2, Value sum3) {
  const hn::Repartition<std::int64_t, Lanes> pairs;
  const auto add_pairs = [&](Value a, Value b) {
    return hn::BitCast(pairs, hn::InterleaveLower(lanes, a, b) + hn::InterleaveUpper(lanes, a, b));
  };
  const auto low = add_pairs(sum0, sum1);
  const auto high = add_pairs(sum2, sum3);
  return hn::BitCast(lanes, hn::InterleaveLower(pairs, low, high)) +
         hn::BitCast(lanes, hn::InterleaveUpper(pairs, low, high));
}
#endif

}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per target
