// SPDX-License-Identifier: LGPL-2.1-or-later
// Streams of events for tests of filters, and how filters are run on them.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <random>
#include <vector>

#include "src/core/label.hpp"
#include "src/core/sensor_size.hpp"
#include "src/filter/filter.hpp"

namespace streams {

using eventcamera::AbsoluteEvent;
using eventcamera::Event;
using eventcamera::Label;
using eventcamera::LabelledEvents;
using eventcamera::Microseconds;
using eventcamera::Polarity;
using eventcamera::SensorSize;

using Events = std::vector<AbsoluteEvent>;

inline void sort_by_time(Events& events) {
  std::ranges::stable_sort(events, {}, &AbsoluteEvent::t);
}

/// Events of random pixels, at intervals of up to 2 * `mean_interval` microseconds.
inline Events random_events(SensorSize sensor, std::size_t count, Microseconds mean_interval,
                            unsigned seed, Microseconds start = 0) {
  std::mt19937 random(seed);
  Events events;
  Microseconds t = start;
  for (std::size_t i = 0; i < count; ++i) {
    t += static_cast<Microseconds>(random() % static_cast<unsigned>(2 * mean_interval + 1));
    const int x = static_cast<int>(random() % static_cast<unsigned>(sensor.width));
    const int y = static_cast<int>(random() % static_cast<unsigned>(sensor.height));
    const auto polarity = random() % 2 == 0 ? Polarity::on : Polarity::off;
    events.push_back(AbsoluteEvent::at(x, y, t, polarity));
  }
  return events;
}

/// An ON edge that crosses the sensor and comes back as OFF, three pixels wide and a row a time,
/// with noise, bursts of a hot pixel, and a silent pause of a second.
inline Events made_scene(SensorSize sensor, unsigned seed = 1) {
  std::mt19937 random(seed);
  Events events;
  for (int pass = 0; pass < 4; ++pass)
    for (int step = 0; step < sensor.width; ++step)
      for (int y = 0; y < sensor.height; ++y)
        for (int trail = 0; trail < 3; ++trail) {
          const int x = pass % 2 == 0 ? step : sensor.width - 1 - step;
          const Microseconds t = pass * 1'300'000 + step * 2000 + trail * 700 +
                                 static_cast<Microseconds>(random() % 900);
          events.push_back(
              AbsoluteEvent::at(x, y, t, pass % 2 == 0 ? Polarity::on : Polarity::off));
        }
  const auto noise = random_events(sensor, events.size() / 3, 400, seed + 1);
  events.insert(events.end(), noise.begin(), noise.end());
  for (Microseconds t = 0; t < 3'000'000; t += 1000 + static_cast<Microseconds>(random() % 3000))
    events.push_back(AbsoluteEvent::at(sensor.width / 2, sensor.height - 1, t, Polarity::on));
  sort_by_time(events);
  return events;
}

/// What a filter makes of a stream that reaches it in buffers of 1 to `max_buffer` events. Checks
/// that labels stay with their events.
template <eventcamera::Filter Core>
Events filtered(Core& core, const Events& events, const typename Core::Settings& settings,
                std::size_t max_buffer, unsigned seed = 7, bool is_labelled = true) {
  std::mt19937 random(seed);
  Events kept;
  for (std::size_t done = 0; done < events.size();) {
    const auto count = std::min(events.size() - done, 1 + random() % max_buffer);
    // Buffers start at most a second before their first event.
    const Microseconds start = events[done].t - static_cast<Microseconds>(random() % 1'000'000);
    std::vector<Event> buffer;
    std::vector<Label> labels;
    for (std::size_t i = done; i < done + count; ++i) {
      buffer.push_back(
          {static_cast<std::uint32_t>(events[i].t - start), events[i].x, events[i].y_p});
      if (is_labelled) labels.push_back({.object_class = static_cast<std::uint16_t>(events[i].t)});
    }
    const LabelledEvents left = core.filter({buffer, labels}, start, settings);
    EXPECT_EQ(left.labels.size(), is_labelled ? left.events.size() : 0U);
    for (std::size_t i = 0; i < left.events.size(); ++i) {
      const Event& event = left.events[i];
      kept.push_back({start + event.t, event.x, event.y_p});
      if (!left.labels.empty()) {
        EXPECT_EQ(left.labels[i].object_class, static_cast<std::uint16_t>(start + event.t));
      }
    }
    done += count;
  }
  return kept;
}

}  // namespace streams
