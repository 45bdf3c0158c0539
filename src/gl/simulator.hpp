// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "src/gl/event_list.hpp"
#include "src/gl/grey_frame.hpp"
#include "src/gl/picture.hpp"
#include "src/simulate/simulator.hpp"

namespace eventcamera::gl {

/// Simulator of 8-bit frames in textures. It is made, used and destroyed while its context is
/// current; hold_until() and reset() need none. push() and draw() throw Error as well.
class Simulator : public BasicSimulator<TextureFrame> {
 public:
  /// As push(), but draws the events in a texture (none for the first frame), and reads nothing
  /// back. Does not wait for the GPU.
  void draw(const TextureFrame& frame, Nanoseconds time, const Settings& settings,
            const Picture& picture);

 protected:
  Simulator(const Context& gl, const LumaFormat& format)
      : BasicSimulator(format), gl_(gl), list_(gl, format), draw_(gl, format) {}

  /// Queues the marks of the pixels that fire between the last frame and this one, in `list`, and
  /// stores this one.
  virtual void mark(const TextureFrame& frame, const StepTimes& steps, const Settings& settings,
                    EventList& list) = 0;

 private:
  void simulate(const TextureFrame& frame, const StepTimes& steps, const Settings& settings,
                EventBuckets& events) final;

  const Context& gl_;
  EventList list_;
  DrawKernel draw_;
  bool draws_ = false;  ///< the frame that is being pushed
};

}  // namespace eventcamera::gl
