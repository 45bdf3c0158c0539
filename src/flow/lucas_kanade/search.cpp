// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/lucas_kanade/search.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "src/flow/lucas_kanade/search.cpp"
#include <hwy/foreach_target.h>
// Highway wants to come after that.
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using Values = hn::CappedTag<std::int16_t, 16>;
using Bytes = hn::Rebind<std::uint8_t, Values>;
using Sums = hn::Repartition<std::int32_t, Values>;
using Value = hn::Vec<Values>;

constexpr int window = 15;
constexpr int half_window = window / 2;
/// A row of the window takes up 16 values, the last of them 0 in the slopes.
constexpr int row_values = 16;
constexpr int most_moves = 10;
constexpr float shortest_move = 0.03F;
/// Two moves that cancel each other to this much stand for one half way.
constexpr float turning_back = 0.01F;
/// The least eigenvalue of the slopes' mean products that can be followed.
constexpr float least_texture = 1e-4F;
/// Products of slopes (32 a grey level) in the units of least_texture.
constexpr float slope_product = 1.0F / (1 << 20);
/// Products of a slope and a value (64 a grey level), in the same units.
constexpr float mismatch_product = slope_product / 2;

/// Where a window lies: its upper left pixel, and how far beyond it, in 1/32768 pixel.
struct Corner {
  int x;
  int y;
  std::int16_t right;
  std::int16_t down;

  Corner(float left, float top) {
    const float whole_x = std::floor(left);
    const float whole_y = std::floor(top);
    x = static_cast<int>(whole_x);
    y = static_cast<int>(whole_y);
    right = fraction(left - whole_x);
    down = fraction(top - whole_y);
  }

  static std::int16_t fraction(float part) {
    return static_cast<std::int16_t>(std::min(part * 32768.0F + 0.5F, 32767.0F));
  }

  bool within_margin(const PlaneWithMargin<std::uint8_t>& picture) const {
    return x >= -window && y >= -window && x < picture.width() && y < picture.height();
  }
};

/// Values between two neighbours.
Value between(Value a, Value b, Value part) {
  return hn::Add(a, hn::MulFixedPoint15(hn::Sub(b, a), part));
}

/// The rows of a window, bilinearly, one after another.
template <class Load>
class BilinearRows {
 public:
  BilinearRows(const Corner& corner, Load load)
      : load_(load),
        right_(hn::Set(Values(), corner.right)),
        down_(hn::Set(Values(), corner.down)),
        upper_(across(0)) {}

  Value next() {
    const auto lower = across(++row_);
    return between(std::exchange(upper_, lower), lower, down_);
  }

 private:
  Value across(int row) const { return between(load_(row, 0), load_(row, 1), right_); }

  Load load_;
  Value right_;
  Value down_;
  Value upper_;
  int row_ = 0;
};

/// Grey levels of a picture from a column of a corner on, 64 times.
auto grey_levels(const PlaneWithMargin<std::uint8_t>& picture, const Corner& corner, int column) {
  return [&picture, corner, column](int row, int right) {
    const auto* at = picture.row(corner.y + row) + corner.x + column + right;
    return hn::ShiftLeft<6>(hn::PromoteTo(Values(), hn::LoadU(Bytes(), at)));
  };
}

auto slopes(const PlaneWithMargin<std::int16_t>& slope, const Corner& corner, int column) {
  return [&slope, corner, column](int row, int right) {
    return hn::LoadU(Values(), slope.row(corner.y + row) + corner.x + column + right);
  };
}

/// A sum of the products of a column of vectors: 32 bits hold 15 of the largest.
class ProductSum {
 public:
  // Written out, or GCC 12 makes it without the target's instructions.
  ProductSum() : low_(hn::Zero(Sums())), high_(hn::Zero(Sums())) {}
  void add(Value a, Value b) { low_ = hn::ReorderWidenMulAccumulate(Sums(), a, b, low_, high_); }
  std::int64_t total() const {
    HWY_ALIGN std::int32_t low[hn::MaxLanes(Sums())];
    HWY_ALIGN std::int32_t high[hn::MaxLanes(Sums())];
    hn::Store(low_, Sums(), low);
    hn::Store(high_, Sums(), high);
    std::int64_t sum = 0;
    for (std::size_t i = 0; i < hn::Lanes(Sums()); ++i) sum += std::int64_t{low[i]} + high[i];
    return sum;
  }

 private:
  hn::Vec<Sums> low_;
  hn::Vec<Sums> high_;
};

/// Rows of a window that lies on whole pixels.
template <class Load>
class PixelRows {
 public:
  PixelRows(const Corner&, Load load) : load_(load) {}
  Value next() { return load_(row_++, 0); }

 private:
  Load load_;
  int row_ = 0;
};

/// The window of the first picture: its slopes, and the sums of their products.
struct Window {
  HWY_ALIGN std::int16_t slope_x[window * row_values];
  HWY_ALIGN std::int16_t slope_y[window * row_values];
  float xx;
  float xy;
  float yy;
  std::int64_t grey_x = 0;  ///< of the slopes and the grey levels
  std::int64_t grey_y = 0;

  Window(const Pyramid::Level& level, const Corner& corner) {
    if (corner.right == 0 && corner.down == 0)
      read<PixelRows>(level, corner);
    else
      read<BilinearRows>(level, corner);
  }

  float determinant() const { return xx * yy - xy * xy; }

  bool can_be_followed() const {
    const float root = std::sqrt((xx - yy) * (xx - yy) + 4.0F * xy * xy);
    const float least = (xx + yy - root) / (2 * window * window);
    return least >= least_texture && determinant() >= std::numeric_limits<float>::epsilon();
  }

  /// The move that Newton's method makes from where `corner` lies in the other picture.
  Flow move(const PlaneWithMargin<std::uint8_t>& picture, const Corner& corner) const {
    const Values values;
    const int lanes = static_cast<int>(hn::Lanes(values));
    // The sums over (there - here) * slope; those over here are known.
    std::int64_t mismatch_x = -grey_x;
    std::int64_t mismatch_y = -grey_y;
    for (int column = 0; column < row_values; column += lanes) {
      ProductSum sum_x;
      ProductSum sum_y;
      BilinearRows greys(corner, grey_levels(picture, corner, column));
      for (int y = 0; y < window; ++y) {
        const int at = y * row_values + column;
        const auto grey = greys.next();
        sum_x.add(grey, hn::Load(values, slope_x + at));
        sum_y.add(grey, hn::Load(values, slope_y + at));
      }
      mismatch_x += sum_x.total();
      mismatch_y += sum_y.total();
    }
    const float x = static_cast<float>(mismatch_x) * mismatch_product;
    const float y = static_cast<float>(mismatch_y) * mismatch_product;
    const float scale = 1.0F / determinant();
    return {(xy * y - yy * x) * scale, (xy * x - xx * y) * scale};
  }

 private:
  template <template <class> class Rows>
  void read(const Pyramid::Level& level, const Corner& corner) {
    const Values values;
    const int lanes = static_cast<int>(hn::Lanes(values));
    std::int64_t total_xx = 0;
    std::int64_t total_xy = 0;
    std::int64_t total_yy = 0;
    for (int column = 0; column < row_values; column += lanes) {
      ProductSum sum_xx;
      ProductSum sum_xy;
      ProductSum sum_yy;
      ProductSum sum_grey_x;
      ProductSum sum_grey_y;
      Rows greys(corner, grey_levels(level.picture, corner, column));
      Rows rows_x(corner, slopes(level.slope_x, corner, column));
      Rows rows_y(corner, slopes(level.slope_y, corner, column));
      const auto within =
          hn::FirstN(values, static_cast<std::size_t>(std::min(lanes, window - column)));
      for (int y = 0; y < window; ++y) {
        const int at = y * row_values + column;
        const auto dx = hn::IfThenElseZero(within, rows_x.next());
        const auto dy = hn::IfThenElseZero(within, rows_y.next());
        const auto grey = greys.next();
        hn::Store(dx, values, slope_x + at);
        hn::Store(dy, values, slope_y + at);
        sum_xx.add(dx, dx);
        sum_xy.add(dx, dy);
        sum_yy.add(dy, dy);
        sum_grey_x.add(grey, dx);
        sum_grey_y.add(grey, dy);
      }
      total_xx += sum_xx.total();
      total_xy += sum_xy.total();
      total_yy += sum_yy.total();
      grey_x += sum_grey_x.total();
      grey_y += sum_grey_y.total();
    }
    xx = static_cast<float>(total_xx) * slope_product;
    xy = static_cast<float>(total_xy) * slope_product;
    yy = static_cast<float>(total_yy) * slope_product;
  }
};

void search_one(const Pyramid::Level& from, const Pyramid::Level& to, Search& search) {
  search.found = false;
  const float left = search.x - half_window;
  const float top = search.y - half_window;
  const Corner start(left, top);
  if (!start.within_margin(from.picture)) return;
  const Window pattern(from, start);
  if (!pattern.can_be_followed()) return;
  auto& flow = search.flow;
  const auto inside = [&] {
    // A flow beyond reason is not made an integer.
    return std::abs(flow.x) <= from.picture.width() && std::abs(flow.y) <= from.picture.height() &&
           Corner(left + flow.x, top + flow.y).within_margin(to.picture);
  };
  Flow before{};
  for (int i = 0; i < most_moves; ++i) {
    if (!inside()) return;
    const auto move = pattern.move(to.picture, Corner(left + flow.x, top + flow.y));
    flow = {flow.x + move.x, flow.y + move.y};
    if (move.x * move.x + move.y * move.y <= shortest_move * shortest_move) break;
    if (i > 0 && std::abs(move.x + before.x) < turning_back &&
        std::abs(move.y + before.y) < turning_back) {
      flow = {flow.x - move.x / 2, flow.y - move.y / 2};
      break;
    }
    before = move;
  }
  search.found = inside();
}

void search_all(const Pyramid::Level& from, const Pyramid::Level& to, std::span<Search> searches) {
  for (auto& search : searches) search_one(from, to, search);
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(search_all);

void search_level(const Pyramid::Level& from, const Pyramid::Level& to,
                  std::span<Search> searches) {
  HWY_DYNAMIC_DISPATCH(search_all)(from, to, searches);
}

}  // namespace eventcamera
#endif  // HWY_ONCE
