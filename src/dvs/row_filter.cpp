// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/row_filter.hpp"

#include <algorithm>

#include "src/dvs/exposure_gain.hpp"
#include "src/dvs/trajectory.hpp"

#define HWY_TARGET_INCLUDE "src/dvs/row_filter.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

using Floats = hn::CappedTag<float, max_lanes>;
using Words = hn::Rebind<std::int32_t, Floats>;
using Counts = hn::Rebind<std::uint32_t, Floats>;

template <class Pixel>
hn::Vec<Words> load_luma(const Pixel* luma) {
  return hn::PromoteTo(Words(), hn::LoadU(hn::Rebind<Pixel, Floats>(), luma));
}

template <class Pixel, bool has_bandwidth>
void filter(const PixelModel& model, const LightResponse& response, const SubInterval& sub_interval,
            const RunLuma& luma, const PixelRow& pixels, const Run& run, Candidates& candidates) {
  const ShadeTables& tables = *sub_interval.tables;
  const bool has_noise = model.has_noise();
  const bool keeps_saturated = response.gain() != 1;
  const bool is_partial = static_cast<float>(sub_interval.share) < 1;
  const Floats floats;
  const Words words;
  const Counts counts;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  const auto zero = hn::Zero(floats);
  const float* responses = response.table().data();
  const auto* lumas = static_cast<const Pixel*>(luma.target);
  const auto* shades = static_cast<const Pixel*>(luma.shade);
  const auto white = hn::Set(words, response.white());
  const auto below_saturated = hn::Set(words, saturated_luma(response.white()) - 1);
  const bool needs_shade = has_bandwidth || has_noise;
  const int shade_shift = response.bits() - 8;
  const auto duration = hn::Set(floats, static_cast<float>(sub_interval.duration));
  const auto share = hn::Set(floats, static_cast<float>(sub_interval.share));
  const auto rise = hn::Set(floats, static_cast<float>(sub_interval.rise));
  float* targets = pixels.target;
  float* references = pixels.reference;
  const float* positives = pixels.positive;
  const float* negatives = pixels.negative;
  const float* leaks = pixels.leak;
  const float* refractory_lefts = pixels.refractory_left;
  std::uint32_t* noise_budgets = pixels.noise_budget;
  std::size_t found = candidates.count;

  for (int x = run.first; x < run.last; x += lanes, lumas += lanes, shades += lanes) {
    const int count = std::min(lanes, run.last - x);
    const auto value = hn::Min(load_luma(lumas), white);
    auto shade = hn::Zero(words);
    if (needs_shade)
      shade = hn::ShiftRightSame(shades == lumas ? value : hn::Min(load_luma(shades), white),
                                 shade_shift);
    auto target = hn::GatherIndex(floats, responses, value);
    const auto last_target = hn::LoadU(floats, targets + x);
    if (keeps_saturated) {
      const auto is_saturated = hn::RebindMask(floats, value > below_saturated);
      target = hn::IfThenElse(is_saturated, hn::Max(target, last_target), target);
    }
    if (is_partial) target = last_target + (target - last_target) * share;
    // A rise of all signals is equivalent to a fall of all references.
    const auto leak = hn::LoadU(floats, leaks + x);
    const auto leaked = leak * duration + rise;

    auto last_signal = last_target;
    auto signal = target;
    auto margin = hn::Set(floats, rounding);  // by which the signal may exceed its end values
    if constexpr (has_bandwidth) {
      last_signal = hn::LoadU(floats, pixels.signal + x);
      const auto decay_factor = hn::GatherIndex(floats, tables.decay_factor.data(), shade);
      const auto mean_decay_factor =
          hn::GatherIndex(floats, tables.mean_decay_factor.data(), shade);
      const auto exponent = hn::GatherIndex(floats, tables.exponent.data(), shade);
      const auto lag = last_signal - last_target;
      signal = target - (target - last_target) * mean_decay_factor + lag * decay_factor;
      // The signal may reverse in between, but does not cross the tangents at its ends.
      const auto first_slope = leaked - lag * exponent;
      const auto last_slope = leaked + (target - signal) * exponent;
      const auto turns = first_slope * last_slope < zero;
      const auto to_turn = hn::Min(hn::Abs(first_slope), hn::Abs(last_slope));
      margin = margin + hn::IfThenElseZero(turns, to_turn);
    }

    const auto reference = hn::LoadU(floats, references + x);
    const auto next_reference = reference - leaked;
    const auto first = last_signal - reference;
    const auto last = signal - next_reference;
    const auto max = hn::Max(first, last) + margin;
    const auto min = hn::Min(first, last) - margin;
    const auto positive = hn::LoadU(floats, positives + x);
    const auto negative = hn::LoadU(floats, negatives + x);
    const auto refractory_left = hn::LoadU(floats, refractory_lefts + x);
    auto happens = hn::Or(max >= positive, min <= hn::Neg(negative));
    happens = hn::Or(happens, refractory_left > zero);
    auto noise_budget = hn::Zero(counts);
    if (has_noise) {
      const auto noise = hn::GatherIndex(counts, tables.noise.data(), shade);
      const auto before = hn::LoadU(counts, noise_budgets + x);
      happens = hn::Or(happens, hn::RebindMask(floats, hn::Not(before > noise)));
      noise_budget = before - noise;
    }
    happens = hn::And(happens, hn::FirstN(floats, static_cast<std::size_t>(count)));

    hn::StoreU(target, floats, targets + x);
    if constexpr (has_bandwidth) hn::StoreU(signal, floats, pixels.signal + x);
    if (HWY_LIKELY(hn::AllFalse(floats, happens))) {
      hn::StoreU(next_reference, floats, references + x);
      if (has_noise) hn::StoreU(noise_budget, counts, noise_budgets + x);
      continue;
    }
    const auto others = hn::Not(happens);
    hn::BlendedStore(next_reference, others, floats, references + x);
    if (has_noise)
      hn::BlendedStore(noise_budget, hn::RebindMask(counts, others), counts, noise_budgets + x);
    const FirstLanes<Floats> first_lanes(happens);
    const auto keep_integers = [&](std::int32_t* column, hn::Vec<Words> values) HWY_ATTR {
      const auto kept = first_lanes(hn::BitCast(floats, values));
      hn::StoreU(hn::BitCast(words, kept), words, column + found);
    };
    const auto keep = [&](Candidates::Column column, hn::Vec<Floats> values) HWY_ATTR {
      hn::StoreU(first_lanes(values), floats, candidates.column(column) + found);
    };
    keep_integers(candidates.x.data(), iota(words, x));
    keep_integers(candidates.shade.data(), shade);
    keep(Candidates::target, target);
    keep(Candidates::last_target, last_target);
    if constexpr (has_bandwidth) {
      keep(Candidates::signal, signal);
      keep(Candidates::last_signal, last_signal);
    }
    keep(Candidates::reference, reference);
    keep(Candidates::positive, positive);
    keep(Candidates::negative, negative);
    keep(Candidates::leak, leak);
    keep(Candidates::refractory_left, refractory_left);
    found += hn::CountTrue(floats, happens);
  }
  candidates.count = found;
}

void filter_luma(const PixelModel& model, const LightResponse& response,
                 const SubInterval& sub_interval, const RunLuma& luma, const PixelRow& pixels,
                 const Run& run, Candidates& candidates) {
  const auto filter_as = [&]<class Pixel>(Pixel) {
    if (model.has_bandwidth())
      filter<Pixel, true>(model, response, sub_interval, luma, pixels, run, candidates);
    else
      filter<Pixel, false>(model, response, sub_interval, luma, pixels, run, candidates);
  };
  if (response.bits() == 8)
    filter_as(std::uint8_t());
  else
    filter_as(std::uint16_t());
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(filter_luma);

void filter_run(const PixelModel& model, const LightResponse& response,
                const SubInterval& sub_interval, const RunLuma& luma, const PixelRow& pixels,
                const Run& run, Candidates& candidates) {
  HWY_DYNAMIC_DISPATCH(filter_luma)
  (model, response, sub_interval, luma, pixels, run, candidates);
}

}  // namespace eventcamera
#endif  // HWY_ONCE
