// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/gl/simulator.hpp"

#include <algorithm>

#include "src/gl/mark_kernels.hpp"
#include "src/gl/point_tracker.hpp"
#include "src/gl/shaders.hpp"

namespace eventcamera::gl {
namespace {

class SparseSimulator final : public Simulator {
 public:
  SparseSimulator(const Context& gl, const LumaFormat& format)
      : Simulator(gl, format),
        luma_(gl),
        difference_(gl, format),
        changed_(gl, "changed", shaders::changed),
        reach_(gl, "reach", shaders::reach),
        paint_(gl, "paint", shaders::paint),
        tracker_(gl, format, 2),
        points_(gl),
        winners_(gl),
        frames_{{gl, format}, {gl, format}},
        between_{{gl, format}, {gl, format}} {
    points_.reserve(pixel_count(format) * 8);
    winners_.assign_zeros(pixel_count(format) * 4);
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
    const GreyFrame* before = &last.picture();
    for (int j = 1; j <= steps.count(); ++j) {
      const bool ends = j == steps.count();
      if (!ends) paint(last.picture(), now.picture(), j);
      const GreyFrame& drawn = ends ? now.picture() : between_[j % 2];
      difference_.run(*before, drawn, thresholds, j, list);
      before = &drawn;
    }
  }

  void store(const TextureFrame& frame) {
    now_ = 1 - now_;
    luma_.run(frame, frames_[now_].picture());
    tracker_.build(frames_[now_]);
  }

  /// Draws the interpolated frame of step j.
  void paint(const GreyFrame& last, const GreyFrame& now, int j) const {
    const int width = format().width;
    for (const int marks_left : {0, 1})
      reach_.run({groups_of(64, width), format().height}, {&points_, &winners_},
                 {width, j, marks_left});
    paint_.run({groups_of(64, GreyFrame::words_across(width)), format().height},
               {&last.buffer(), &now.buffer(), &winners_, &between_[j % 2].buffer()}, {width});
  }

  LumaKernel luma_;
  DifferenceKernel difference_;
  Kernel changed_;
  Kernel reach_;
  Kernel paint_;
  PointTracker tracker_;
  Buffer points_;
  Buffer winners_;  ///< last point on each pixel of an interpolated frame
  Pyramid frames_[2];
  GreyFrame between_[2];  ///< interpolated frames
  int now_ = 0;
};

}  // namespace

std::unique_ptr<Simulator> make_sparse_simulator(const Context& gl, const LumaFormat& format) {
  return std::make_unique<SparseSimulator>(gl, format);
}

}  // namespace eventcamera::gl
