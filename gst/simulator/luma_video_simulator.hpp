// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <optional>
#include <utility>

#include "gst/drawing/drawn_video.hpp"
#include "gst/simulator/frame_luma.hpp"
#include "gst/simulator/video_simulator.hpp"
#include "src/render/accumulator.hpp"

/// Simulator of frames in system memory.
class LumaVideoSimulator final : public VideoSimulator {
 public:
  LumaVideoSimulator(const GstVideoInfo& video, std::unique_ptr<eventcamera::Simulator> simulator)
      : video_(video), luma_(video), simulator_(std::move(simulator)) {}

  void set_video(const GstVideoInfo& video) override {
    video_ = video;
    luma_ = FrameLuma(video);
  }

  void set_drawn_video(const GstVideoInfo& drawn) override {
    drawing_ = Drawing{drawn, {GST_VIDEO_INFO_WIDTH(&drawn), GST_VIDEO_INFO_HEIGHT(&drawn)}};
  }

  std::optional<Interval> push(Interval interval, const eventcamera::Settings& settings,
                               const KnownFlow& flow) override {
    interval.events = simulate(interval.frame.get(), interval.end, settings, flow);
    if (interval.events == nullptr) return std::nullopt;  // after a first frame
    return interval;
  }

  void draw(OwnedBuffer frame, eventcamera::Nanoseconds time, const eventcamera::Settings& settings,
            const KnownFlow& flow, const eventcamera::Palette& palette,
            GstBuffer* picture) override {
    const auto* events = simulate(frame.get(), time, settings, flow);
    const VideoFrame mapped(drawing_->video, picture, GST_MAP_WRITE);
    if (!mapped) throw VideoSimulatorError(cannot_draw(mapped.fault()), mapped.fault());
    if (events != nullptr) drawing_->accumulator.add(*events, simulator_->threads());
    drawing_->accumulator.draw(palette, pixel_layout_of(drawing_->video), mapped.data(),
                               mapped.stride(), simulator_->threads());
  }

  eventcamera::IntervalSimulator& simulator() override { return *simulator_; }

 private:
  struct Drawing {
    GstVideoInfo video;
    eventcamera::Accumulator accumulator;
  };

  const eventcamera::EventBuckets* simulate(GstBuffer* frame, eventcamera::Nanoseconds time,
                                            const eventcamera::Settings& settings,
                                            const KnownFlow& flow) {
    const VideoFrame mapped(video_, frame, GST_MAP_READ);
    if (!mapped) throw VideoSimulatorError(cannot_read(mapped.fault()), mapped.fault());
    return simulator_->push(luma_.of(mapped, simulator_->threads()), time, settings, flow);
  }

  GstVideoInfo video_;
  FrameLuma luma_;
  std::optional<Drawing> drawing_;
  std::unique_ptr<eventcamera::Simulator> simulator_;
};

/// For EventSimulatorMethod::create: a simulator made by `make` from the format of the luma.
template <auto make>
std::unique_ptr<VideoSimulator> in_system_memory(GObject*, const GstVideoInfo& video) {
  return std::make_unique<LumaVideoSimulator>(video, make(FrameLuma::format_of(video)));
}
