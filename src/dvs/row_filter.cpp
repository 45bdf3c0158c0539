// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/row_filter.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "src/dvs/row_filter.cpp"
#include <hwy/foreach_target.h>
// Highway wants to come after that.
#include <hwy/highway.h>

#include <algorithm>
#include <bit>

#include "src/dvs/course.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

/// No vector is wider.
constexpr int max_lanes = 16;

using Floats = hn::CappedTag<float, max_lanes>;
using Words = hn::Rebind<std::int32_t, Floats>;
using Counts = hn::Rebind<std::uint32_t, Floats>;
using Vector = hn::Vec<Floats>;

template <class Pixel>
hn::Vec<Words> load_luma(const Pixel* luma) {
  return hn::PromoteTo(Words(), hn::LoadU(hn::Rebind<Pixel, Floats>(), luma));
}

template <class Pixel>
void pass(const Screen& screen, const Pixel* luma, int y, PixelArray& pixels,
          Candidates& candidates) {
  const Floats floats;
  const Words words;
  const Counts counts;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  const int width = pixels.width;
  const auto zero = hn::Zero(floats);
  const auto white = hn::Set(words, screen.response.white());
  const auto duration = hn::Set(floats, screen.duration);
  const auto share = hn::Set(floats, screen.share);
  const auto rise = hn::Set(floats, screen.rise);
  float* targets = pixels.target.row(y);
  float* signals = pixels.signal.row(y);
  float* references = pixels.reference.row(y);
  const float* positives = pixels.positive.row(y);
  const float* negatives = pixels.negative.row(y);
  const float* leaks = pixels.leak.row(y);
  const float* rests = pixels.rest.row(y);
  std::uint32_t* quiets = pixels.quiet.row(y);

  for (int x = 0; x < width; x += lanes) {
    const int count = std::min(lanes, width - x);
    const Pixel* here = luma + x;
    Pixel tail[max_lanes] = {};
    if (count < lanes) {  // behind the row lies what is not ours
      std::copy_n(here, count, tail);
      here = tail;
    }
    const auto value = hn::Min(load_luma(here), white);
    const auto shade = hn::ShiftRightSame(value, screen.bits - 8);
    auto target = hn::GatherIndex(floats, screen.response.values(), value);
    const auto last_target = hn::LoadU(floats, targets + x);
    if (screen.share < 1)
      target = hn::Add(last_target, hn::Mul(hn::Sub(target, last_target), share));
    // That all signals rise is the same as that all references fall.
    const auto leaked = hn::Add(hn::Mul(hn::LoadU(floats, leaks + x), duration), rise);

    auto last_signal = last_target;
    auto signal = target;
    auto beyond = hn::Set(floats, rounding);  // where it begins and ends it turns, at most
    if (screen.has_bandwidth) {
      last_signal = hn::LoadU(floats, signals + x);
      const auto kept = hn::GatherIndex(floats, screen.tables.kept.data(), shade);
      const auto mean_kept = hn::GatherIndex(floats, screen.tables.mean_kept.data(), shade);
      const auto decays = hn::GatherIndex(floats, screen.tables.decays.data(), shade);
      const auto lag = hn::Sub(last_signal, last_target);
      signal = hn::Add(hn::Sub(target, hn::Mul(hn::Sub(target, last_target), mean_kept)),
                       hn::Mul(lag, kept));
      // No turn goes beyond where the tangents at both ends lead.
      const auto first_slope = hn::Sub(leaked, hn::Mul(lag, decays));
      const auto last_slope = hn::Add(leaked, hn::Mul(hn::Sub(target, signal), decays));
      const auto turns = hn::Lt(hn::Mul(first_slope, last_slope), zero);
      const auto to_turn = hn::Min(hn::Abs(first_slope), hn::Abs(last_slope));
      beyond = hn::Add(beyond, hn::IfThenElseZero(turns, to_turn));
    }

    const auto reference = hn::LoadU(floats, references + x);
    const auto next_reference = hn::Sub(reference, leaked);
    const auto first = hn::Sub(last_signal, reference);
    const auto last = hn::Sub(signal, next_reference);
    const auto highest = hn::Add(hn::Max(first, last), beyond);
    const auto lowest = hn::Sub(hn::Min(first, last), beyond);
    auto happens = hn::Or(hn::Ge(highest, hn::LoadU(floats, positives + x)),
                          hn::Le(lowest, hn::Neg(hn::LoadU(floats, negatives + x))));
    happens = hn::Or(happens, hn::Gt(hn::LoadU(floats, rests + x), zero));
    auto quiet = hn::Zero(counts);
    auto is_noisy = hn::Lt(zero, zero);
    if (screen.has_noise) {
      const auto noise = hn::GatherIndex(counts, screen.tables.noise.data(), shade);
      const auto before = hn::LoadU(counts, quiets + x);
      is_noisy = hn::RebindMask(floats, hn::Not(hn::Gt(before, noise)));
      happens = hn::Or(happens, is_noisy);
      quiet = hn::Sub(before, noise);
    }
    happens = hn::And(happens, hn::FirstN(floats, static_cast<std::size_t>(count)));

    hn::StoreU(target, floats, targets + x);
    hn::StoreU(signal, floats, signals + x);
    if (HWY_LIKELY(hn::AllFalse(floats, happens))) {
      hn::StoreU(next_reference, floats, references + x);
      if (screen.has_noise) hn::StoreU(quiet, counts, quiets + x);
      continue;
    }
    const auto rest_of_them = hn::Not(happens);
    hn::BlendedStore(next_reference, rest_of_them, floats, references + x);
    if (screen.has_noise)
      hn::BlendedStore(quiet, hn::RebindMask(counts, rest_of_them), counts, quiets + x);
    HWY_ALIGN float last_targets[max_lanes];
    HWY_ALIGN float last_signals[max_lanes];
    HWY_ALIGN std::int32_t shades_here[max_lanes];
    hn::Store(last_target, floats, last_targets);
    hn::Store(last_signal, floats, last_signals);
    hn::Store(shade, words, shades_here);
    const auto add = [&](const auto& mask, std::vector<Candidate>& to) {
      std::uint64_t bits[(max_lanes + 63) / 64] = {};
      hn::StoreMaskBits(floats, mask, reinterpret_cast<std::uint8_t*>(bits));
      for (; bits[0] != 0; bits[0] &= bits[0] - 1) {
        const int i = std::countr_zero(bits[0]);
        to.push_back({x + i, shades_here[i], last_targets[i], last_signals[i]});
      }
    };
    add(hn::AndNot(is_noisy, happens), candidates.quiet);
    add(hn::And(is_noisy, happens), candidates.noisy);
  }
}

void pass_8(const Screen& screen, const std::uint8_t* luma, int y, PixelArray& pixels,
            Candidates& candidates) {
  pass(screen, luma, y, pixels, candidates);
}

void pass_16(const Screen& screen, const std::uint16_t* luma, int y, PixelArray& pixels,
             Candidates& candidates) {
  pass(screen, luma, y, pixels, candidates);
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(pass_8);
HWY_EXPORT(pass_16);

void pass_row(const Screen& screen, const std::uint8_t* luma, int y, PixelArray& pixels,
              Candidates& candidates) {
  HWY_DYNAMIC_DISPATCH(pass_8)(screen, luma, y, pixels, candidates);
}

void pass_row(const Screen& screen, const std::uint16_t* luma, int y, PixelArray& pixels,
              Candidates& candidates) {
  HWY_DYNAMIC_DISPATCH(pass_16)(screen, luma, y, pixels, candidates);
}

}  // namespace eventcamera
#endif  // HWY_ONCE
