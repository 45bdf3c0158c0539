// SPDX-License-Identifier: LGPL-2.1-or-later
// Real video: checks every event of every element on two videos, and that interpolation moves
// objects in the right direction. Skips missing videos.
#include <gst/app/gstappsink.h>
#include <gst/gst.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <opencv2/imgproc.hpp>

#include "gst/eventcamera/eventcamera.h"
#include "src/flow/dense_flow.hpp"
#include "src/flow/dis/dis.hpp"
#include "src/flow/lucas_kanade/point_tracker.hpp"
#include "src/flow/opencv.hpp"
#include "src/flow/region_of_interest_flow.hpp"
#include "src/simulate/dense_simulator.hpp"
#include "src/simulate/diff_simulator.hpp"
#include "src/simulate/sparse_simulator.hpp"
#include "tests/flow/opencv_dis.hpp"
#include "tests/flow/opencv_farneback.hpp"
#include "tests/flow/opencv_tracks.hpp"
#include "tests/flow/tracks_between.hpp"
#include "tests/pipelines/video_frames.hpp"
#include "tests/reference/dense.hpp"
#include "tests/reference/diff.hpp"
#include "tests/reference/sparse.hpp"

namespace {

using namespace eventcamera;
using video_frames::for_each_sample;
using video_frames::frames_of;

std::string variable(const char* name) {
  const char* value = g_getenv(name);
  return value == nullptr ? "" : value;
}

std::string video(const std::string& name) {
  return variable("SHARED_DATA") + "/video/" + name;
}

const std::string driving = "driving-1280x720-25fps.mp4";
const std::string cars = "cars-768x432-12fps.mp4";

/// Grey frames of the hand-held sequence in the Debian package visp-images-data.
std::vector<Image<std::uint8_t>> castel_frames(int count) {
  std::vector<Image<std::uint8_t>> frames;
  for (int i = 0; i < count; ++i) {
    char name[32];
    std::snprintf(name, sizeof name, "/image_%04d.pgm", i);
    std::ifstream file(variable("CASTEL") + name, std::ios::binary);
    std::string type;
    int width = 0;
    int height = 0;
    int white = 0;
    file >> type >> width >> height >> white;
    file.get();
    if (!file || type != "P5" || white != 255) return {};
    frames.emplace_back(width, height);
    for (int y = 0; y < height; ++y)
      file.read(reinterpret_cast<char*>(frames.back().row(y)), width);
  }
  return frames;
}

double square_error(const Image<std::uint8_t>& a, const Image<std::uint8_t>& b) {
  double sum = 0;
  for (int y = 0; y < a.height(); ++y)
    for (int x = 0; x < a.width(); ++x) sum += std::pow(a.at(x, y) - b.at(x, y), 2);
  return sum / (a.width() * a.height());
}

double psnr(const Image<std::uint8_t>& a, const Image<std::uint8_t>& b) {
  return 10 * std::log10(255.0 * 255.0 / square_error(a, b));
}

constexpr FlowMethod flows[] = {FlowMethod::dis_lq, FlowMethod::dis_hq, FlowMethod::farneback};
constexpr Interpolation interpolations[] = {Interpolation::forward, Interpolation::blend};

/// I(i-1) warped by the full flow.
Image<std::uint8_t> warped(const Image<std::uint8_t>& last, const ImageView<Flow>& flow) {
  Image<std::uint8_t> result(last.width(), last.height());
  for (int y = 0; y < last.height(); ++y)
    for (int x = 0; x < last.width(); ++x)
      result.at(x, y) = static_cast<std::uint8_t>(
          reference::bilinear(last, x - flow.row(y)[x].x, y - flow.row(y)[x].y) + 0.5);
  return result;
}

TEST(Dense, WarpsTheRightWayRound) {
  if (!std::filesystem::exists(video(driving))) GTEST_SKIP() << "no " << video(driving);
  const auto frames = frames_of(video(driving), 38, 1280, 720);
  ASSERT_GE(frames.size(), 37U);
  ThreadPool threads;
  threads.set_threads(0);
  for (const auto method : flows) {
    const auto finder = make_dense_flow(method);
    double with_warp = 0;
    double without = 0;
    int pairs = 0;
    for (std::size_t i = 1; i < frames.size(); i += 4, ++pairs) {
      const auto flow = finder->find(frames[i - 1].view(), frames[i].view(), threads);
      const double moved = psnr(warped(frames[i - 1], flow), frames[i]);
      const double unmoved = psnr(frames[i - 1], frames[i]);
      EXPECT_GT(moved, unmoved) << "flow " << static_cast<int>(method) << ", pair " << i;
      with_warp += moved;
      without += unmoved;
    }
    std::printf("driving, flow %d: warp %.2f dB, none %.2f dB\n", static_cast<int>(method),
                with_warp / pairs, without / pairs);
  }
}

/// 8-bit difference frame of one polarity (1 or -1).
Image<std::uint8_t> part(const Image<std::uint8_t>& last, const Image<std::uint8_t>& now, int sign,
                         int threshold) {
  Image<std::uint8_t> result(now.width(), now.height());
  for (int y = 0; y < now.height(); ++y)
    for (int x = 0; x < now.width(); ++x)
      if (const int rise = sign * (now.at(x, y) - last.at(x, y)); rise > threshold)
        result.at(x, y) = static_cast<std::uint8_t>(rise);
  return result;
}

/// Minimum gradient over all directions around each pixel (15x15, root mean square, grey levels per
/// pixel).
cv::Mat min_slopes(const Image<std::uint8_t>& image) {
  cv::Mat x;
  cv::Mat y;
  cv::Scharr(opencv_image(image.view()), x, CV_32F, 1, 0, 1 / 32.0);
  cv::Scharr(opencv_image(image.view()), y, CV_32F, 0, 1, 1 / 32.0);
  const auto mean = [](const cv::Mat& products) {
    cv::Mat result;
    cv::boxFilter(products, result, -1, {15, 15});
    return result;
  };
  const cv::Mat xx = mean(x.mul(x));
  const cv::Mat xy = mean(x.mul(y));
  const cv::Mat yy = mean(y.mul(y));
  cv::Mat root;
  cv::sqrt((xx - yy).mul(xx - yy) + 4 * xy.mul(xy), root);
  cv::Mat slopes;
  cv::sqrt(cv::max((xx + yy - root) / 2, 0), slopes);
  return slopes;
}

/// Mean difference between the 9x9 pixels around the start of a track and around its end.
double residual(const Image<std::uint8_t>& from, const Image<std::uint8_t>& to, const Point& start,
                const Flow& flow) {
  constexpr int reach = 4;
  double sum = 0;
  for (int y = start.y - reach; y <= start.y + reach; ++y)
    for (int x = start.x - reach; x <= start.x + reach; ++x)
      sum += std::abs(reference::bilinear(to, x + flow.x, y + flow.y) -
                      reference::bilinear(from, x, y));
  return sum / ((2 * reach + 1) * (2 * reach + 1));
}

/// Residuals of PointTracker's and OpenCV's tracks at textured pixels: 3 grey levels per pixel.
struct Residuals {
  int block_side;
  double ours = 0;
  double opencv = 0;
  int tracks = 0;
  int found_by_one = 0;

  void add(const Image<std::uint8_t>& from, const Image<std::uint8_t>& to,
           const std::vector<Point>& points) {
    const auto found = tracks_between(from, to, points, block_side);
    const auto theirs = opencv_tracks(from, to, points);
    const auto texture = min_slopes(from);
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (texture.at<float>(points[i].y, points[i].x) < 3) continue;
      ++tracks;
      if (theirs[i].found != found[i].found) {
        ++found_by_one;
      } else if (found[i].found) {
        ours += residual(from, to, points[i], found[i].flow);
        opencv += residual(from, to, points[i], theirs[i].flow);
      }
    }
  }
};

/// tests/flow/track_accuracy_test.cpp compares them where the motion is known.
TEST(Tracks, FitAsWellAsOpenCvs) {
  if (!std::filesystem::exists(video(driving))) GTEST_SKIP() << "no " << video(driving);
  const auto frames = frames_of(video(driving), 38, 640, 480);
  ASSERT_GE(frames.size(), 37U);
  Residuals sparse{2};
  Residuals diff{1};
  for (std::size_t i = 1; i + 1 < frames.size(); i += 8) {
    sparse.add(frames[i], frames[i + 1], reference::changed(frames[i], frames[i + 1], 6));
    for (const int sign : {1, -1}) {
      const auto last = part(frames[i - 1], frames[i], sign, 19);
      diff.add(last, part(frames[i], frames[i + 1], sign, 19), reference::points_of(last));
    }
  }
  const auto check = [](const char* method, const Residuals& residuals) {
    const double count = residuals.tracks - residuals.found_by_one;
    std::printf(
        "driving, %s: %d tracks, mean residual %.3f (OpenCV %.3f) grey levels, %d found by "
        "one only\n",
        method, residuals.tracks, residuals.ours / count, residuals.opencv / count,
        residuals.found_by_one);
    EXPECT_LE(residuals.ours, residuals.opencv * 1.02) << method;
    EXPECT_LT(residuals.found_by_one, residuals.tracks / 50) << method;
  };
  check("sparse", sparse);
  check("diff", diff);
}

/// Mean distance between two flows at textured pixels: a gradient of 4 grey levels per pixel.
double distance(const Image<std::uint8_t>& image, const ImageView<Flow>& a,
                const ImageView<Flow>& b) {
  double sum = 0;
  int count = 0;
  for (int y = 1; y < image.height() - 1; ++y) {
    for (int x = 1; x < image.width() - 1; ++x) {
      if (std::hypot(image.at(x + 1, y) - image.at(x - 1, y),
                     image.at(x, y + 1) - image.at(x, y - 1)) < 8)
        continue;
      sum += std::hypot(a.row(y)[x].x - b.row(y)[x].x, a.row(y)[x].y - b.row(y)[x].y);
      ++count;
    }
  }
  return sum / count;
}

TEST(Farneback, WarpsAsWellAsOpenCv) {
  const auto check = [](const std::string& name, int width, int height) {
    if (!std::filesystem::exists(video(name))) GTEST_SKIP() << "no " << video(name);
    const auto frames = frames_of(video(name), 38, width, height);
    ASSERT_EQ(frames.size(), 38U);
    const auto finder = make_dense_flow(FlowMethod::farneback);
    ThreadPool threads;
    threads.set_threads(0);
    double ours = 0;
    double opencv = 0;
    double apart = 0;
    for (std::size_t i = 1; i < frames.size(); i += 4) {
      const auto flow = finder->find(frames[i - 1].view(), frames[i].view(), threads);
      const auto theirs = opencv_farneback(frames[i - 1], frames[i]);
      ours += psnr(warped(frames[i - 1], flow), frames[i]) / 10;
      opencv += psnr(warped(frames[i - 1], theirs.view()), frames[i]) / 10;
      apart += distance(frames[i - 1], flow, theirs.view()) / 10;
    }
    std::printf("%s, %dx%d, Farneback: warp %.3f dB (OpenCV %.3f), mean distance %.3f pixels\n",
                name.c_str(), width, height, ours, opencv, apart);
    EXPECT_GT(ours, opencv - 0.01);
  };
  check(driving, 640, 480);
  check(driving, 1280, 720);
  check(cars, 768, 432);
}

TEST(Dis, IsWhatOpenCvFinds) {
  if (!std::filesystem::exists(video(driving))) GTEST_SKIP() << "no " << video(driving);
  const auto frames = frames_of(video(driving), 8, 640, 480);
  ASSERT_EQ(frames.size(), 8U);
  ThreadPool threads;
  threads.set_threads(0);
  for (const auto& quality : {DisFlow::low, DisFlow::high}) {
    DisFlow finder(quality);
    finder.push(frames[0].view(), threads);
    for (std::size_t i = 1; i < frames.size(); ++i) {
      finder.push(frames[i].view(), threads);
      const auto ours = finder.flow(threads);
      const auto theirs = opencv_dis(frames[i - 1], frames[i], quality);
      EXPECT_LT(distance(frames[i - 1], ours, theirs.view()), 0.05) << "pair " << i;
      EXPECT_GT(psnr(warped(frames[i - 1], ours), frames[i]),
                psnr(warped(frames[i - 1], theirs.view()), frames[i]) - 0.01)
          << "pair " << i;
    }
  }
}

/// Fraction of events with a match in another set: same polarity, within one pixel and one step.
class Matches {
 public:
  Matches(const std::vector<Event>& events, int width, int height, const StepTimes& steps)
      : width_(width), height_(height), steps_(steps) {
    fired_.resize(static_cast<std::size_t>(steps.count()) * width * height);
    for (const auto& event : events) fired_[place(event.x, event.y(), step(event))] |= bit(event);
  }

  double share(const std::vector<Event>& events) const {
    const auto found = std::count_if(events.begin(), events.end(),
                                     [this](const Event& event) { return has_match(event); });
    return static_cast<double>(found) /
           static_cast<double>(std::max<std::size_t>(1, events.size()));
  }

 private:
  static unsigned char bit(const Event& event) { return event.polarity() == Polarity::on ? 1 : 2; }
  int step(const Event& event) const {
    int j = 1;
    while (steps_.microseconds(j) < event.t) ++j;
    return j;
  }
  std::size_t place(int x, int y, int j) const {
    return (static_cast<std::size_t>(j - 1) * height_ + y) * width_ + x;
  }
  bool has_match(const Event& event) const {
    const int at = step(event);
    for (int j = std::max(1, at - 1); j <= std::min(steps_.count(), at + 1); ++j)
      for (int y = std::max(0, event.y() - 1); y <= std::min(height_ - 1, event.y() + 1); ++y)
        for (int x = std::max(0, event.x - 1); x <= std::min(width_ - 1, event.x + 1); ++x)
          if ((fired_[place(x, y, j)] & bit(event)) != 0) return true;
    return false;
  }

  int width_;
  int height_;
  StepTimes steps_;
  std::vector<unsigned char> fired_;
};

constexpr Nanoseconds interval = 40'000'000;

/// Events of a simulator for the last of a few frames.
std::vector<Event> events_of(Simulator& simulator,
                             const std::vector<const Image<std::uint8_t>*>& frames,
                             double threshold, int interpolated_frames) {
  Settings settings;
  settings.positive_threshold = settings.negative_threshold = threshold;
  settings.interpolated_frames = interpolated_frames;
  std::vector<Event> events;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const auto& frame = *frames[i];
    const LumaView luma{{frame.width(), frame.height(), 8}, frame.row(0), frame.stride()};
    const auto* made = simulator.push(luma, static_cast<Nanoseconds>(i) * interval, settings);
    if (made == nullptr) continue;
    events.resize(made->size());
    made->write_to(events.data(), simulator.threads());
  }
  return events;
}

/// Implementations that replace OpenCV's: nearly all events have a match, in both directions.
void expect_matches(const char* name, const std::vector<Event>& ours,
                    const std::vector<Event>& theirs, int width, int height, const StepTimes& steps,
                    double share = 0.95) {
  const double of_ours = Matches(theirs, width, height, steps).share(ours);
  const double of_theirs = Matches(ours, width, height, steps).share(theirs);
  std::printf("%s: %zu events, %.2f %% of them among OpenCV's %zu, of which %.2f %% are ours\n",
              name, ours.size(), 100 * of_ours, theirs.size(), 100 * of_theirs);
  EXPECT_GE(of_ours, share) << name;
  EXPECT_GE(of_theirs, share) << name;
}

TEST(Events, AreThoseOfOpenCvsFlows) {
  if (!std::filesystem::exists(video(driving))) GTEST_SKIP() << "no " << video(driving);
  const auto frames = frames_of(video(driving), 38, 640, 480);
  ASSERT_GE(frames.size(), 37U);
  constexpr int n = 20;
  constexpr double other_tracks = 0.9;   // PointTracker's are more accurate
  constexpr double ended_tracks = 0.89;  // and end where OpenCV's wander
  constexpr double other_flow = 0.92;    // Farneback's is more accurate too
  const StepTimes steps(interval, n + 1);
  const LumaFormat format{640, 480, 8};
  for (const std::size_t i : {2U, 12U, 22U, 32U}) {
    SCOPED_TRACE(i);
    const auto& before = frames[i - 1];
    const auto& last = frames[i];
    const auto& now = frames[i + 1];
    const auto points = reference::changed(last, now, 6);
    expect_matches(
        "sparse", events_of(*make_sparse_simulator(format), {&last, &now}, 6, n),
        reference::sparse(last, now, points, opencv_tracks(last, now, points), steps, {6, 6}), 640,
        480, steps, ended_tracks);
    const auto d_last = reference::difference_frame(before, last, {19, 19});
    const auto d_now = reference::difference_frame(last, now, {19, 19});
    const auto tracked = [&](int sign) {
      const auto from = reference::part_of(d_last, sign, 8);
      const auto kept = reference::points_of(from);
      return reference::Tracked{kept,
                                opencv_tracks(from, reference::part_of(d_now, sign, 8), kept)};
    };
    expect_matches("diff", events_of(*make_diff_simulator(format), {&before, &last, &now}, 19, n),
                   reference::diff(d_last, d_now, tracked(1), tracked(-1), steps), 640, 480, steps,
                   other_tracks);
    const auto dense = make_dense_simulator(format);
    dense->set_flow(FlowMethod::farneback);
    expect_matches("farneback", events_of(*dense, {&last, &now}, 3, n),
                   reference::dense(last, now, opencv_farneback(last, now).view(),
                                    Interpolation::forward, steps, {3, 3}),
                   640, 480, steps, other_flow);
    const auto expect_dis = [&](const char* name, FlowMethod method,
                                const DisFlow::Quality& quality) {
      const auto simulator = make_dense_simulator(format);
      simulator->set_flow(method);
      expect_matches(name, events_of(*simulator, {&last, &now}, 3, n),
                     reference::dense(last, now, opencv_dis(last, now, quality).view(),
                                      Interpolation::forward, steps, {3, 3}),
                     640, 480, steps, 0.99);
    };
    expect_dis("dis-lq", FlowMethod::dis_lq, DisFlow::low);
    expect_dis("dis-hq", FlowMethod::dis_hq, DisFlow::high);
  }
}

/// Bottles pass under a static camera: flow computed only around them is as complete and accurate
/// as that of the whole frame.
TEST(Events, AreThoseOfTheFlowOfTheWhole) {
  const auto bottles = video("bottles-640x360-30fps.mp4");
  if (!std::filesystem::exists(bottles)) GTEST_SKIP() << "no " << bottles;
  const auto frames = frames_of(bottles, 400, 640, 360);
  ASSERT_EQ(frames.size(), 400U);
  const StepTimes steps(interval, 11);
  ThreadPool threads;
  for (const auto method : flows) {
    double of_part = 0;
    double of_whole = 0;
    double part_events = 0;
    double whole_events = 0;
    double part_error = 0;
    double whole_error = 0;
    for (std::size_t i = 20; i < frames.size(); i += 40) {
      const auto& last = frames[i - 1];
      const auto& now = frames[i];
      RegionOfInterestFlow finder(method, 640, 360);
      const auto changed = reference::changed_box(last, now, 3);
      const auto part = finder.find(last.view(), now.view(), changed, threads);
      const auto whole_finder = make_dense_flow(method);
      const auto whole = whole_finder->find(last.view(), now.view(), threads);
      part_error += square_error(warped(last, part), now);
      whole_error += square_error(warped(last, whole), now);
      const auto events = [&](const ImageView<Flow>& flow) {
        return reference::dense(last, now, flow, Interpolation::forward, steps, {3, 3});
      };
      const auto a = events(part);
      const auto b = events(whole);
      part_events += static_cast<double>(a.size());
      whole_events += static_cast<double>(b.size());
      of_part += Matches(b, 640, 360, steps).share(a) * static_cast<double>(a.size());
      of_whole += Matches(a, 640, 360, steps).share(b) * static_cast<double>(b.size());
    }
    std::printf(
        "bottles, flow %d: of %.0f events %.2f %% are among the whole's %.0f, of which %.2f %% are "
        "among these; warp %+.2f dB\n",
        static_cast<int>(method), part_events, 100 * of_part / part_events, whole_events,
        100 * of_whole / whole_events, 10 * std::log10(whole_error / part_error));
    EXPECT_GE(of_part / part_events, 0.95);
    EXPECT_GE(of_whole / whole_events, 0.95);
    EXPECT_GE(10 * std::log10(whole_error / part_error), -0.1);
  }
}

struct Agreement {
  double pixels = 0;  ///< pixels that change by more than 10 grey levels
  double fired = 0;   ///< of these, those whose polarities do not add up to 0
  double right = 0;   ///< of these, those whose sum has the sign of the difference

  double events = 0;        ///< of all these pixels
  double right_events = 0;  ///< of these, those whose polarity is that of the difference
};

void add_agreement(const Image<std::uint8_t>& last, const Image<std::uint8_t>& now,
                   const std::vector<Event>& events, Agreement& agreement) {
  Image<int> sum(now.width(), now.height());
  for (const auto& e : events) {
    const int polarity = e.polarity() == Polarity::on ? 1 : -1;
    const int difference = now.at(e.x, e.y()) - last.at(e.x, e.y());
    sum.at(e.x, e.y()) += polarity;
    agreement.events += std::abs(difference) > 10;
    agreement.right_events += polarity * difference > 10;
  }
  for (int y = 0; y < now.height(); ++y) {
    for (int x = 0; x < now.width(); ++x) {
      const int difference = now.at(x, y) - last.at(x, y);
      if (std::abs(difference) <= 10) continue;
      ++agreement.pixels;
      agreement.fired += sum.at(x, y) != 0;
      agreement.right += sum.at(x, y) * difference > 0;
    }
  }
}

/// How often the sum of polarities of a pixel's events has the sign of its change, with default
/// settings.
Agreement agreement_of(const std::vector<Image<std::uint8_t>>& frames, FlowMethod method,
                       Interpolation interpolation) {
  const int width = frames.front().width();
  const int height = frames.front().height();
  const auto simulator = make_dense_simulator({width, height, 8});
  simulator->set_flow(method);
  simulator->set_interpolation(interpolation);
  Settings settings;
  settings.positive_threshold = settings.negative_threshold = 2;
  Agreement agreement;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const LumaView luma{{width, height, 8}, frames[i].row(0), frames[i].stride()};
    const auto* made = simulator->push(luma, static_cast<Nanoseconds>(i) * 40'000'000, settings);
    if (made == nullptr) continue;
    std::vector<Event> events(made->size());
    made->write_to(events.data(), simulator->threads());
    add_agreement(frames[i - 1], frames[i], events, agreement);
  }
  return agreement;
}

/// Minimum fractions of pixels and events with the right polarity.
struct AgreementBounds {
  double pixels;
  double events;
};

void expect_agreement(const char* name, const std::vector<Image<std::uint8_t>>& frames,
                      const AgreementBounds& bounds) {
  for (const auto method : flows) {
    for (const auto interpolation : interpolations) {
      const auto agreement = agreement_of(frames, method, interpolation);
      const double share = agreement.right / agreement.fired;
      std::printf(
          "%s, flow %d, interpolation %d: of %.0f pixels %.1f %% fired one way, %.2f %% "
          "of them the right one; %.2f %% of their events\n",
          name, static_cast<int>(method), static_cast<int>(interpolation), agreement.pixels,
          100 * agreement.fired / agreement.pixels, 100 * share,
          100 * agreement.right_events / agreement.events);
      EXPECT_GE(share, bounds.pixels);
      EXPECT_GE(agreement.right_events / agreement.events, bounds.events);
    }
  }
}

TEST(Dense, FiresThePolarityOfTheChange) {
  const auto frames = castel_frames(30);
  if (frames.empty()) GTEST_SKIP() << "no pictures in " << variable("CASTEL");
  expect_agreement("castel", frames, {0.95, 0.95});
}

/// Objects move by 20 pixels and more per frame here: several pass a pixel within one interval, and
/// its polarities, which do not weight the changes, need not add up to their sum.
TEST(Dense, FiresThePolarityOfTheChangeWhereMuchPassesBy) {
  if (!std::filesystem::exists(video(driving))) GTEST_SKIP() << "no " << video(driving);
  expect_agreement("driving", frames_of(video(driving), 5, 1280, 720), {0.83, 0.6});
}

struct Case {
  std::string element;
  std::string name;
  int intervals;
};

void PrintTo(const Case& c, std::ostream* out) {
  *out << c.element << " on " << c.name;
}

class EveryElement : public testing::TestWithParam<Case> {};

std::vector<Case> cases() {
  std::vector<Case> all;
  for (const char* element :
       {"eventsim-frame", "eventsim-dense", "eventsim-sparse", "eventsim-diff"}) {
    all.push_back({element, driving, 5});
    all.push_back({element, cars, 99});
  }
  return all;
}

INSTANTIATE_TEST_SUITE_P(, EveryElement, testing::ValuesIn(cases()));

/// Checks order, bounds, interval and polarity of every event.
TEST_P(EveryElement, MakesSoundEventsOfRealVideo) {
  const auto path = video(GetParam().name);
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "no " << path;
  GstClockTime end = 0;
  double events = 0;
  double on = 0;
  double fast = 0;
  int buffers = 0;
  for_each_sample(
      "filesrc location=\"" + path + "\" ! decodebin ! " + GetParam().element +
          " ! application/x-event-camera ! appsink name=sink sync=false max-buffers=4",
      GetParam().intervals, [&](GstSample* sample) {
        GstEventCameraInfo info;
        ASSERT_TRUE(gst_event_camera_info_from_caps(&info, gst_sample_get_caps(sample)));
        GstBuffer* buffer = gst_sample_get_buffer(sample);
        ASSERT_GE(GST_BUFFER_PTS(buffer), end);
        end = GST_BUFFER_PTS(buffer) + GST_BUFFER_DURATION(buffer);
        GstEventCameraMap map;
        ASSERT_TRUE(gst_event_camera_map(&map, buffer));
        for (gsize i = 0; i < map.n_events; ++i) {
          const auto& e = map.events[i];
          ASSERT_LT(e.x, info.width);
          ASSERT_LT(gst_event_camera_event_get_y(&e), static_cast<guint>(info.height));
          ASSERT_LE(e.t, GST_BUFFER_DURATION(buffer) / 1000);
          on += gst_event_camera_event_is_on(&e);
          if (i == 0) continue;
          const auto& last = map.events[i - 1];
          ASSERT_LT(std::tuple(last.t, gst_event_camera_event_get_y(&last), last.x),
                    std::tuple(e.t, gst_event_camera_event_get_y(&e), e.x));
        }
        events += static_cast<double>(map.n_events);
        fast = std::max(fast, static_cast<double>(map.n_events));
        ++buffers;
        gst_event_camera_unmap(&map);
      });
  std::printf("%s on %s: %.0f events an interval, at most %.0f, %.1f %% ON\n",
              GetParam().element.c_str(), GetParam().name.c_str(), events / buffers, fast,
              100 * on / events);
  EXPECT_EQ(buffers, GetParam().intervals);
  EXPECT_GT(on / events, 0.2);
  EXPECT_LT(on / events, 0.8);
}

}  // namespace
