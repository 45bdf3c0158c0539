// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/video/video.h>

#include <optional>

#include "gst/base/owned.hpp"
#include "src/core/event.hpp"

/// Finds the frames that upstream repeats to raise the framerate, as videorate, imagefreeze and
/// webcams do. Such a frame does not show the scene at its time.
class RepeatedFrames {
 public:
  using Nanoseconds = eventcamera::Nanoseconds;

  enum class Kind {
    changed,   ///< another picture
    repeated,  ///< the last picture again
    still,     ///< the last picture, because the scene is still
  };

  /// Compares a frame with the last one. It repeats that if it is flagged GAP or has the same
  /// memory. With `compare`, so does a frame with equal pixels, unless the last frame was a
  /// repetition, too. A picture older than a second is a still scene.
  Kind kind_of(GstBuffer* frame, Nanoseconds time, bool compare, const GstVideoInfo& video) const;

  /// Adds the next frame. With `compare`, the one after it will be compared by its pixels.
  void add(GstBuffer* frame, Nanoseconds time, bool compare, Kind kind);

  std::optional<Nanoseconds> last_time() const;

  /// Forgets the last frame; the next one shows another picture.
  void reset() { last_.reset(); }

 private:
  struct Last {
    OwnedBuffer buffer;   ///< null if neither its memory nor its pixels can appear again
    Nanoseconds time;     ///< of the last frame with this picture
    Nanoseconds changed;  ///< of the first frame with this picture
    bool is_repetition;   ///< there were several
  };

  std::optional<Last> last_;
};
