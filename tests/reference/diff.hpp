// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdlib>

#include "tests/reference/differences.hpp"

namespace eventcamera::reference {

/// D = now - last if that exceeds a threshold, else 0.
template <class Pixel>
Image<int> difference_frame(const Image<Pixel>& last, const Image<Pixel>& now,
                            const Thresholds& thresholds) {
  Image<int> result(now.width(), now.height());
  for (int y = 0; y < now.height(); ++y) {
    for (int x = 0; x < now.width(); ++x) {
      const int difference = now.at(x, y) - last.at(x, y);
      if (difference > thresholds.positive || -difference > thresholds.negative)
        result.at(x, y) = difference;
    }
  }
  return result;
}

/// One polarity (sign 1 or -1) of D in 8 bits, at least 1 where D is not 0.
inline Image<std::uint8_t> part_of(const Image<int>& difference, int sign, int bits) {
  Image<std::uint8_t> part(difference.width(), difference.height());
  for (int y = 0; y < part.height(); ++y)
    for (int x = 0; x < part.width(); ++x)
      if (const int d = sign * difference.at(x, y); d > 0)
        part.at(x, y) = static_cast<std::uint8_t>(std::max(1, d >> (bits - 8)));
  return part;
}

/// Pixels of a part, in raster order.
inline std::vector<Point> points_of(const Image<std::uint8_t>& part) {
  std::vector<Point> points;
  for (int y = 0; y < part.height(); ++y)
    for (int x = 0; x < part.width(); ++x)
      if (part.at(x, y) != 0) points.push_back({x, y});
  return points;
}

/// Nonzero pixels of one polarity of D(i-1), and their tracks.
struct Tracked {
  std::vector<Point> points;
  std::vector<Track> tracks;
};

/// Events from D(i-1) = before to D(i) = now. A tracked pixel fires at each step if it ends next to
/// a pixel of its polarity in `now`; of several on one pixel, the largest difference fires.
inline std::vector<Event> diff(const Image<int>& before, const Image<int>& now, const Tracked& on,
                               const Tracked& off, const StepTimes& steps) {
  const int m = steps.count();
  const auto arrives = [&](const Point& end, int sign) {
    for (int y = end.y - 1; y <= end.y + 1; ++y)
      for (int x = end.x - 1; x <= end.x + 1; ++x)
        if (inside({x, y}, now.width(), now.height()) && sign * now.at(x, y) > 0) return true;
    return false;
  };
  std::vector<Event> events;
  const auto fire = [&](const Image<int>& frame, int j) {
    for (int y = 0; y < frame.height(); ++y)
      for (int x = 0; x < frame.width(); ++x)
        if (const int d = frame.at(x, y); d != 0)
          events.push_back(
              Event::at(x, y, steps.microseconds(j), d > 0 ? Polarity::on : Polarity::off));
  };
  for (int j = 1; j < m; ++j) {
    Image<int> frame(now.width(), now.height());
    const auto land = [&](const Tracked& tracked, int sign) {
      for (std::size_t i = 0; i < tracked.points.size(); ++i) {
        const Point& p = tracked.points[i];
        const Point end = moved_point(p, tracked.tracks[i].flow, m, m);
        if (!tracked.tracks[i].found || !inside(end, now.width(), now.height()) ||
            !arrives(end, sign))
          continue;
        const Point to = moved_point(p, tracked.tracks[i].flow, j, m);
        int& here = frame.at(to.x, to.y);
        const int d = before.at(p.x, p.y);
        if (std::abs(d) > std::abs(here) || (std::abs(d) == std::abs(here) && d > 0)) here = d;
      }
    };
    land(on, 1);
    land(off, -1);
    fire(frame, j);
  }
  fire(now, m);
  return events;
}

}  // namespace eventcamera::reference
