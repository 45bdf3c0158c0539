// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>

#include "src/core/image.hpp"
#include "src/core/luma.hpp"
#include "src/core/thread_pool.hpp"
#include "src/flow/region_of_interest_flow.hpp"

namespace eventcamera {

/// Dense flow between successive frames of any bit depth.
class FrameFlow {
 public:
  /// Finds the flow from `last`, the `now` of the previous call unless forget() was called since,
  /// to `now`. `changed` must hold all pixels that differ; far from them the flow is 0. Valid until
  /// the next call.
  template <class Pixel>
  ImageView<Flow> find(FlowMethod method, int bits, const Image<Pixel>& last,
                       const Image<Pixel>& now, const Box& changed, ThreadPool& threads) {
    if (!finder_ || finder_->method() != method) finder_.emplace(method, now.width(), now.height());
    const auto luma = [bits](const Image<Pixel>& frame) {
      return LumaView{{frame.width(), frame.height(), bits}, frame.row(0), frame.stride()};
    };
    return finder_->find(last_grey_.of(luma(last)), grey_.of(luma(now)), changed, threads);
  }

  /// Call if the next `last` is another frame.
  void forget() { finder_.reset(); }

 private:
  std::optional<RegionOfInterestFlow> finder_;
  Grey8 last_grey_;
  Grey8 grey_;
};

}  // namespace eventcamera
