// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "src/core/label.hpp"

namespace eventcamera {

/// The double window filter (Guo and Delbruck, "Low Cost and Latency Event Camera Background
/// Activity Denoising", TPAMI 2022): remembers the places of the last 36 events that were signal,
/// and of the last 36 that were noise.
class DoubleWindow {
 public:
  DoubleWindow() { clear(); }

  /// Keeps signal: events at most `distance` pixels across plus down from one in either window.
  LabelledEvents filter(LabelledEvents events, unsigned distance);

  void clear();

  /// Positions of events, padded to whole vectors with positions far from all others.
  struct Window {
    static constexpr std::size_t size = 36;

    std::array<std::int16_t, 48> x;
    std::array<std::int16_t, 48> y;
    std::size_t next;

    void add(const Event& event) {
      x[next] = static_cast<std::int16_t>(event.x);
      y[next] = static_cast<std::int16_t>(event.y());
      next = next + 1 == size ? 0 : next + 1;
    }
  };

 private:
  Window signal_;
  Window noise_;
};

}  // namespace eventcamera
