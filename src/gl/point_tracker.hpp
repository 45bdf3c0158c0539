// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <list>

#include "src/gl/grey_frame.hpp"

namespace eventcamera::gl {

/// Gaussian pyramid of a picture.
class Pyramid {
 public:
  struct Level {
    Level(const Context& gl, int width, int height)
        : format{width, height, 8}, picture(gl, format) {}

    LumaFormat format;
    GreyFrame picture;
  };

  Pyramid(const Context& gl, const LumaFormat& format);

  /// Level 0, to be written before build().
  const GreyFrame& picture() const { return levels_.front().picture; }
  const std::list<Level>& levels() const { return levels_; }

 private:
  std::list<Level> levels_;
};

/// Pyramidal Lucas-Kanade, as eventcamera::PointTracker.
///
/// Points are the pixels of a buffer of two words each: none in the first if the pixel is no point;
/// else its flow, two floats, or its motion in a step, two integers.
class PointTracker {
 public:
  PointTracker(const Context& gl, const LumaFormat& format);

  /// Computes the levels above 0.
  void build(const Pyramid& pyramid) const;

  /// Makes points of the pixels of level 0 that are not 0.
  void find_points(const Pyramid& pyramid, const Buffer& points) const;

  /// Tracks points, which have no flow, from one picture to the next. Lost ones become none.
  void track(const Pyramid& from, const Pyramid& to, const Buffer& points) const;

  /// Replaces flow by motion. Points that leave the frame become none, and, if they `must_arrive`,
  /// those that end more than a pixel away from all pixels of `frame` that are not 0.
  void to_motion(const Buffer& points, int steps, const GreyFrame& frame, bool must_arrive) const;

 private:
  LumaFormat format_;
  Kernel halve_;
  Kernel slope_;
  Kernel points_;
  Kernel search_;
  Kernel motion_;
  Buffer slopes_;
};

}  // namespace eventcamera::gl
