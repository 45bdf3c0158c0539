// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <optional>
#include <utility>

#include "src/core/event.hpp"
#include "src/core/image.hpp"
#include "src/core/luma.hpp"
#include "src/core/thread_pool.hpp"
#include "src/dvs/dvs_settings.hpp"
#include "src/dvs/exposure_gain.hpp"
#include "src/dvs/light_response.hpp"
#include "src/dvs/motion_deblur.hpp"
#include "src/flow/dense_flow.hpp"
#include "src/simulate/difference.hpp"
#include "src/simulate/frame_flow.hpp"

namespace eventcamera {

/// The frames at both ends of an interval, and the motion between them.
template <class Pixel>
class FramePair {
 public:
  explicit FramePair(const LumaFormat& format)
      : last(format.width, format.height), now(format.width, format.height), bits_(format.bits) {}

  void start(const ImageView<Pixel>& frame) {
    last.assign(frame);
    blurred_last_.reset();
    frame_flow_.forget();
    is_first_ = true;
  }

  /// Finds the gain of the exposure and, for Upsampling::motion, `flow` if it is not known; then
  /// removes motion blur. Calls settle() if that changes the first frame.
  template <class Settle>
  void prepare(const DvsSettings& settings, LightResponse& response, Nanoseconds duration,
               std::optional<ImageView<Flow>>& flow, ThreadPool& threads, const Settle& settle) {
    const double gain = response.compensate(last.view(), now.view(), threads);
    const bool moves = settings.upsampling == Upsampling::motion;
    if (gain != 1 && moves) {
      expose(last, bits_, settings.linear_light, gain, threads);
      if (blurred_last_) expose(*blurred_last_, bits_, settings.linear_light, gain, threads);
      frame_flow_.forget();  // its copy has the old exposure
    }
    if (moves)
      find(flow, threads);
    else
      frame_flow_.forget();  // it would miss this frame
    if (moves && settings.exposure_time > 0)
      sharpen(*flow, static_cast<double>(settings.exposure_time) / static_cast<double>(duration),
              threads, settle);
    else
      blurred_last_.reset();
  }

  /// Ends the interval: the next one begins with `now`.
  void advance() {
    is_first_ = false;
    std::swap(last, now);
  }

  /// Makes `now` equal to `last`.
  void hold() {
    is_first_ = false;
    now.assign(last.view());
    frame_flow_.forget();
  }

  Image<Pixel> last;
  Image<Pixel> now;

 private:
  /// Finds the flow between the frames as they were recorded.
  void find(std::optional<ImageView<Flow>>& flow, ThreadPool& threads) {
    if (flow) return frame_flow_.forget();
    const auto& earlier = blurred_last_ ? *blurred_last_ : last;
    const Box changed = changed_box(earlier.view(), now.view(), 0);
    flow = frame_flow_.find(FlowMethod::dis_mq, bits_, earlier, now, changed, threads);
  }

  /// Removes the motion blur of `now` and, if it is the first frame, of `last`.
  template <class Settle>
  void sharpen(const ImageView<Flow>& flow, double exposure, ThreadPool& threads,
               const Settle& settle) {
    const double share = std::min(1.0, exposure);
    if (!deblur_) deblur_.emplace(now.width(), now.height());
    if (is_first_) {
      deblur_->set_motion(flow, share, false, threads);
      deblur_->sharpen(last, bits_, threads);
      settle();
    }
    if (blurred_last_)
      blurred_last_->assign(now.view());
    else
      blurred_last_.emplace(now);
    deblur_->set_motion(flow, share, true, threads);
    deblur_->sharpen(now, bits_, threads);
  }

  int bits_;
  FrameFlow frame_flow_;
  bool is_first_ = true;                      ///< `last` is the first frame
  std::optional<Image<Pixel>> blurred_last_;  ///< `last` as recorded, if it was sharpened
  std::optional<MotionDeblur> deblur_;
};

}  // namespace eventcamera
