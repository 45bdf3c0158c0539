// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "src/core/image.hpp"
#include "src/core/luma.hpp"
#include "src/core/thread_pool.hpp"

namespace eventcamera {

/// Settings::denoise: smooth as much as the noise of the frames needs.
constexpr double automatic_denoise = -1;

/// Standard deviation of the noise of a frame camera, in grey levels (white is 255). Each pair of
/// frames gives an estimate from the differences within blocks of 8x8 pixels, without their mean,
/// which is a change of light. The estimate is the first quintile of the blocks, because many may
/// show motion. Blocks near black or white, and repeated frames, are ignored.
class NoiseLevel {
 public:
  void restart() { *this = {}; }

  void update(const LumaView& frame);

  /// Median of the last estimates; 0 before the first.
  double sigma() const;

 private:
  template <class Pixel>
  void update(const ImageView<Pixel>& frame, double white);

  std::vector<std::uint16_t> last_;  ///< blocks of the previous frame
  std::vector<float> variances_;     ///< of the differences in blocks that count
  std::array<double, 5> estimates_{};
  std::size_t count_ = 0;  ///< of all estimates
};

/// Removes noise but keeps edges: adds to each pixel the weighted mean of the differences to its
/// 3x3 neighbourhood (weights 1 2 1 by 1 2 1, sum 16), each clamped to `limit` luma values. The
/// border is replicated. `out` must have the size of `frame`. The reference implementation is
/// `reference::denoised()`.
void denoise(const ImageView<std::uint8_t>& frame, int limit, ThreadPool& threads,
             Image<std::uint8_t>& out);
void denoise(const ImageView<std::uint16_t>& frame, int limit, ThreadPool& threads,
             Image<std::uint16_t>& out);

/// Removes the noise of the frame camera, which event cameras do not see.
class Denoiser {
 public:
  explicit Denoiser(const LumaFormat& format) : format_(format) {}

  void restart();

  /// Returns the largest difference between neighbouring pixels to smooth, in grey levels:
  /// `setting` or, for automatic_denoise, as much as the noise needs. Keeps the first frame, whose
  /// noise is not known yet.
  double amplitude_for(const LumaView& frame, double setting);

  /// Returns the kept first frame, denoised, once; none if there is none, or it has no noise.
  std::optional<LumaView> kept_first(double amplitude, ThreadPool& threads);

  /// Smooths differences up to `amplitude` grey levels. Returns a view that is valid until the next
  /// call: of `frame` itself if there is nothing to do.
  LumaView denoised(const LumaView& frame, double amplitude, ThreadPool& threads);

 private:
  void keep(const LumaView& frame);

  LumaFormat format_;
  NoiseLevel noise_;
  bool is_first_ = true;
  std::optional<LumaView> first_;  ///< until its noise is known
  std::vector<std::byte> kept_;    ///< its pixels
  Image<std::uint8_t> bytes_;
  Image<std::uint16_t> words_;
};

}  // namespace eventcamera
