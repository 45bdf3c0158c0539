// SPDX-License-Identifier: LGPL-2.1-or-later
// Bilinear samples in SIMD. Included once for each SIMD target, by what foreach_target.h compiles.
#if defined(EVENTCAMERA_SAMPLER_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef EVENTCAMERA_SAMPLER_INL
#undef EVENTCAMERA_SAMPLER_INL
#else
#define EVENTCAMERA_SAMPLER_INL
#endif

#include <hwy/highway.h>

#include <cstdint>

#include "src/core/image.hpp"
#include "src/simulate/motion.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// No vector of places is wider.
inline constexpr int max_sampled_lanes = 16;

using Words = hn::CappedTag<std::int32_t, max_sampled_lanes>;
using Floats = hn::CappedTag<float, max_sampled_lanes>;
using Bytes = hn::Rebind<std::uint8_t, Words>;
using Vector = hn::Vec<Words>;

/// Where samples lie, for many places at once, in 1/65536 of a pixel.
struct SamplePlaces {
  Vector x0;  ///< the pixel to the upper left
  Vector y0;
  Vector right;  ///< from there, in 1/64 of a pixel
  Vector down;

  SamplePlaces(Vector x, Vector y, Vector right_end, Vector lower_end) {
    const auto zero = hn::Zero(Words());
    const auto half = hn::Set(Words(), 512);
    const auto low_bits = hn::Set(Words(), 63);
    const auto qx = hn::Min(hn::Max(hn::ShiftRight<10>(hn::Add(x, half)), zero), right_end);
    const auto qy = hn::Min(hn::Max(hn::ShiftRight<10>(hn::Add(y, half)), zero), lower_end);
    x0 = hn::ShiftRight<6>(qx);
    y0 = hn::ShiftRight<6>(qy);
    right = hn::And(qx, low_bits);
    down = hn::And(qy, low_bits);
  }
};

/// sample() of warp.hpp, for many places at once.
class Sampler {
 public:
  explicit Sampler(const ImageView<std::uint8_t>& picture)
      : pixels_(reinterpret_cast<const std::int32_t*>(picture.data)),
        stride_(hn::Set(Words(), static_cast<std::int32_t>(picture.stride))),
        right_end_(hn::Set(Words(), (picture.width - 1) * 64)),
        lower_end_(hn::Set(Words(), (picture.height - 1) * 64)),
        last_row_(hn::Set(Words(), picture.height - 1)) {}

  /// At places in 1/65536 of a pixel; in 1/4096 of a grey level.
  Vector at(Vector x, Vector y) const {
    const SamplePlaces at(x, y, right_end_, lower_end_);
    const auto y1 = hn::Min(hn::Add(at.y0, hn::Set(Words(), 1)), last_row_);
    const auto upper = between(hn::Add(hn::Mul(at.y0, stride_), at.x0), at.right);
    const auto lower = between(hn::Add(hn::Mul(y1, stride_), at.x0), at.right);
    return hn::Add(hn::ShiftLeft<6>(upper), hn::Mul(hn::Sub(lower, upper), at.down));
  }

 private:
  /// Between a pixel and its right neighbour (whose weight is 0 where there is none), in 1/64.
  Vector between(Vector offset, Vector right) const {
    const auto byte = hn::Set(Words(), 255);
    const auto pixels = hn::GatherOffset(Words(), pixels_, offset);
    const auto a = hn::And(pixels, byte);
    const auto b = hn::And(hn::ShiftRight<8>(pixels), byte);
    return hn::Add(hn::ShiftLeft<6>(a), hn::Mul(hn::Sub(b, a), right));
  }

  const std::int32_t* pixels_;
  Vector stride_;
  Vector right_end_;
  Vector lower_end_;
  Vector last_row_;
};

/// The same samples, of a picture of which each pixel stands beside the one below it: all that a
/// sample needs is gathered at once.
class PairSampler {
 public:
  /// The pixel in the lower byte, the one below it in the upper.
  explicit PairSampler(const ImageView<std::uint16_t>& pairs)
      : pairs_(reinterpret_cast<const std::int32_t*>(pairs.data)),
        stride_(hn::Set(Words(), static_cast<std::int32_t>(pairs.stride))),
        right_end_(hn::Set(Words(), (pairs.width - 1) * 64)),
        lower_end_(hn::Set(Words(), (pairs.height - 1) * 64)) {}

  Vector at(Vector x, Vector y) const {
    const SamplePlaces at(x, y, right_end_, lower_end_);
    const auto offset = hn::Add(hn::Mul(at.y0, stride_), hn::Add(at.x0, at.x0));
    const auto pairs = hn::GatherOffset(Words(), pairs_, offset);
    // The left and the right column side by side, 16 bits each: no sum is longer.
    const auto bytes = hn::Set(Words(), 0x00FF00FF);
    const auto upper = hn::And(pairs, bytes);
    const auto lower = hn::And(hn::ShiftRight<8>(pairs), bytes);
    const auto columns =
        hn::Add(hn::Mul(upper, hn::Sub(hn::Set(Words(), 64), at.down)), hn::Mul(lower, at.down));
    const auto left = hn::And(columns, hn::Set(Words(), 0xFFFF));
    const auto right = hn::ShiftRight<16>(columns);
    return hn::Add(hn::ShiftLeft<6>(left), hn::Mul(hn::Sub(right, left), at.right));
  }

 private:
  const std::int32_t* pairs_;
  Vector stride_;
  Vector right_end_;
  Vector lower_end_;
};

/// motion_per_step(), for many flows at once.
inline Vector motions(hn::Vec<Floats> flow, float scale) {
  const auto longest = hn::Set(Floats(), static_cast<float>(max_side));
  const auto number = hn::IfThenElseZero(hn::Eq(flow, flow), flow);
  const auto cut = hn::Min(hn::Max(number, hn::Neg(longest)), longest);
  return hn::NearestInt(hn::Mul(cut, hn::Set(Floats(), scale)));
}

}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per target
