// SPDX-License-Identifier: LGPL-2.1-or-later
// Sums over single windows with the byte products of AVX-512 VNNI. Included once per SIMD target,
// after foreach_target.h.
#if defined(EVENTCAMERA_BYTE_WINDOWS_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef EVENTCAMERA_BYTE_WINDOWS_INL
#undef EVENTCAMERA_BYTE_WINDOWS_INL
#else
#define EVENTCAMERA_BYTE_WINDOWS_INL
#endif

#include <span>

#include "src/flow/lucas_kanade/window_sums-inl.hpp"

#if HWY_MAX_BYTES == 64

HWY_PUSH_ATTRIBUTES(HWY_TARGET_STR ",avx512vnni")
namespace eventcamera::HWY_NAMESPACE {

/// The windows of all pixels of a tile, as bytes to be multiplied with pixels. A gradient is 64 *
/// high + low; a row of a window has 16 high and 16 low parts of the horizontal gradients, then the
/// same of the vertical ones. The last of the 16 has weight 0.
class ByteWindows {
 public:
  static bool supported() { return __builtin_cpu_supports("avx512vnni") != 0; }

  /// Takes `rows` rows of window_columns gradients, at most those of all windows of a tile.
  ByteWindows(const std::int16_t* slope_x, const std::int16_t* slope_y, int rows) {
    const hn::FixedTag<std::int16_t, window_columns> slopes;
    const hn::Rebind<std::int8_t, decltype(slopes)> bytes;
    const hn::Half<Row> half;
    const hn::Half<decltype(half)> quarter;
    HWY_ALIGN static constexpr std::int8_t weight[] = {-1, -1, -1, -1, -1, -1, -1, -1,
                                                       -1, -1, -1, -1, -1, -1, -1, 0};
    const auto within = hn::LoadDup128(Row(), weight);
    const auto low_bits = hn::Set(slopes, (1 << low_width) - 1);
    HWY_ALIGN std::int8_t part[4][window_columns];
    for (int row = 0; row < rows; ++row) {
      const auto x = hn::Load(slopes, slope_x + row * window_columns);
      const auto y = hn::Load(slopes, slope_y + row * window_columns);
      hn::Store(hn::DemoteTo(bytes, hn::ShiftRight<low_width>(x)), bytes, part[0]);
      hn::Store(hn::DemoteTo(bytes, hn::And(x, low_bits)), bytes, part[1]);
      hn::Store(hn::DemoteTo(bytes, hn::ShiftRight<low_width>(y)), bytes, part[2]);
      hn::Store(hn::DemoteTo(bytes, hn::And(y, low_bits)), bytes, part[3]);
      for (int column = 0; column < Tile::side; ++column) {
        const auto load = [&](int k) { return hn::LoadU(quarter, part[k] + column); };
        const auto all = hn::Combine(Row(), hn::Combine(half, load(3), load(2)),
                                     hn::Combine(half, load(1), load(0)));
        hn::Store(hn::And(all, within), Row(), rows_[row * Tile::side + column]);
      }
    }
  }

  /// Computes the sums of points, given by the index of their pixel in the tile and the offset of
  /// their window in the other image.
  HWY_NOINLINE void sum(std::span<const std::int32_t> points, const int* pixel,
                        const Image<std::uint8_t>& to, const std::int32_t* at,
                        GradientSums (*out)[tile_pixels]) const {
    const hn::Half<hn::Half<Sums>> four;
    for (const auto i : points) {
      const auto sums = sum_corners(rows_ + pixel[i], to.row(0) + at[i], to.stride());
      const auto x = hn::LowerHalf(four, hn::LowerHalf(sums));
      const auto y = hn::LowerHalf(four, hn::UpperHalf(hn::Half<Sums>(), sums));
      store(hn::InterleaveLower(four, x, y), out[0][i], out[1][i]);
      store(hn::InterleaveUpper(four, x, y), out[2][i], out[3][i]);
    }
  }

 private:
  using Row = hn::FixedTag<std::int8_t, 64>;
  using Pixels = hn::Rebind<std::uint8_t, Row>;
  using Sums = hn::Repartition<std::int32_t, Row>;
  using Sum = hn::Vec<Sums>;

  static constexpr int low_width = 6;
  /// Independent sums per corner, because additions to a single one would wait for each other.
  static constexpr int chains = 3;
  static_assert(window % chains == 0);

  /// Sums of the horizontal gradients at the four corners in the first four lanes, those of the
  /// vertical gradients at the start of the upper half.
  static HWY_INLINE Sum sum_corners(const std::int8_t (*row)[64], const std::uint8_t* pixels,
                                    std::ptrdiff_t stride) {
    Sum sums[chains][corners];
    for (auto& chain : sums)
      for (auto& sum : chain) sum = hn::Zero(Sums());
    auto left = hn::LoadDup128(Pixels(), pixels);
    auto right = hn::LoadDup128(Pixels(), pixels + 1);
    for (int i = 0; i < window; i += chains) {
      for (auto& chain : sums) {
        const auto slopes = hn::Load(Row(), *row);
        row += Tile::side;
        pixels += stride;
        add_products(chain[0], left, slopes);
        add_products(chain[1], right, slopes);
        left = hn::LoadDup128(Pixels(), pixels);
        right = hn::LoadDup128(Pixels(), pixels + 1);
        add_products(chain[2], left, slopes);
        add_products(chain[3], right, slopes);
      }
    }
    const auto add_chains = [&](int corner) {
      return hn::Add(hn::Add(sums[0][corner], sums[1][corner]), sums[2][corner]);
    };
    const auto parts =
        add_lanes(Sums(), add_chains(0), add_chains(1), add_chains(2), add_chains(3));
    return hn::Add(hn::ShiftLeft<low_width>(parts), hn::SwapAdjacentBlocks(parts));
  }

  static HWY_INLINE void add_products(Sum& sum, hn::Vec<Pixels> pixels, hn::Vec<Row> slopes) {
    sum.raw = _mm512_dpbusd_epi32(sum.raw, pixels.raw, slopes.raw);
  }

  static HWY_INLINE void store(hn::Vec128<std::int32_t> sums, GradientSums& left,
                               GradientSums& right) {
    const hn::FixedTag<std::int64_t, 2> two;
    const hn::Half<decltype(two)> one;
    const auto both = hn::BitCast(two, sums);
    hn::StoreU(hn::LowerHalf(one, both), one, reinterpret_cast<std::int64_t*>(&left));
    hn::StoreU(hn::UpperHalf(one, both), one, reinterpret_cast<std::int64_t*>(&right));
  }

  HWY_ALIGN std::int8_t rows_[(Tile::side + window - 1) * Tile::side][64];
};

}  // namespace eventcamera::HWY_NAMESPACE
HWY_POP_ATTRIBUTES

#endif  // HWY_MAX_BYTES == 64
#endif  // per target
