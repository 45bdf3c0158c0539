// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "src/core/image.hpp"
#include "src/flow/dis/dis.hpp"
#include "src/flow/dis/inverse_search.hpp"
#include "tests/reference/farneback.hpp"

/// Kroeger et al., "Fast optical flow using dense inverse search" (ECCV 2016), with the pyramid,
/// step length and mean normalisation of OpenCV, whose spatial propagation goes on from patch to
/// patch instead of from all to their neighbours. Each level is refined as by Brox et al., "High
/// accuracy optical flow estimation based on a theory for warping" (ECCV 2004).
namespace eventcamera::reference {

using Grey = Image<std::uint8_t>;
using Plane = Image<double>;

/// Value at a pixel, border replicated.
template <class Pixel>
double pixel_of(const Image<Pixel>& plane, int x, int y) {
  return plane.at(std::clamp(x, 0, plane.width() - 1), std::clamp(y, 0, plane.height() - 1));
}

/// Value between pixels, border replicated.
inline double between_pixels(const Grey& picture, double x, double y) {
  const int left = static_cast<int>(std::floor(x));
  const int top = static_cast<int>(std::floor(y));
  const double right = x - left;
  const double down = y - top;
  return (1 - down) * ((1 - right) * pixel_of(picture, left, top) +
                       right * pixel_of(picture, left + 1, top)) +
         down * ((1 - right) * pixel_of(picture, left, top + 1) +
                 right * pixel_of(picture, left + 1, top + 1));
}

/// Mean over the area of each pixel of a smaller image, rounded; ties to even, of 2x2 pixels up.
inline Grey shrunk(const Grey& picture, int width, int height) {
  // In 1 / to of a pixel.
  const auto overlap = [](std::int64_t pixel, std::int64_t i, int from, int to) {
    return std::max<std::int64_t>(
        0, std::min((pixel + 1) * to, (i + 1) * from) - std::max(pixel * to, i * from));
  };
  const double area = 1.0 * picture.width() * picture.height();
  const bool halves = picture.width() == 2 * width && picture.height() == 2 * height;
  Grey result(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      std::int64_t sum = 0;
      for (int v = y * picture.height() / height; v < picture.height(); ++v) {
        const auto rows = overlap(v, y, picture.height(), height);
        if (rows == 0) break;
        for (int u = x * picture.width() / width; u < picture.width(); ++u) {
          const auto columns = overlap(u, x, picture.width(), width);
          if (columns == 0) break;
          sum += rows * columns * picture.at(u, v);
        }
      }
      const double mean = static_cast<double>(sum) / area;
      result.at(x, y) =
          static_cast<std::uint8_t>(halves ? std::floor(mean + 0.5) : std::nearbyint(mean));
    }
  }
  return result;
}

struct Slope {
  double x;
  double y;
};

/// The Sobel operator, border mirrored.
inline Slope sobel(const Grey& picture, int x, int y) {
  const auto mirrored = [](int i, int size) {
    return std::clamp(i < 0 ? -i : i >= size ? 2 * (size - 1) - i : i, 0, size - 1);
  };
  const auto at = [&](int u, int v) -> double {
    return picture.at(mirrored(x + u, picture.width()), mirrored(y + v, picture.height()));
  };
  Slope slope{};
  for (int k = -1; k <= 1; ++k) {
    slope.x += (2 - std::abs(k)) * (at(1, k) - at(-1, k));
    slope.y += (2 - std::abs(k)) * (at(k, 1) - at(k, -1));
  }
  return slope;
}

/// A patch with its upper left corner at (x, y).
class Patch {
 public:
  Patch(const Grey& from, const Grey& to, int side, int x, int y)
      : from_(from), to_(to), side_(side), x_(x), y_(y) {
    for (int v = 0; v < side; ++v)
      for (int u = 0; u < side; ++u) slopes_.push_back(sobel(from, x + u, y + v));
    for_each_pixel([&](int, int, const Slope& slope) {
      xx_ += slope.x * slope.x;
      xy_ += slope.x * slope.y;
      yy_ += slope.y * slope.y;
      mean_.x += slope.x / (side * side);
      mean_.y += slope.y / (side * side);
    });
    determinant_ = std::max(1e-3, xx_ * yy_ - xy_ * xy_);
  }

  /// Sum of the squared differences, less their mean.
  double error(const Flow& flow) const { return differences(flow.x, flow.y).error; }

  /// Gradient descent from `start`.
  Flow search(const Flow& start, int iterations) const {
    double flow_x = start.x;
    double flow_y = start.y;
    double previous = std::numeric_limits<double>::infinity();
    for (int i = 0; i < iterations; ++i) {
      const auto [error, sum_x, sum_y] = differences(flow_x, flow_y);
      flow_x -= (yy_ * sum_x - xy_ * sum_y) / determinant_;
      flow_y -= (xx_ * sum_y - xy_ * sum_x) / determinant_;
      if (error >= previous) break;
      previous = error;
    }
    if (std::hypot(flow_x - start.x, flow_y - start.y) > side_) return start;
    return {static_cast<float>(flow_x), static_cast<float>(flow_y)};
  }

 private:
  /// Sums over the differences, less their mean: of their squares, and times the slopes.
  struct Differences {
    double error, sum_x, sum_y;
  };

  template <class Body>
  void for_each_pixel(const Body& body) const {
    for (int v = 0; v < side_; ++v)
      for (int u = 0; u < side_; ++u) body(u, v, slopes_[static_cast<std::size_t>(v * side_ + u)]);
  }

  Differences differences(double flow_x, double flow_y) const {
    const double left = std::clamp(x_ + flow_x, 1.0 - side_, to_.width() - 1.0);
    const double top = std::clamp(y_ + flow_y, 1.0 - side_, to_.height() - 1.0);
    double sum = 0;
    Differences all{};
    for_each_pixel([&](int u, int v, const Slope& slope) {
      const double difference = between_pixels(to_, left + u, top + v) - from_.at(x_ + u, y_ + v);
      sum += difference;
      all.error += difference * difference;
      all.sum_x += difference * slope.x;
      all.sum_y += difference * slope.y;
    });
    return {all.error - sum * sum / (side_ * side_), all.sum_x - sum * mean_.x,
            all.sum_y - sum * mean_.y};
  }

  const Grey& from_;
  const Grey& to_;
  int side_;
  int x_;
  int y_;
  std::vector<Slope> slopes_;
  double xx_ = 0;
  double xy_ = 0;
  double yy_ = 0;
  double determinant_;
  Slope mean_{};
};

/// Flow of each patch, and the mean over the patches at a pixel, weighted by the error there.
class Patches {
 public:
  Patches(const Grey& from, const Grey& to, const DisFlow::Quality& quality,
          const Image<Flow>& start)
      : from_(from),
        to_(to),
        quality_(quality),
        flows_(1 + (from.width() - quality.patch) / quality.stride,
               1 + (from.height() - quality.patch) / quality.stride) {
    for (int j = 0; j < flows_.height(); ++j) {
      for (int i = 0; i < flows_.width(); ++i) {
        const int x = i * quality.stride;
        const int y = j * quality.stride;
        flows_.at(i, j) =
            Patch(from, to, quality.patch, x, y)
                .search(start.at(x + quality.patch / 2, y + quality.patch / 2), quality.iterations);
      }
    }
    for (int round = 0; round < quality.propagations; ++round) propagate();
  }

  Flow at(int x, int y) const {
    double sum_x = 0;
    double sum_y = 0;
    double weights = 0;
    for (int j = 0; j < flows_.height(); ++j) {
      if (!covers(j, y, flows_.height())) continue;
      for (int i = 0; i < flows_.width(); ++i) {
        if (!covers(i, x, flows_.width())) continue;
        const Flow& flow = flows_.at(i, j);
        const double there = between_pixels(to_, x + double{flow.x}, y + double{flow.y});
        const double weight = 1 / std::max(1.0, std::abs(there - from_.at(x, y)));
        sum_x += weight * flow.x;
        sum_y += weight * flow.y;
        weights += weight;
      }
    }
    return {static_cast<float>(sum_x / weights), static_cast<float>(sum_y / weights)};
  }

 private:
  /// Searches again from the best flow of a neighbour where that is better than a patch's own.
  void propagate() {
    const auto found = flows_;
    for (int j = 0; j < found.height(); ++j) {
      for (int i = 0; i < found.width(); ++i) {
        const Patch patch(from_, to_, quality_.patch, i * quality_.stride, j * quality_.stride);
        const Flow* best = nullptr;
        double lowest = better_share * patch.error(found.at(i, j)) - better_by;
        for (int v = std::max(0, j - 1); v <= std::min(j + 1, found.height() - 1); ++v) {
          for (int u = std::max(0, i - 1); u <= std::min(i + 1, found.width() - 1); ++u) {
            const double error = patch.error(found.at(u, v));
            if (error >= lowest) continue;
            best = &found.at(u, v);
            lowest = error;
          }
        }
        if (best != nullptr) flows_.at(i, j) = patch.search(*best, quality_.iterations);
      }
    }
  }

  /// The last patch extends to the border.
  bool covers(int patch, int pixel, int count) const {
    const int first = patch * quality_.stride;
    return pixel >= first && (pixel < first + quality_.patch || patch == count - 1);
  }

  const Grey& from_;
  const Grey& to_;
  DisFlow::Quality quality_;
  Image<Flow> flows_;
};

/// Minimises the energy
///   5 |I1(x + f + d) - I0(x)| + 10 |grad I1(x + f + d) - grad I0(x)| + 20 |grad (f + d)|
/// where the first two are divided by their gradients, linearised at the flow f, and |e| stands for
/// sqrt(e^2 + 0.001^2).
class Refinement {
 public:
  Refinement(const Grey& from, const Grey& to, const Image<Flow>& flow)
      : flow_(flow), step_(flow.width(), flow.height()) {
    const int width = flow.width();
    const int height = flow.height();
    Plane mean(width, height);
    Plane change(width, height);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const auto rounded = [](double place) { return std::nearbyint(place * 32) / 32; };
        const double there =
            between_pixels(to, std::clamp(rounded(x + double{flow.at(x, y).x}), 0.0, width - 1.0),
                           std::clamp(rounded(y + double{flow.at(x, y).y}), 0.0, height - 1.0));
        mean.at(x, y) = (from.at(x, y) + there) / 2;
        change.at(x, y) = there - from.at(x, y);
      }
    }
    const auto mean_x = slope_x(mean);
    const auto mean_y = slope_y(mean);
    constraints_[0] = constraint(mean_x, mean_y, change);
    constraints_[1] = constraint(slope_x(mean_x), slope_y(mean_x), slope_x(change));
    constraints_[2] = constraint(slope_y(mean_x), slope_y(mean_y), slope_y(change));
    for (int evaluation = 0; evaluation < 5; ++evaluation) {
      evaluate();
      for (int sweep = 0; sweep < 10; ++sweep)
        for (int y = 0; y < height; ++y)
          for (int x = (y + sweep) % 2; x < width; x += 2) relax(x, y);
    }
  }

  Flow at(int x, int y) const { return flow_.at(x, y) + step_.at(x, y); }

 private:
  /// a x + b y + c = 0
  struct Constraint {
    double a, b, c;
    double residual(const Flow& step) const { return a * step.x + b * step.y + c; }
  };
  struct System {
    double xx, xy, yy, x, y;
  };

  static Plane slope_x(const Plane& plane) {
    Plane slope(plane.width(), plane.height());
    for (int y = 0; y < plane.height(); ++y)
      for (int x = 0; x < plane.width(); ++x)
        slope.at(x, y) = pixel_of(plane, x + 1, y) - pixel_of(plane, x - 1, y);
    return slope;
  }
  static Plane slope_y(const Plane& plane) {
    Plane slope(plane.width(), plane.height());
    for (int y = 0; y < plane.height(); ++y)
      for (int x = 0; x < plane.width(); ++x)
        slope.at(x, y) = pixel_of(plane, x, y + 1) - pixel_of(plane, x, y - 1);
    return slope;
  }
  static Image<Constraint> constraint(const Plane& a, const Plane& b, const Plane& c) {
    Image<Constraint> result(a.width(), a.height());
    for (int y = 0; y < a.height(); ++y) {
      for (int x = 0; x < a.width(); ++x) {
        const double size = std::sqrt(std::pow(a.at(x, y), 2) + std::pow(b.at(x, y), 2) + 0.01);
        result.at(x, y) = {a.at(x, y) / size, b.at(x, y) / size, c.at(x, y) / size};
      }
    }
    return result;
  }
  /// Derivative of sqrt(e^2 + 0.001^2) / 2 by e^2 / 2.
  static double penalty(double squares) { return 0.5 / std::sqrt(squares + 1e-6); }

  void evaluate() {
    const int width = flow_.width();
    const int height = flow_.height();
    weights_ = Plane(width, height);
    system_ = Image<System>(width, height);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const Flow here = at(x, y);
        const Flow right = at(std::min(x + 1, width - 1), y);
        const Flow below = at(x, std::min(y + 1, height - 1));
        weights_.at(x, y) =
            20 * penalty(std::pow(right.x - here.x, 2) + std::pow(right.y - here.y, 2) +
                         std::pow(below.x - here.x, 2) + std::pow(below.y - here.y, 2));
        const Flow& step = step_.at(x, y);
        const auto& bright = constraints_[0].at(x, y);
        const auto& gradient_x = constraints_[1].at(x, y);
        const auto& gradient_y = constraints_[2].at(x, y);
        System system{0.01, 0, 0.01, 0, 0};
        const auto add = [&](const Constraint& c, double weight) {
          system.xx += weight * c.a * c.a;
          system.xy += weight * c.a * c.b;
          system.yy += weight * c.b * c.b;
          system.x -= weight * c.a * c.c;
          system.y -= weight * c.b * c.c;
        };
        const double gradient = 10 * penalty(std::pow(gradient_x.residual(step), 2) +
                                             std::pow(gradient_y.residual(step), 2));
        add(bright, 5 * penalty(std::pow(bright.residual(step), 2)));
        add(gradient_x, gradient);
        add(gradient_y, gradient);
        system_.at(x, y) = system;
      }
    }
  }

  /// Solves the equations of a pixel for its step, and goes 1.6 times as far.
  void relax(int x, int y) {
    System system = system_.at(x, y);
    const auto pull = [&](int u, int v, double weight) {
      system.xx += weight;
      system.yy += weight;
      system.x += weight * (at(u, v).x - flow_.at(x, y).x);
      system.y += weight * (at(u, v).y - flow_.at(x, y).y);
    };
    if (x > 0) pull(x - 1, y, weights_.at(x - 1, y));
    if (y > 0) pull(x, y - 1, weights_.at(x, y - 1));
    if (x + 1 < flow_.width()) pull(x + 1, y, weights_.at(x, y));
    if (y + 1 < flow_.height()) pull(x, y + 1, weights_.at(x, y));
    Flow& step = step_.at(x, y);
    step.x += static_cast<float>(1.6 * ((system.x - system.xy * step.y) / system.xx - step.x));
    step.y += static_cast<float>(1.6 * ((system.y - system.xy * step.x) / system.yy - step.y));
  }

  const Image<Flow>& flow_;
  Image<Flow> step_;
  std::array<Image<Constraint>, 3> constraints_;
  Plane weights_;
  Image<System> system_;
};

inline Image<Flow> scaled(const Image<Flow>& flow, int width, int height, double factor) {
  auto result = resized(flow, width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) result.at(x, y) = result.at(x, y) * factor;
  return result;
}

/// For images of at least 64x64 pixels.
inline Image<Flow> dis(const Grey& from, const Grey& to, const DisFlow::Quality& quality) {
  const int width = from.width();
  const int height = from.height();
  const int coarsest = static_cast<int>(
      std::min(std::floor(std::log2(std::max(width, height) / (4.0 * quality.patch)) + 0.5),
               std::log2(std::min(width, height) / quality.patch)));
  const int finest = std::min(quality.max_finest, std::max(0, coarsest - quality.scales + 1));
  std::vector<std::pair<Grey, Grey>> levels;
  for (int scale = finest; scale <= coarsest; ++scale) {
    const int factor = levels.empty() ? 1 << finest : 2;
    const auto& [last, next] = levels.empty() ? std::pair(from, to) : levels.back();
    const int w = last.width() / factor;
    const int h = last.height() / factor;
    levels.emplace_back(shrunk(last, w, h), shrunk(next, w, h));
  }
  Image<Flow> flow(levels.back().first.width(), levels.back().first.height());
  for (std::size_t i = levels.size(); i-- > 0;) {
    const auto& [last, next] = levels[i];
    flow = scaled(flow, last.width(), last.height(), i + 1 == levels.size() ? 1 : 2);
    const Patches patches(last, next, quality, flow);
    Image<Flow> spread(flow.width(), flow.height());
    for (int y = 0; y < flow.height(); ++y)
      for (int x = 0; x < flow.width(); ++x) spread.at(x, y) = patches.at(x, y);
    const Refinement refinement(last, next, spread);
    for (int y = 0; y < flow.height(); ++y)
      for (int x = 0; x < flow.width(); ++x) flow.at(x, y) = refinement.at(x, y);
  }
  return scaled(flow, width, height, 1 << finest);
}

}  // namespace eventcamera::reference
