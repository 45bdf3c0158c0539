// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <vector>

#include "src/flow/dense_flow.hpp"
#include "src/flow/dis/patches.hpp"
#include "src/flow/dis/pyramid.hpp"
#include "src/flow/dis/variational_refinement.hpp"
#include "src/flow/resampling.hpp"

namespace eventcamera {

/// Dense inverse search (Kroeger et al., ECCV 2016), coarse to fine: searches for patches, averages
/// their flows in the pixels that they cover, and refines the result with a variational method.
class DisFlow final : public DenseFlow {
 public:
  struct Quality {
    int patch;   ///< side, 4 or 8 pixels
    int stride;  ///< patch * (1 - overlap), rounded down
    int iterations;
    int scales;        ///< minimum number of pyramid levels
    int max_finest;    ///< limit of finest_scale()
    int propagations;  ///< rounds of spatial propagation

    /// Number of times an image is halved for the coarsest level. The largest displacement to be
    /// found, a quarter of the longer side, shrinks to about one patch there; the shorter side
    /// stays at least one patch.
    int coarsest_scale(int width, int height) const;
    /// Number of times an image is halved for the finest level.
    int finest_scale(int width, int height) const;
  };
  static constexpr Quality low = {4, 3, 8, 3, 31, 0};
  static constexpr Quality medium = {4, 3, 8, 4, 3, 2};
  static constexpr Quality high = {8, 4, 32, 1, 1, 0};

  /// Smaller images are padded to this width and height by replicating their border.
  static constexpr int min_side = 64;

  explicit DisFlow(const Quality& quality) : quality_(quality) {}

  void push(const ImageView<std::uint8_t>& image, ThreadPool& threads) override;
  ImageView<Flow> flow(ThreadPool& threads) override;

 private:
  struct Level {
    Level(const AreaShrink& shrink_, const Quality& quality);

    AreaShrink shrink;  ///< from the next finer level, or from the whole image
    PyramidImage last;
    PyramidImage next;
    Gradients gradients;  ///< of `last`
    PatchGrid grid;
    Image<Flow> flows;  ///< of patches
    Image<Flow> found;  ///< before a round of propagation
    VariationalRefinement refinement;
  };

  /// Memory of one thread.
  struct Scratch {
    std::vector<float> sums;
    std::vector<std::int16_t> slopes;
    std::vector<Flow> row;
    std::array<std::vector<Flow>, 2> upsampled_rows;
  };

  void start(int width, int height);
  template <class Body>
  void for_each_band(int height, ThreadPool& threads, const Body& body);
  ImageView<std::uint8_t> padded(const ImageView<std::uint8_t>& image);
  void search(const Level* coarser, Level& level, int row) const;
  void upsample(int first, int last, Scratch& scratch);

  Quality quality_;
  int width_ = 0;
  int height_ = 0;
  int finest_scale_ = 0;  ///< the finest level has 1 / 2^finest_scale_ of the size
  Image<std::uint8_t> padded_;
  std::vector<Level> levels_;  ///< finest first
  Resampling columns_;         ///< from the finest level to the whole image
  Resampling rows_;
  Image<Flow> flow_;
  std::vector<Scratch> scratch_;
};

}  // namespace eventcamera
