// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <numeric>

#include "src/core/label.hpp"

namespace eventcamera {

/// Number of labelled events by cause.
class CauseCounts {
 public:
  static constexpr std::array causes = {Cause::unknown,    Cause::light,     Cause::leak,
                                        Cause::shot_noise, Cause::hot_pixel, Cause::exposure_pulse};

  /// Causes that this version does not know count as unknown.
  void add(Cause cause) {
    const auto index = static_cast<std::size_t>(cause);
    ++counts_[index < causes.size() ? index : 0];
  }

  std::uint64_t operator[](Cause cause) const { return counts_[static_cast<std::size_t>(cause)]; }

  std::uint64_t all() const {
    return std::accumulate(counts_.begin(), counts_.end(), std::uint64_t{0});
  }

  /// Events of a known cause other than light.
  std::uint64_t noise() const { return all() - (*this)[Cause::unknown] - (*this)[Cause::light]; }

 private:
  std::array<std::uint64_t, causes.size()> counts_{};
};

/// How well a filter separates light from noise: light that it keeps is a true positive.
struct Classification {
  std::uint64_t true_positives = 0;
  std::uint64_t false_positives = 0;
  std::uint64_t true_negatives = 0;
  std::uint64_t false_negatives = 0;
  double true_positive_rate = 0;   ///< recall: the fraction of the light that is kept
  double false_positive_rate = 0;  ///< the fraction of the noise that is kept
  double precision = 0;            ///< fraction of light among the kept events

  /// A rate is 0 without events to measure it.
  static Classification of(const CauseCounts& before, const CauseCounts& after) {
    const auto share = [](std::uint64_t part, std::uint64_t other) {
      const auto all = static_cast<double>(part) + static_cast<double>(other);
      return all > 0 ? static_cast<double>(part) / all : 0;
    };
    const auto dropped = [](std::uint64_t all, std::uint64_t kept) {
      return all - std::min(all, kept);
    };
    Classification result;
    result.true_positives = after[Cause::light];
    result.false_positives = after.noise();
    result.true_negatives = dropped(before.noise(), result.false_positives);
    result.false_negatives = dropped(before[Cause::light], result.true_positives);
    result.true_positive_rate = share(result.true_positives, result.false_negatives);
    result.false_positive_rate = share(result.false_positives, result.true_negatives);
    result.precision = share(result.true_positives, result.false_positives);
    return result;
  }
};

}  // namespace eventcamera
