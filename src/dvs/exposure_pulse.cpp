// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/exposure_pulse.hpp"

#include <algorithm>

namespace eventcamera {

const std::vector<PulseEdge>& ExposurePulse::next(const DvsSettings& settings, double duration,
                                                  bool is_exposed) {
  constexpr double edge = PulseEdge::duration;
  edges_.clear();
  double free_from = 0;
  if (height_ > 0) {
    if (falls_in_ + edge > duration) {
      falls_in_ = std::max(0.0, falls_in_ - duration);
      return edges_;
    }
    edges_.push_back({falls_in_, -height_});
    free_from = falls_in_ + edge;
    height_ = 0;
  }
  const double begin = duration - std::max(settings.exposure_lead, edge);
  if (!is_exposed || settings.exposure_pulse <= 0 || begin < free_from) return edges_;

  edges_.push_back({begin, settings.exposure_pulse});
  const double fall = begin + edge + plateau;
  if (fall + edge <= duration) {
    edges_.push_back({fall, -settings.exposure_pulse});
  } else {
    height_ = settings.exposure_pulse;
    falls_in_ = std::max(0.0, fall - duration);
  }
  return edges_;
}

}  // namespace eventcamera
