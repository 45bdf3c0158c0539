// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/video/video.h>

#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "gst/base/errors.hpp"
#include "gst/drawing/drawn_video.hpp"
#include "gst/simulator/frame_luma.hpp"
#include "src/render/accumulator.hpp"
#include "src/simulate/simulator.hpp"

/// A simulator of the frames in buffers, wherever their pixels are.
class VideoSimulator {
 public:
  virtual ~VideoSimulator() = default;

  /// Takes frames of this format from now on. Size and depth must be the same.
  virtual void set_video(const GstVideoInfo& video) = 0;

  /// Draws pictures of this format from now on.
  virtual void set_drawn_video(const GstVideoInfo& drawn) = 0;

  /// Takes the frame in a buffer, as BasicSimulator::push(), but may return before it has the
  /// events, which are to be read(); the buffer must be kept until then. Up to two frames may wait.
  /// Throws VideoSimulatorError as well.
  virtual void queue(GstBuffer* frame, eventcamera::Nanoseconds time,
                     const eventcamera::Settings& settings) = 0;

  /// As queue(), but draws the events in the buffer `picture` (none for a first frame); read()
  /// returns none.
  virtual void draw(GstBuffer* frame, eventcamera::Nanoseconds time,
                    const eventcamera::Settings& settings, const eventcamera::Palette& palette,
                    GstBuffer* picture) = 0;

  /// Whether read() would return at once.
  virtual bool is_ready() = 0;

  /// Returns the events of the interval that the first frame that waits ends, valid until the next
  /// call; nullptr if it ends none. Throws VideoSimulatorError as well.
  virtual const eventcamera::EventBuckets* read() = 0;

  /// Forgets the frames that wait.
  virtual void drop() = 0;

  virtual eventcamera::IntervalSimulator& simulator() = 0;
};

/// Failure that has a message of its own.
class VideoSimulatorError : public std::runtime_error {
 public:
  VideoSimulatorError(Report report, const std::string& cause)
      : std::runtime_error(cause), report_(std::move(report)) {}

  const Report& report() const { return report_; }

 private:
  Report report_;
};

/// A frame that is not what its caps say.
inline VideoSimulatorError cannot_read(const std::string& fault) {
  return {{GST_RESOURCE_ERROR_FAILED,
           "Cannot read a video frame: " + fault + ". Check the element upstream."},
          fault};
}

/// An output buffer that is not what its caps say.
inline VideoSimulatorError cannot_draw(const std::string& fault) {
  return {{GST_RESOURCE_ERROR_FAILED,
           "Cannot draw into an output buffer: " + fault + ". Check the element downstream."},
          fault};
}

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

  void queue(GstBuffer* frame, eventcamera::Nanoseconds time,
             const eventcamera::Settings& settings) override {
    const VideoFrame mapped(video_, frame, GST_MAP_READ);
    if (!mapped) throw cannot_read(mapped.fault());
    events_ = simulator_->push(luma_.of(mapped, simulator_->threads()), time, settings);
  }

  void draw(GstBuffer* frame, eventcamera::Nanoseconds time, const eventcamera::Settings& settings,
            const eventcamera::Palette& palette, GstBuffer* picture) override {
    queue(frame, time, settings);
    const VideoFrame mapped(drawing_->video, picture, GST_MAP_WRITE);
    if (!mapped) throw cannot_draw(mapped.fault());
    if (const auto* events = std::exchange(events_, nullptr))
      drawing_->accumulator.add(*events, simulator_->threads());
    drawing_->accumulator.draw(palette, pixel_layout_of(drawing_->video), mapped.data(),
                               mapped.stride(), simulator_->threads());
  }

  bool is_ready() override { return true; }
  const eventcamera::EventBuckets* read() override { return events_; }
  void drop() override {}

  eventcamera::IntervalSimulator& simulator() override { return *simulator_; }

 private:
  struct Drawing {
    GstVideoInfo video;
    eventcamera::Accumulator accumulator;
  };

  GstVideoInfo video_;
  FrameLuma luma_;
  std::optional<Drawing> drawing_;
  std::unique_ptr<eventcamera::Simulator> simulator_;
  const eventcamera::EventBuckets* events_ = nullptr;
};

/// For EventSimulatorMethod::create: a simulator made by `make` from the format of the luma.
template <auto make>
std::unique_ptr<VideoSimulator> in_system_memory(GObject*, const GstVideoInfo& video) {
  return std::make_unique<LumaVideoSimulator>(video, make(FrameLuma::format_of(video)));
}
