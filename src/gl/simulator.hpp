// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "src/gl/event_list.hpp"
#include "src/gl/grey_frame.hpp"
#include "src/gl/picture.hpp"
#include "src/simulate/simulator.hpp"

namespace eventcamera::gl {

/// Simulator of 8-bit frames in textures. It is made, used and destroyed while its context is
/// current; hold_until() and reset() need none. push() and draw() throw Error as well.
///
/// Reading events back need not make the caller, or the GPU, wait: queue() the next frame, then
/// read() the events of the interval before.
class Simulator : public BasicSimulator<TextureFrame> {
 public:
  static constexpr int max_queued = 2;  ///< intervals

  /// As push(), but only queues the work. Returns whether the frame ends an interval, whose events
  /// are to be read(). The contents of the texture may not change until then.
  bool queue(const TextureFrame& frame, Nanoseconds time, const Settings& settings);

  /// Whether the GPU is done with the first of the queued intervals.
  bool is_ready() const { return lists_[first_].is_sorted(); }

  /// Waits until the GPU is done with the first of the queued intervals. Returns its events, valid
  /// until the next call.
  const EventBuckets& read();

  /// Forgets the queued intervals.
  void drop() { queued_ = 0; }

  /// As push(), but draws the events in a texture (none for the first frame), and reads nothing
  /// back. Does not wait for the GPU.
  void draw(const TextureFrame& frame, Nanoseconds time, const Settings& settings,
            const Picture& picture);

 protected:
  Simulator(const Context& gl, const LumaFormat& format)
      : BasicSimulator(format),
        gl_(gl),
        kernels_(gl),
        lists_{{gl, format, kernels_}, {gl, format, kernels_}},
        draw_(gl, format) {}

  /// Queues the marks of the pixels that fire between the last frame and this one, in `list`, and
  /// stores this one.
  virtual void mark(const TextureFrame& frame, const StepTimes& steps, const Settings& settings,
                    EventList& list) = 0;

 private:
  void simulate(const TextureFrame& frame, const StepTimes& steps, const Settings& settings,
                EventBuckets& events) final;

  /// Queues all work on a frame but the sorting. Returns whether it ends an interval.
  bool take(const TextureFrame& frame, Nanoseconds time, const Settings& settings, EventList& list);

  const Context& gl_;
  EventListKernels kernels_;
  EventList lists_[max_queued];
  int first_ = 0;   ///< of the lists that are queued
  int queued_ = 0;  ///< their number
  DrawKernel draw_;
};

}  // namespace eventcamera::gl
