// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/gl/simulator.hpp"

#include <algorithm>
#include <cstddef>

#include "src/gl/point_tracker.hpp"
#include "src/gl/shaders.hpp"

namespace eventcamera::gl {
namespace {

class SparseSimulator final : public Simulator {
 public:
  SparseSimulator(const Context& gl, const LumaFormat& format)
      : Simulator(gl, format),
        difference_(gl, format),
        changed_(gl, "changed", shaders::changed),
        move_(gl, "move_points", shaders::move_points),
        paint_(gl, "paint", shaders::paint),
        tracker_(gl, format, 2),
        points_(gl),
        winners_(gl),
        between_(gl),
        frames_{{gl, format}, {gl, format}} {
    points_.reserve(pixel_count(format) * 8);
  }

 private:
  void start(const TextureFrame& frame) override { store(frame); }

  void mark(const TextureFrame& frame, const StepTimes& steps, const Settings& settings,
            EventList& list) override {
    const auto thresholds = Thresholds::of(settings, format().bits);
    const auto& last = frames_[now_];
    store(frame);
    const auto& now = frames_[now_];
    const int width = format().width;
    const Groups groups{groups_of(64, width), format().height};
    changed_.run(groups, {&last.picture().buffer(), &now.picture().buffer(), &points_},
                 {width, std::min(thresholds.positive, thresholds.negative)});
    tracker_.track(last, now, points_);
    tracker_.to_motion(points_, steps.count(), now.picture(), false);

    list.begin(steps);
    // Frames of the steps 0 ... count.
    const int ring_size = std::max(2, steps_at_once(format(), steps.count() + 1));
    winners_.reserve_zeros(static_cast<std::size_t>(ring_size) * pixel_count(format()) * 4);
    between_.reserve(static_cast<std::size_t>(ring_size) * last.picture().buffer().size());
    for (int first = 0; first <= steps.count();) {
      const int end = std::min(std::max(first - 1, 0) + ring_size, steps.count() + 1);
      move_.run(groups, {&points_, &winners_}, {width, first, end - first});
      paint_.run({groups_of(64, GreyFrame::words_across(width)), format().height, end - first},
                 {&last.picture().buffer(), &now.picture().buffer(), &winners_, &between_},
                 {width, first, steps.count(), ring_size});
      difference_.run(between_, ring_size, thresholds, std::max(first, 1), end, list);
      first = end;
    }
  }

  void store(const TextureFrame& frame) {
    now_ = 1 - now_;
    luma_.run(frame, frames_[now_].picture());
    tracker_.build(frames_[now_]);
  }

  DifferenceKernel difference_;
  Kernel changed_;
  Kernel move_;
  Kernel paint_;
  PointTracker tracker_;
  Buffer points_;
  Buffer winners_;  ///< last point on each pixel of interpolated frames
  Buffer between_;  ///< ring of interpolated frames
  Pyramid frames_[2];
  int now_ = 0;
};

}  // namespace

std::unique_ptr<Simulator> make_sparse_simulator(const Context& gl, const LumaFormat& format) {
  return std::make_unique<SparseSimulator>(gl, format);
}

}  // namespace eventcamera::gl
