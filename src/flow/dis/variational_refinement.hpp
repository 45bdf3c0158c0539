// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <vector>

#include "src/core/image.hpp"
#include "src/core/thread_pool.hpp"
#include "src/flow/dense_flow.hpp"
#include "src/flow/dis/split_plane.hpp"

namespace eventcamera {

/// Refines a flow by minimising an energy (Brox et al., ECCV 2004): brightness and gradients stay
/// constant along the flow, and the flow is smooth, all with robust penalties. The images are
/// linearised once, at the given flow. Five times, the penalties are evaluated at the refined flow,
/// and five rounds of red-black successive over-relaxation solve the resulting linear equations.
///
/// Threads compute bands of rows and, for each evaluation, the rows around them that affect them.
class VariationalRefinement {
 public:
  /// Components of a flow field.
  struct Field {
    Field(int width, int height) : x(width, height), y(width, height) {}
    SplitPlane x;
    SplitPlane y;
  };

  /// Derivatives of the images: along x and y, over two pixels, of their mean, and from the earlier
  /// to the later one.
  struct Derivatives {
    Derivatives(int width, int height) : x(width, height), y(width, height), t(width, height) {}
    SplitPlane x;
    SplitPlane y;
    SplitPlane t;
  };

  /// Equations of a pixel: relaxation adds inverse_x (constant_x - cross y + smoothness terms) to a
  /// multiple of its flow in x, and likewise in y.
  enum { cross, inverse_x, inverse_y, constant_x, constant_y, max_coefficients };

  /// Rows that a thread is working on; row y is at y % rows.
  struct Scratch {
    static constexpr int rows = 16;

    explicit Scratch(int width)
        : flow(width, rows),
          weight(width, rows),
          right(width, 2),
          equations(width, rows),
          mean(width, rows),
          change(width, rows) {}

    Field flow;
    SplitPlane weight;  ///< smoothness weight between a pixel and its right and lower neighbours
    SplitPlane right;   ///< the same for the last two rows, but 0 for their last pixels
    SplitPlanes<max_coefficients> equations;

    // Of the images.
    SplitPlane mean;
    SplitPlane change;
  };

  VariationalRefinement(int width, int height);

  int width() const { return flows_[0].x.width(); }
  int height() const { return flows_[0].x.height(); }
  /// The flow to refine.
  Field& start() { return start_; }
  void run(const Image<std::uint8_t>& from, const Image<std::uint8_t>& to, ThreadPool& threads);
  /// The refined flow at a pixel.
  Flow at(int x, int y) const { return {flows_[0].x.at(x, y), flows_[0].y.at(x, y)}; }
  /// The refined flow of a row. Up to 32 elements past the end of `out` are written.
  void row(int y, Flow* out) const;

 private:
  Field start_;
  std::array<Field, 2> flows_;  ///< the current one, the next one
  Derivatives derivatives_;
  std::vector<Scratch> scratch_;
};

}  // namespace eventcamera
