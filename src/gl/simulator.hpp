// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <optional>

#include "src/dvs/dvs_settings.hpp"
#include "src/flow/dense_flow.hpp"
#include "src/gl/event_list.hpp"
#include "src/gl/kernels.hpp"
#include "src/gl/objects.hpp"
#include "src/simulate/simulator.hpp"
#include "src/simulate/warp.hpp"

namespace eventcamera::gl {

/// Simulator of 8-bit frames in textures. Must be made, used and destroyed while its context is
/// current, except hold_until(), reset(), wait() and drop(). All other functions throw Error and
/// std::bad_alloc; after that the simulator may only be destroyed.
///
/// A LumaKernel turns the texture of a frame into a GreyFrame. A simulator (dense_simulator.cpp,
/// sparse_simulator.cpp, difference_simulators.cpp) compares it with the last one and marks the
/// pixels that fire in each step. An EventList sorts and reads back the marked pixels, or a
/// DrawKernel draws them. dvs_simulator.cpp writes events with individual times, which EventSort
/// sorts. Each kernel is a compute shader (shaders/). farneback computes dense flow, point_tracker
/// tracks, with the formulas and limits of their namesakes in src/flow.
///
/// To keep both the caller and the GPU busy, queue() the next frame before read() of the previous
/// interval's events.
class Simulator : public IntervalSimulator {
 public:
  static constexpr int max_queued = 2;  ///< maximum number of queued frames

  /// Sets the motion from the last frame to the next one, if it is known; a view of an Image that
  /// must last until that frame is queued. Most simulators ignore it.
  virtual void set_flow(const std::optional<ImageView<Flow>>&) {}

  /// Queues the work on the next frame, whose `format` must be the simulator's. The texture must
  /// not change until the events have been read(). `time` must be later than the last
  /// frame, by at most max_interval.
  void queue(const TextureFrame& frame, Nanoseconds time, const Settings& settings);

  /// Like queue(), but draws the events in a texture (none for the first frame); read() returns
  /// none.
  void draw(const TextureFrame& frame, Nanoseconds time, const Settings& settings,
            const Picture& picture);

  /// Waits until the GPU has finished the first queued frame, if that is possible without a context
  /// (EGL). Any thread may call it, so that read() does not have to wait.
  void wait() const { queue_[first_].done.wait_without_context(); }

  /// Waits until the GPU has finished the first queued frame. Returns the sorted events of the
  /// interval that it ends, valid until the next call; nullptr if it ends none.
  const EventBuckets* read();

  void drop() { queued_ = 0; }

 protected:
  Simulator(const Context& gl, const LumaFormat& format)
      : IntervalSimulator(format),
        luma_(gl),
        gl_(gl),
        kernels_(gl),
        queue_{{{gl, format, kernels_}, Fence(gl)}, {{gl, format, kernels_}, Fence(gl)}},
        draw_(gl, format) {}

  virtual void start(const TextureFrame& frame) = 0;
  /// Queues the marks of the pixels that fire between the last frame and this one, in `list`, and
  /// stores this one. If `list` has no steps, events() reads the events.
  virtual void mark(const TextureFrame& frame, const StepTimes& steps, const Settings& settings,
                    EventList& list) = 0;
  /// Marks the events of an interval in `list`, to be drawn, unless mark() did.
  virtual void mark_events(const StepTimes&, const Settings&, EventList&) {}

  LumaKernel luma_;

 private:
  struct Queued {
    EventList list;
    Fence done;
    bool is_sorted = false;  ///< to be read
    Nanoseconds duration = 0;
    Settings settings = {};
  };

  /// Queues all work on a frame except sorting. Returns the steps of the interval that the frame
  /// ends, if any.
  std::optional<StepTimes> process(const TextureFrame& frame, Nanoseconds time,
                                   const Settings& settings, EventList& list);

  Queued& next();

  const Context& gl_;
  EventListKernels kernels_;
  Queued queue_[max_queued];
  int first_ = 0;   ///< index of the first queued frame
  int queued_ = 0;  ///< number of queued frames
  DrawKernel draw_;
};

/// Like eventcamera::make_frame_simulator(); the same luma gives the same events.
std::unique_ptr<Simulator> make_frame_simulator(const Context& gl, const LumaFormat& format);

/// Like eventcamera::DenseSimulator, with Farneback's flow; the same flow gives the same events.
/// Flow is always computed for the whole frame. If the CPU computes it only around changed pixels,
/// pyramid and borders differ; otherwise the last bits of floating-point numbers may differ.
class DenseSimulator : public Simulator {
 public:
  void set_interpolation(Interpolation interpolation) { interpolation_ = interpolation; }

 protected:
  using Simulator::Simulator;
  Interpolation interpolation_ = Interpolation::forward;
};

std::unique_ptr<DenseSimulator> make_dense_simulator(const Context& gl, const LumaFormat& format);

/// Like eventcamera::make_sparse_simulator(). The same tracks give the same events; tracks may
/// differ in the last bits of floating-point numbers.
std::unique_ptr<Simulator> make_sparse_simulator(const Context& gl, const LumaFormat& format);

/// Like eventcamera::make_diff_simulator(). The same tracks give the same events; tracks may differ
/// in the last bits of floating-point numbers.
std::unique_ptr<Simulator> make_diff_simulator(const Context& gl, const LumaFormat& format);

/// Like eventcamera::DvsSimulator, without labels and in single precision: 1 of 10,000 pixels may
/// fire other events, and the times of 1 of 1,000 events may differ by more than a microsecond. The
/// CPU removes noise, computes gain and flow, and delays late events. hold_until() needs the
/// context.
class DvsSimulator : public Simulator {
 public:
  void set(const DvsSettings& settings) { settings_ = settings; }
  void set_flow(const std::optional<ImageView<Flow>>& flow) override { known_flow_ = flow; }

 protected:
  using Simulator::Simulator;
  DvsSettings settings_;
  std::optional<ImageView<Flow>> known_flow_;  ///< of the next interval
};

std::unique_ptr<DvsSimulator> make_dvs_simulator(const Context& gl, const LumaFormat& format);

}  // namespace eventcamera::gl
