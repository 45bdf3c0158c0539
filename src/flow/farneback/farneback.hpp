// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <vector>

#include "src/flow/dense_flow.hpp"
#include "src/flow/farneback/flow_update.hpp"
#include "src/flow/farneback/polynomial_expansion.hpp"
#include "src/flow/resampling.hpp"

namespace eventcamera {

/// Farneback's method (SCIA 2003), coarse to fine; the flow between equal images is 0.
class FarnebackFlow final : public DenseFlow {
 public:
  /// Iterations on each level, finest first. Coarse levels find most of the motion, and iterations
  /// are cheap there.
  static constexpr std::array iterations{2, 3, 4, 5};

  /// Number of pyramid levels of images of this size, each half as large as the one before.
  static int level_count(int width, int height);

  void push(const ImageView<std::uint8_t>& image, ThreadPool& threads) override;
  ImageView<Flow> flow(ThreadPool& threads) override;

 private:
  struct Level {
    Level(int width, int height, int level);

    int iterations;
    PyramidLevel pyramid;
    PolynomialExpansion last;
    PolynomialExpansion next;
    FlowUpdate update;
    Image<Flow> flow;
    Resampling columns;  ///< from the coarser level
    Resampling rows;
  };

  /// Memory of one thread.
  struct Scratch {
    PyramidLevel::Scratch pyramid;
    std::array<std::vector<float>, 2 * PolynomialExpansion::reach + 1> rows;
    PolynomialExpansion::Scratch expansion;
    std::vector<Flow> coarser_row;
    std::array<std::vector<Flow>, iterations.back()> flows;  ///< before each iteration
    std::array<FlowUpdate::Scratch, iterations.back()> updates;
  };

  void start(int width, int height);
  static void expand(const ImageView<std::uint8_t>& image, Level& level, int band,
                     Scratch& scratch);
  static void start_row(const Level* coarser, const Level& level, int y, int first, int last,
                        Scratch& scratch, Flow* out);
  static void find_columns(const Level* coarser, Level& level, int first, int last,
                           Scratch& scratch);

  int width_ = 0;
  int height_ = 0;
  std::vector<Level> levels_;  ///< finest first
  std::vector<Scratch> scratch_;
};

}  // namespace eventcamera
