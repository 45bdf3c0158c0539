// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/gl/simulator.hpp"

#include <algorithm>
#include <cstddef>

#include "src/gl/point_tracker.hpp"
#include "src/gl/shaders.hpp"

namespace eventcamera::gl {
namespace {

class FrameSimulator final : public Simulator {
 public:
  FrameSimulator(const Context& gl, const LumaFormat& format)
      : Simulator(gl, format), difference_(gl, format), frames_{{gl, format}, {gl, format}} {}

 private:
  void start(const TextureFrame& frame) override { luma_.run(frame, frames_[last_]); }

  void mark(const TextureFrame& frame, const StepTimes& steps, const Settings& settings,
            EventList& list) override {
    const auto& before = frames_[last_];
    last_ = 1 - last_;
    luma_.run(frame, frames_[last_]);
    list.begin(steps, steps.count());
    difference_.run(before, frames_[last_], Thresholds::of(settings, format().bits), 1, list);
  }

  DifferenceKernel difference_;
  GreyFrame frames_[2];
  int last_ = 0;
};

/// One polarity of the last two difference frames.
struct Part {
  Part(const Context& gl, const LumaFormat& format)
      : pictures{{gl, format}, {gl, format}}, motions(gl) {
    motions.reserve(pixel_count(format) * 8);
  }

  Pyramid pictures[2];  ///< 0 for pixels that did not fire
  Buffer motions;       ///< of the pixels of the earlier difference frame
};

class DiffSimulator final : public Simulator {
 public:
  DiffSimulator(const Context& gl, const LumaFormat& format)
      : Simulator(gl, format),
        difference_(gl, format),
        split_(gl, "split", shaders::split),
        move_(gl, "move_differences", shaders::move_differences),
        mark_(gl, "mark", shaders::mark),
        tracker_(gl, format, 1),
        strongest_(gl),
        frames_{{gl, format}, {gl, format}},
        on_(gl, format),
        off_(gl, format) {}

 private:
  void start(const TextureFrame& frame) override {
    luma_.run(frame, frames_[last_]);
    has_difference_ = false;
  }

  void mark(const TextureFrame& frame, const StepTimes& steps, const Settings& settings,
            EventList& list) override {
    const auto thresholds = Thresholds::of(settings, format().bits);
    const int before = last_;
    last_ = 1 - last_;
    luma_.run(frame, frames_[last_]);
    const int words = GreyFrame::words_across(format().width);
    split_.run({groups_of(64, words), format().height},
               {&frames_[before].buffer(), &frames_[last_].buffer(),
                &on_.pictures[last_].picture().buffer(), &off_.pictures[last_].picture().buffer()},
               {words, thresholds.positive, thresholds.negative});
    for (const auto* part : {&on_, &off_}) tracker_.build(part->pictures[last_]);

    const bool interpolates = has_difference_ && steps.count() > 1;
    const int first = interpolates ? 1 : steps.count();
    list.begin(steps, first);
    if (interpolates) fire_between(steps.count(), list);
    difference_.run(frames_[before], frames_[last_], thresholds, list.steps(), list);
    has_difference_ = true;
  }

  void fire_between(int steps, const EventList& list) {
    const auto [width, height, bits] = format();
    const Groups groups{groups_of(64, width), height};
    const int before = 1 - last_;
    for (const auto* part : {&on_, &off_}) {
      tracker_.find_points(part->pictures[before], part->motions);
      tracker_.track(part->pictures[before], part->pictures[last_], part->motions);
      tracker_.to_motion(part->motions, steps, part->pictures[last_].picture(), true);
    }
    const int at_once = steps_at_once(format(), steps - 1);
    strongest_.reserve_zeros(static_cast<std::size_t>(at_once) * pixel_count(format()) * 4);
    for (int first = 1; first < steps; first += at_once) {
      const int count = std::min(at_once, steps - first);
      for (const auto* part : {&on_, &off_})
        move_.run(groups, {&part->pictures[before].picture().buffer(), &part->motions, &strongest_},
                  {width, first, count, part == &on_ ? 1 : 0});
      mark_.run({groups_of(64, list.marks_across()), height, count}, {&strongest_, &list.marks()},
                {width, list.marks_across(), (first - 1) * list.marks_a_step()});
    }
  }

  DifferenceKernel difference_;
  Kernel split_;
  Kernel move_;
  Kernel mark_;
  PointTracker tracker_;
  Buffer strongest_;  ///< largest difference on each pixel of interpolated frames
  GreyFrame frames_[2];
  Part on_;
  Part off_;
  int last_ = 0;  ///< index of the last of the two frames, and of the pictures of the parts
  bool has_difference_ = false;
};

}  // namespace

std::unique_ptr<Simulator> make_frame_simulator(const Context& gl, const LumaFormat& format) {
  return std::make_unique<FrameSimulator>(gl, format);
}

std::unique_ptr<Simulator> make_diff_simulator(const Context& gl, const LumaFormat& format) {
  return std::make_unique<DiffSimulator>(gl, format);
}

}  // namespace eventcamera::gl
