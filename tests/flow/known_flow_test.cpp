// SPDX-License-Identifier: LGPL-2.1-or-later
// Flow and tracks compared with OpenCV's: DIS of either quality is what OpenCV finds with the same
// parameters; between noisy pictures warped by a known flow, the end-point errors of tracks and of
// Farneback's flow are no larger, in mean and 95th percentile, and hardly more tracks are lost.
#include <gtest/gtest.h>
#include <opencv2/video/tracking.hpp>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <tuple>

#include "src/flow/dense_flow.hpp"
#include "src/flow/dis/dis.hpp"
#include "src/flow/opencv.hpp"
#include "tests/flow/moving_pictures.hpp"
#include "tests/flow/tracks_between.hpp"
#include "tests/reference/diff.hpp"
#include "tests/reference/sparse.hpp"

namespace {

using namespace eventcamera;

/// OpenCV's implementation of Farneback's method, with the parameters of the paper's code.
Image<Flow> opencv_farneback(const Image<std::uint8_t>& from, const Image<std::uint8_t>& to) {
  Image<Flow> flow(from.width(), from.height());
  cv::Mat mat(from.height(), from.width(), CV_32FC2, flow.row(0),
              static_cast<std::size_t>(flow.stride()));
  cv::calcOpticalFlowFarneback(opencv_image(from.view()), opencv_image(to.view()), mat, 0.5, 3, 15,
                               3, 5, 1.2, 0);
  return flow;
}

/// OpenCV's tracks of these points, on as many levels as ours.
std::vector<Track> opencv_tracks(const Image<std::uint8_t>& from, const Image<std::uint8_t>& to,
                                 const std::vector<Point>& points) {
  std::vector<cv::Point2f> starts;
  for (const auto& point : points)
    starts.emplace_back(static_cast<float>(point.x), static_cast<float>(point.y));
  std::vector<cv::Point2f> ends;
  std::vector<unsigned char> status;
  std::vector<float> error;
  cv::calcOpticalFlowPyrLK(opencv_image(from.view()), opencv_image(to.view()), starts, ends, status,
                           error, {15, 15}, 3, {3, 10, 0.03});
  std::vector<Track> tracks;
  for (std::size_t i = 0; i < points.size(); ++i)
    tracks.push_back({{ends[i].x - starts[i].x, ends[i].y - starts[i].y}, status[i] != 0});
  return tracks;
}

constexpr int width = 224;
constexpr int height = 168;

struct Position {
  double x;
  double y;
};

/// What a pixel of a picture shows: the place in the picture before.
using Warp = std::function<Position(const Position&)>;

/// Random value of a lattice point, 0 to 1.
double lattice(int x, int y, int octave) {
  auto hash = static_cast<std::uint32_t>(x) * 0x9e3779b1U ^
              static_cast<std::uint32_t>(y) * 0x85ebca77U ^
              static_cast<std::uint32_t>(octave) * 0xc2b2ae3dU;
  hash = (hash ^ hash >> 15) * 0x2c1b3c6dU;
  hash = (hash ^ hash >> 12) * 0x297a2d39U;
  return (hash >> 8) / static_cast<double>(1 << 24);
}

/// Sum of smooth noise with details of 4 to 32 pixels, 0 to 1.
double texture(const Position& at) {
  double sum = 0;
  double weight = 0;
  for (int octave = 2; octave <= 5; ++octave) {
    const double side = 1 << octave;
    const double u = at.x / side + 100;
    const double v = at.y / side + 100;
    const int x = static_cast<int>(std::floor(u));
    const int y = static_cast<int>(std::floor(v));
    const auto smooth = [](double t) { return t * t * t * (t * (6 * t - 15) + 10); };
    const auto along = [&](int row) {
      return std::lerp(lattice(x, row, octave), lattice(x + 1, row, octave), smooth(u - x));
    };
    sum += side * std::lerp(along(y), along(y + 1), smooth(v - y));
    weight += side;
  }
  return sum / weight;
}

struct Sequence {
  const char* name;
  Warp warp;
  double contrast = 200;  ///< grey levels
  double noise = 2;       ///< standard deviation, grey levels
};

/// Frames 0, 1 and 2.
Image<std::uint8_t> frame(const Sequence& sequence, int number) {
  std::mt19937 random(static_cast<unsigned>(number) + 1);
  std::normal_distribution<double> noise(0, sequence.noise);
  Image<std::uint8_t> picture(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      Position at{static_cast<double>(x), static_cast<double>(y)};
      for (int i = 0; i < number; ++i) at = sequence.warp(at);
      const double grey = 128 + sequence.contrast * (texture(at) - 0.5) + noise(random);
      picture.at(x, y) = static_cast<std::uint8_t>(std::clamp(std::lround(grey), 0L, 255L));
    }
  }
  return picture;
}

/// Flow of a pixel to the next picture.
Flow true_flow(const Sequence& sequence, int x, int y) {
  const Position from{static_cast<double>(x), static_cast<double>(y)};
  Position to = from;
  for (int i = 0; i < 30; ++i) {
    const auto back = sequence.warp(to);
    to = {to.x + from.x - back.x, to.y + from.y - back.y};
  }
  return {static_cast<float>(to.x - from.x), static_cast<float>(to.y - from.y)};
}

/// True if a pixel ends in the next picture, not at its edge.
bool ends_inside(const Sequence& sequence, int x, int y) {
  constexpr float edge = 8;
  const Flow flow = true_flow(sequence, x, y);
  const float to_x = static_cast<float>(x) + flow.x;
  const float to_y = static_cast<float>(y) + flow.y;
  return to_x >= edge && to_y >= edge && to_x <= width - 1 - edge && to_y <= height - 1 - edge;
}

struct Errors {
  std::vector<double> errors;  ///< pixels

  void add(const Flow& flow, const Flow& truth) {
    errors.push_back(std::hypot(flow.x - truth.x, flow.y - truth.y));
  }

  double mean() const {
    double sum = 0;
    for (const double error : errors) sum += error;
    return sum / static_cast<double>(errors.size());
  }
  double percentile_95() {
    const auto at = errors.begin() + static_cast<std::ptrdiff_t>(errors.size() * 95 / 100);
    std::nth_element(errors.begin(), at, errors.end());
    return *at;
  }
};

void compare(const Sequence& sequence, Errors& ours, Errors& opencv) {
  ASSERT_GT(ours.errors.size(), 1000U);
  std::printf("%s: mean %.4f (OpenCV %.4f), 95th percentile %.4f (%.4f)\n", sequence.name,
              ours.mean(), opencv.mean(), ours.percentile_95(), opencv.percentile_95());
  EXPECT_LE(ours.mean(), opencv.mean());
  EXPECT_LE(ours.percentile_95(), opencv.percentile_95());
}

/// Compares PointTracker with OpenCV.
class TrackComparison {
 public:
  TrackComparison(const Sequence& sequence, int block_side)
      : sequence_(sequence), block_side_(block_side) {}

  /// Adds the tracks of the points that end in the next picture.
  void add(const Image<std::uint8_t>& from, const Image<std::uint8_t>& to,
           std::vector<Point> points) {
    std::erase_if(points, [&](const Point& p) { return !ends_inside(sequence_, p.x, p.y); });
    const auto ours = tracks_between(from, to, points, block_side_);
    const auto theirs = opencv_tracks(from, to, points);
    for (std::size_t i = 0; i < points.size(); ++i) {
      found_by_us_ += ours[i].found ? 1 : 0;
      found_by_opencv_ += theirs[i].found ? 1 : 0;
      if (!ours[i].found || !theirs[i].found) continue;
      const Flow truth = true_flow(sequence_, points[i].x, points[i].y);
      ours_.add(ours[i].flow, truth);
      opencv_.add(theirs[i].flow, truth);
    }
  }

  void check() {
    compare(sequence_, ours_, opencv_);
    EXPECT_GE(found_by_us_, found_by_opencv_ - found_by_opencv_ / 200);
  }

 private:
  const Sequence& sequence_;
  int block_side_;
  int found_by_us_ = 0;
  int found_by_opencv_ = 0;
  Errors ours_;
  Errors opencv_;
};

/// Linear map around the centre, then a shift.
Warp linear(double xx, double xy, double yx, double yy, double right = 0, double down = 0) {
  return [=](const Position& p) {
    const double x = p.x - width / 2.0;
    const double y = p.y - height / 2.0;
    return Position{width / 2.0 + xx * x + xy * y - right, height / 2.0 + yx * x + yy * y - down};
  };
}

Warp rotation(double degrees) {
  const double angle = degrees * std::numbers::pi / 180;
  return linear(std::cos(angle), std::sin(angle), -std::sin(angle), std::cos(angle));
}

class KnownFlow : public testing::TestWithParam<Sequence> {};

INSTANTIATE_TEST_SUITE_P(
    , KnownFlow,
    testing::Values(
        Sequence{"shift", linear(1, 0, 0, 1, 2.3, -1.6)},
        Sequence{"long_shift", linear(1, 0, 0, 1, -11.4, 6.7)},
        Sequence{"noisy_shift", linear(1, 0, 0, 1, 1.4, 3.2), 120, 6},
        Sequence{"rotation", rotation(2.5)}, Sequence{"zoom", linear(0.96, 0, 0, 0.96)},
        Sequence{"shear", linear(1, 0.05, 0, 1, 0.8, 0.3)},
        Sequence{
            "waves",
            [](const Position& p) {
              return Position{p.x - 2.5 * std::sin(p.y / 25) - 1.2, p.y - 1.8 * std::cos(p.x / 30)};
            }},
        Sequence{"perspective",
                 [](const Position& p) {
                   const double depth = 1 + 0.0003 * (p.x - width / 2.0);
                   return Position{width / 2.0 + (p.x - width / 2.0) / depth - 1.5,
                                   height / 2.0 + (p.y - height / 2.0) / depth};
                 }}),
    [](const auto& sequence) { return std::string(sequence.param.name); });

TEST_P(KnownFlow, IsThatOfChangedPixels) {
  const auto from = frame(GetParam(), 0);
  const auto to = frame(GetParam(), 1);
  TrackComparison comparison(GetParam(), 2);
  comparison.add(from, to, reference::changed(from, to, 6));
  comparison.check();
}

TEST_P(KnownFlow, IsThatOfDifferenceFrames) {
  const auto first = frame(GetParam(), 0);
  const auto second = frame(GetParam(), 1);
  const auto third = frame(GetParam(), 2);
  const Thresholds thresholds{8, 8};
  const auto before = reference::difference_frame(first, second, thresholds);
  const auto now = reference::difference_frame(second, third, thresholds);
  TrackComparison comparison(GetParam(), 1);
  for (const int sign : {1, -1}) {
    const auto from = reference::part_of(before, sign, 8);
    comparison.add(from, reference::part_of(now, sign, 8), reference::points_of(from));
  }
  comparison.check();
}

TEST_P(KnownFlow, IsThatOfFarneback) {
  const auto from = frame(GetParam(), 0);
  const auto to = frame(GetParam(), 1);
  ThreadPool threads;
  const auto finder = make_dense_flow(FlowMethod::farneback);
  const auto found = finder->find(from.view(), to.view(), threads);
  const auto found_by_opencv = opencv_farneback(from, to);
  Errors ours;
  Errors opencv;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (!ends_inside(GetParam(), x, y)) continue;
      const Flow truth = true_flow(GetParam(), x, y);
      ours.add(found.row(y)[x], truth);
      opencv.add(found_by_opencv.at(x, y), truth);
    }
  }
  compare(GetParam(), ours, opencv);
}

/// OpenCV's implementation of DIS with the parameters of ours, for images of at least 64x64 pixels.
Image<Flow> opencv_dis(const Image<std::uint8_t>& from, const Image<std::uint8_t>& to,
                       const DisFlow::Quality& quality) {
  const auto dis = cv::DISOpticalFlow::create();
  dis->setPatchSize(quality.patch);
  dis->setPatchStride(quality.stride);
  dis->setGradientDescentIterations(quality.iterations);
  dis->setFinestScale(quality.finest_scale(from.width(), from.height()));
  dis->setUseSpatialPropagation(false);
  regularise(*dis);
  cv::Mat flow;
  // Contiguous rows, as it requires.
  dis->calc(opencv_image(from.view()).clone(), opencv_image(to.view()).clone(), flow);
  Image<Flow> result(from.width(), from.height());
  result.assign(
      {flow.ptr<Flow>(), static_cast<std::ptrdiff_t>(flow.step[0]), from.width(), from.height()});
  return result;
}

class Dis : public testing::TestWithParam<std::tuple<bool, Pictures>> {};

INSTANTIATE_TEST_SUITE_P(
    , Dis,
    testing::Combine(testing::Bool(),
                     testing::Values(Pictures{64, 64, true}, Pictures{67, 83, false},
                                     Pictures{150, 111, false}, Pictures{161, 130, true},
                                     Pictures{64, 600, false}, Pictures{64, 600, true})));

TEST_P(Dis, IsWhatOpenCvFinds) {
  const auto [is_high, pictures] = GetParam();
  const auto& quality = is_high ? DisFlow::high : DisFlow::low;
  const auto from = pictures.at(0);
  const auto to = pictures.at(1);
  DisFlow ours(quality);
  ThreadPool threads;
  const auto error =
      difference(copy(ours.find(from.view(), to.view(), threads)), opencv_dis(from, to, quality));
  EXPECT_LT(error.mean, 0.02);
}

}  // namespace
