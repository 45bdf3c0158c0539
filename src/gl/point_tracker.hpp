// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <list>

#include "src/gl/objects.hpp"

namespace eventcamera::gl {

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

/// Pyramidal Lucas-Kanade, like eventcamera::PointTracker.
///
/// Points are stored in a buffer of two words per pixel: the flow, two floats, or the motion per
/// step, two integers; the first word is `none` if the pixel is not a point.
class PointTracker {
 public:
  PointTracker(const Context& gl, const LumaFormat& format, int block_side);

  /// Computes the levels above 0.
  void build(const Pyramid& pyramid) const;

  /// Makes each pixel of level 0 that is not 0 a point.
  void find_points(const Pyramid& pyramid, const Buffer& points) const;

  /// Tracks points, whose flow is 0, from one picture to the next. Lost points are removed.
  void track(const Pyramid& from, const Pyramid& to, const Buffer& points) const;

  /// Replaces flow by motion. Removes points that leave the frame and, if they `must_arrive`, those
  /// that end more than a pixel away from all pixels of `frame` that are not 0.
  void to_motion(const Buffer& points, int steps, const GreyFrame& frame, bool must_arrive) const;

 private:
  LumaFormat format_;
  int block_side_;
  Kernel halve_;
  Kernel slope_;
  Kernel points_;
  Kernel gather_;
  Kernel descend_;
  Kernel list_;
  Kernel search_;
  Kernel spread_;
  Kernel motion_;
  /// Gradients of a level, then the number and the places of its blocks, in one buffer, because
  /// OpenGL ES guarantees only four to a shader.
  Buffer slopes_;
  std::list<Buffer> blocks_;  ///< stored like points, by level; not where blocks are points
};

}  // namespace eventcamera::gl
