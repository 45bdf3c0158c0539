// SPDX-License-Identifier: LGPL-2.1-or-later
// The filters of events, written as plainly as their definitions: 64-bit times of all pixels, one
// event after another.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <deque>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/sensor_size.hpp"

namespace reference {

using eventcamera::AbsoluteEvent;
using eventcamera::Microseconds;
using eventcamera::SensorSize;

using Events = std::vector<AbsoluteEvent>;

/// Something for each pixel that has had an event.
template <class Value>
using OfPixels = std::map<std::pair<int, int>, Value>;

inline Events refractory(const Events& events, Microseconds period) {
  Events kept;
  OfPixels<Microseconds> last_kept;
  for (const auto& event : events) {
    const auto last = last_kept.find({event.x, event.y()});
    if (last != last_kept.end() && event.t - last->second < period) continue;
    last_kept[{event.x, event.y()}] = event.t;
    kept.push_back(event);
  }
  return kept;
}

enum class BurstPart { first, second, all_but_first };

inline Events trail(const Events& events, BurstPart part, Microseconds threshold) {
  struct Burst {
    AbsoluteEvent last;
    int length;
  };
  Events kept;
  OfPixels<Burst> bursts;
  for (const auto& event : events) {
    auto [burst, is_first] = bursts.try_emplace({event.x, event.y()}, Burst{event, 0});
    auto& [last, length] = burst->second;
    const bool goes_on =
        !is_first && event.polarity() == last.polarity() && event.t - last.t < threshold;
    length = goes_on ? length + 1 : 1;
    last = event;
    const bool is_kept = part == BurstPart::first    ? length == 1
                         : part == BurstPart::second ? length == 2
                                                     : length >= 2;
    if (is_kept) kept.push_back(event);
  }
  return kept;
}

/// The times since the last events of the pixels in the square of a radius around each event,
/// without its own pixel, and only of its polarity if `match_polarity`. Calls decide(ages).
template <class Decide>
Events with_support(const Events& events, int radius, bool match_polarity, const Decide& decide) {
  Events kept;
  OfPixels<Microseconds> last[2];
  for (const auto& event : events) {
    auto& times = last[match_polarity && event.polarity() == eventcamera::Polarity::on ? 1 : 0];
    std::vector<Microseconds> ages;
    for (int y = event.y() - radius; y <= event.y() + radius; ++y)
      for (int x = event.x - radius; x <= event.x + radius; ++x)
        if (const auto found = times.find({x, y});
            found != times.end() && (x != event.x || y != event.y()))
          ages.push_back(event.t - found->second);
    times[{event.x, event.y()}] = event.t;
    if (decide(ages)) kept.push_back(event);
  }
  return kept;
}

/// BAF with min_neighbours = 1.
inline Events stcf(const Events& events, Microseconds correlation_time, int min_neighbours,
                   bool match_polarity) {
  return with_support(events, 1, match_polarity, [&](const std::vector<Microseconds>& ages) {
    return std::ranges::count_if(ages, [&](auto age) { return age <= correlation_time; }) >=
           min_neighbours;
  });
}

inline Events time_kernel(const Events& events, Microseconds correlation_time, double threshold) {
  return with_support(events, 2, true, [&](const std::vector<Microseconds>& ages) {
    Microseconds left = 0;
    for (const auto age : ages) left += std::max(correlation_time - age, Microseconds{0});
    return static_cast<double>(left) >= threshold * static_cast<double>(correlation_time);
  });
}

inline Events double_window(const Events& events, int distance) {
  Events kept;
  std::deque<AbsoluteEvent> signal;
  std::deque<AbsoluteEvent> noise;
  for (const auto& event : events) {
    const auto is_near = [&](const AbsoluteEvent& other) {
      return std::abs(event.x - other.x) + std::abs(event.y() - other.y()) <= distance;
    };
    const bool is_signal =
        std::ranges::any_of(signal, is_near) || std::ranges::any_of(noise, is_near);
    auto& window = is_signal ? signal : noise;
    window.push_back(event);
    if (window.size() > 36) window.pop_front();
    if (is_signal) kept.push_back(event);
  }
  return kept;
}

/// Frequencies in Hz, and the share of ON phases.
struct Flicker {
  double min_frequency;
  double max_frequency;
  double duty_cycle;
  int start_threshold;
  int stop_threshold;
};

/// The events of pixels while they flicker, or all others.
inline Events flicker(const Events& events, const Flicker& sought, bool keeps_flicker) {
  struct Pixel {
    AbsoluteEvent first_of_phase;
    int count = 0;
    bool flickers = false;
  };
  Events kept;
  OfPixels<Pixel> pixels;
  for (const auto& event : events) {
    auto& [first, count, flickers] =
        pixels.try_emplace({event.x, event.y()}, Pixel{event}).first->second;
    const auto length = static_cast<double>(event.t - first.t);
    const auto period_of = [](double frequency) { return 1e6 / frequency; };
    if (length > std::floor(period_of(sought.min_frequency))) {
      first = event;
      count = 0;
      flickers = false;
    } else if (event.polarity() != first.polarity()) {
      const double share =
          first.polarity() == eventcamera::Polarity::on ? sought.duty_cycle : 1 - sought.duty_cycle;
      const bool fits = length >= std::floor(share * period_of(sought.max_frequency)) &&
                        length <= std::ceil(share * period_of(sought.min_frequency));
      count = std::clamp(count + (fits ? 1 : -1), 0, 7);
      flickers = count >= (flickers ? sought.stop_threshold : sought.start_threshold);
      first = event;
    }
    if (flickers == keeps_flicker) kept.push_back(event);
  }
  return kept;
}

/// Pixels that are hot are found at the end of every period, of the events in it.
inline Events without_hot_pixels(const Events& events, SensorSize sensor, Microseconds period,
                                 double min_rate, double ratio) {
  Events kept;
  OfPixels<int> counts;
  std::set<std::pair<int, int>> hot;
  Microseconds end = events.empty() ? 0 : events.front().t + period;
  for (const auto& event : events) {
    if (event.t >= end) {
      hot.clear();
      for (const auto& [pixel, count] : counts) {
        std::vector<int> around;
        for (int y = pixel.second - 1; y <= pixel.second + 1; ++y)
          for (int x = pixel.first - 1; x <= pixel.first + 1; ++x)
            if (x >= 0 && y >= 0 && x < sensor.width && y < sensor.height &&
                std::pair(x, y) != pixel)
              around.push_back(counts.contains({x, y}) ? counts.at({x, y}) : 0);
        std::ranges::sort(around);
        const int median = around.empty() ? 0 : around[around.size() / 2];
        if (count >= min_rate * static_cast<double>(period) / 1e6 && count >= ratio * median)
          hot.insert(pixel);
      }
      counts.clear();
      while (event.t >= end) end += period;
    }
    ++counts[{event.x, event.y()}];
    if (!hot.contains({event.x, event.y()})) kept.push_back(event);
  }
  return kept;
}

}  // namespace reference
