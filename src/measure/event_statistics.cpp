// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/measure/event_statistics.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace eventcamera {
namespace {

double pixels_of(const EventMap& map) {
  return static_cast<double>(map.width()) * static_cast<double>(map.height());
}

double mean_of(const EventMap& map) {
  double sum = 0;
  for (int y = 0; y < map.height(); ++y)
    for (int x = 0; x < map.width(); ++x) sum += map.at(x, y);
  return sum / pixels_of(map);
}

}  // namespace

Microseconds IntervalHistogram::quantile(double share) const {
  if (count_ == 0) return 0;
  const auto rank = std::clamp<std::uint64_t>(
      static_cast<std::uint64_t>(std::ceil(share * static_cast<double>(count_))), 1, count_);
  std::uint64_t below = 0;
  std::size_t bin = 0;
  while ((below += bins_[bin]) < rank) ++bin;
  return middle_of(bin);
}

double IntervalHistogram::distance_to(const IntervalHistogram& other) const {
  if (count_ == 0 || other.count_ == 0) return 0;
  const auto place_of = [](std::size_t bin) {
    return std::log10(std::max(static_cast<double>(middle_of(bin)), 0.5));
  };
  double sum = 0;
  std::uint64_t ours = 0;
  std::uint64_t others = 0;
  for (std::size_t bin = 0; bin + 1 < bin_count; ++bin) {
    ours += bins_[bin];
    others += other.bins_[bin];
    if (ours == count_ && others == other.count_) break;
    const double share = static_cast<double>(ours) / static_cast<double>(count_);
    const double other_share = static_cast<double>(others) / static_cast<double>(other.count_);
    sum += std::abs(share - other_share) * (place_of(bin + 1) - place_of(bin));
  }
  return sum;
}

StreamFigures EventStatistics::figures(Nanoseconds duration) const {
  StreamFigures figures;
  figures.events = on_ + off_;
  figures.active_share = static_cast<double>(active_) / pixels_of(map_);
  if (figures.events > 0) {
    figures.on_share = static_cast<double>(on_) / static_cast<double>(figures.events);
    figures.distinct_share = static_cast<double>(distinct_) / static_cast<double>(figures.events);
  }
  for (std::size_t i = 0; i < interval_shares.size(); ++i)
    figures.intervals[i] = intervals_.quantile(interval_shares[i]);
  if (duration <= 0) return figures;

  const double seconds = static_cast<double>(duration) * 1e-9;
  const double pixels = pixels_of(map_);
  const double mean = static_cast<double>(figures.events) / pixels;
  const double variance = static_cast<double>(squares_) / pixels - mean * mean;
  figures.rate = static_cast<double>(figures.events) / seconds;
  figures.mean = mean / seconds;
  figures.std_dev = std::sqrt(std::max(variance, 0.0)) / seconds;
  return figures;
}

double correlation(const EventMap& a, const EventMap& b) {
  const double mean_a = mean_of(a);
  const double mean_b = mean_of(b);
  double squares_a = 0;
  double squares_b = 0;
  double products = 0;
  for (int y = 0; y < a.height(); ++y) {
    for (int x = 0; x < a.width(); ++x) {
      const double off_a = a.at(x, y) - mean_a;
      const double off_b = b.at(x, y) - mean_b;
      squares_a += off_a * off_a;
      squares_b += off_b * off_b;
      products += off_a * off_b;
    }
  }
  return squares_a > 0 && squares_b > 0 ? products / std::sqrt(squares_a * squares_b) : 0;
}

}  // namespace eventcamera
