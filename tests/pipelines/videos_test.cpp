// SPDX-License-Identifier: LGPL-2.1-or-later
// Real pictures: every event of every element on two videos, and whether interpolation moves
// things the right way. Skips what is not there.
#include <gst/app/gstappsink.h>
#include <gst/gst.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "gst/eventcamera/eventcamera.h"
#include "src/flow/dense_flow.hpp"
#include "src/flow/opencv_picture.hpp"
#include "src/flow/point_tracker.hpp"
#include "src/reference/dense.hpp"
#include "src/reference/diff.hpp"
#include "src/reference/sparse.hpp"
#include "tests/pipelines/video_frames.hpp"

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

/// The grey pictures of the hand-held sequence in Debian's package visp-images-data.
std::vector<Plane<std::uint8_t>> castel_frames(int count) {
  std::vector<Plane<std::uint8_t>> frames;
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

double psnr(const Plane<std::uint8_t>& a, const Plane<std::uint8_t>& b) {
  double sum = 0;
  for (int y = 0; y < a.height(); ++y)
    for (int x = 0; x < a.width(); ++x) sum += std::pow(a.at(x, y) - b.at(x, y), 2);
  return 10 * std::log10(255.0 * 255.0 * a.width() * a.height() / sum);
}

constexpr FlowMethod flows[] = {FlowMethod::dis_lq, FlowMethod::dis_hq, FlowMethod::farneback};
constexpr Interpolation interpolations[] = {Interpolation::forward, Interpolation::blend};

/// The warp of I(i-1) with all of its flow.
Plane<std::uint8_t> warped(const Plane<std::uint8_t>& last, const PlaneView<Flow>& flow) {
  Plane<std::uint8_t> result(last.width(), last.height());
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
    const auto finder = make_dense_flow(method, 1280, 720);
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

/// The 8-bit difference frame of one polarity (1 or -1).
Plane<std::uint8_t> part(const Plane<std::uint8_t>& last, const Plane<std::uint8_t>& now, int sign,
                         int threshold) {
  Plane<std::uint8_t> result(now.width(), now.height());
  for (int y = 0; y < now.height(); ++y)
    for (int x = 0; x < now.width(); ++x)
      if (const int rise = sign * (now.at(x, y) - last.at(x, y)); rise > threshold)
        result.at(x, y) = static_cast<std::uint8_t>(rise);
  return result;
}

/// The slope about each pixel (15x15, root of the mean square, grey levels a pixel) in the
/// direction in which it is least.
cv::Mat least_slopes(const Plane<std::uint8_t>& picture) {
  cv::Mat x;
  cv::Mat y;
  cv::Scharr(opencv_picture(picture.view()), x, CV_32F, 1, 0, 1 / 32.0);
  cv::Scharr(opencv_picture(picture.view()), y, CV_32F, 0, 1, 1 / 32.0);
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

/// How far our tracks end from OpenCV's, where there is texture: 3 grey levels a pixel.
struct TrackErrors {
  float disagreement;
  double sum = 0;
  int tracks = 0;
  int found_by_one = 0;

  void add(const Plane<std::uint8_t>& from, const Plane<std::uint8_t>& to,
           const std::vector<Point>& points) {
    PointTracker tracker(disagreement);
    ThreadPool threads;
    tracker.push(from.view(), threads);
    tracker.push(to.view(), threads);
    const auto ours = tracker.track(points, threads);
    std::vector<cv::Point2f> starts;
    for (const auto& point : points)
      starts.emplace_back(static_cast<float>(point.x), static_cast<float>(point.y));
    std::vector<cv::Point2f> ends;
    std::vector<unsigned char> status;
    std::vector<float> error;
    cv::calcOpticalFlowPyrLK(opencv_picture(from.view()), opencv_picture(to.view()), starts, ends,
                             status, error, {15, 15}, 3, {3, 10, 0.03});
    const auto texture = least_slopes(from);
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (texture.at<float>(points[i].y, points[i].x) < 3) continue;
      ++tracks;
      if ((status[i] != 0) != ours[i].found)
        ++found_by_one;
      else if (ours[i].found)
        sum += std::hypot(ours[i].flow.x - (ends[i].x - starts[i].x),
                          ours[i].flow.y - (ends[i].y - starts[i].y));
    }
  }
};

TEST(Tracks, AreThoseOfOpenCv) {
  if (!std::filesystem::exists(video(driving))) GTEST_SKIP() << "no " << video(driving);
  const auto frames = frames_of(video(driving), 38, 640, 480);
  ASSERT_GE(frames.size(), 37U);
  TrackErrors sparse{disagreement_of_frames};
  TrackErrors diff{disagreement_of_differences};
  for (std::size_t i = 1; i + 1 < frames.size(); i += 4) {
    sparse.add(frames[i], frames[i + 1], reference::changed(frames[i], frames[i + 1], 6));
    for (const int sign : {1, -1}) {
      const auto last = part(frames[i - 1], frames[i], sign, 19);
      diff.add(last, part(frames[i], frames[i + 1], sign, 19), reference::points_of(last));
    }
  }
  const auto check = [](const char* method, const TrackErrors& errors) {
    const double mean = errors.sum / (errors.tracks - errors.found_by_one);
    std::printf("driving, %s: %d tracks, mean end-point error %.3f pixel, %d found by one only\n",
                method, errors.tracks, mean, errors.found_by_one);
    EXPECT_LT(mean, 0.1) << method;
    EXPECT_LT(errors.found_by_one, errors.tracks / 200) << method;
  };
  check("sparse", sparse);
  check("diff", diff);
}

/// OpenCV's function of the same method, with the same parameters.
Plane<Flow> opencv_farneback(const Plane<std::uint8_t>& from, const Plane<std::uint8_t>& to) {
  Plane<Flow> flow(from.width(), from.height());
  cv::Mat mat(from.height(), from.width(), CV_32FC2, flow.row(0));
  cv::calcOpticalFlowFarneback(opencv_picture(from.view()), opencv_picture(to.view()), mat, 0.5, 3,
                               15, 3, 5, 1.2, 0);
  return flow;
}

/// The mean distance between two flows where the picture has texture: a gradient of 4 grey levels
/// a pixel.
double distance(const Plane<std::uint8_t>& picture, const PlaneView<Flow>& a,
                const PlaneView<Flow>& b) {
  double sum = 0;
  int count = 0;
  for (int y = 1; y < picture.height() - 1; ++y) {
    for (int x = 1; x < picture.width() - 1; ++x) {
      if (std::hypot(picture.at(x + 1, y) - picture.at(x - 1, y),
                     picture.at(x, y + 1) - picture.at(x, y - 1)) < 8)
        continue;
      sum += std::hypot(a.row(y)[x].x - b.row(y)[x].x, a.row(y)[x].y - b.row(y)[x].y);
      ++count;
    }
  }
  return sum / count;
}

TEST(Farneback, IsWhatOpenCvFinds) {
  if (!std::filesystem::exists(video(driving))) GTEST_SKIP() << "no " << video(driving);
  const auto frames = frames_of(video(driving), 8, 640, 480);
  ASSERT_EQ(frames.size(), 8U);
  const auto finder = make_dense_flow(FlowMethod::farneback, 640, 480);
  ThreadPool threads;
  threads.set_threads(0);
  finder->push(frames[0].view(), threads);
  for (std::size_t i = 1; i < frames.size(); ++i) {
    finder->push(frames[i].view(), threads);
    const auto ours = finder->flow(threads);
    const auto theirs = opencv_farneback(frames[i - 1], frames[i]);
    EXPECT_LT(distance(frames[i - 1], ours, theirs.view()), 0.01) << "pair " << i;
    EXPECT_NEAR(psnr(warped(frames[i - 1], ours), frames[i]),
                psnr(warped(frames[i - 1], theirs.view()), frames[i]), 0.01)
        << "pair " << i;
  }
}

struct Agreement {
  double pixels = 0;  ///< that differ by more than 10 grey levels
  double fired = 0;   ///< of these, those whose polarities do not add up to 0
  double right = 0;   ///< of these, those whose sum has the sign of the difference
};

void add_agreement(const Plane<std::uint8_t>& last, const Plane<std::uint8_t>& now,
                   const std::vector<Event>& events, Agreement& agreement) {
  Plane<int> sum(now.width(), now.height());
  for (const auto& e : events) sum.at(e.x, e.y()) += e.polarity() == Polarity::on ? 1 : -1;
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

/// How often the polarities of a pixel's events add up to the sign of its change, at the default
/// settings.
Agreement agreement_of(const std::vector<Plane<std::uint8_t>>& frames, FlowMethod method,
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
    made->copy_to(events.data());
    add_agreement(frames[i - 1], frames[i], events, agreement);
  }
  return agreement;
}

void expect_agreement(const char* name, const std::vector<Plane<std::uint8_t>>& frames,
                      double forward, double blend) {
  for (const auto method : flows) {
    for (const auto interpolation : interpolations) {
      const auto agreement = agreement_of(frames, method, interpolation);
      const double share = agreement.right / agreement.fired;
      std::printf(
          "%s, flow %d, interpolation %d: of %.0f pixels %.1f %% fired one way, %.2f %% "
          "of them the right one\n",
          name, static_cast<int>(method), static_cast<int>(interpolation), agreement.pixels,
          100 * agreement.fired / agreement.pixels, 100 * share);
      EXPECT_GE(share, interpolation == Interpolation::forward ? forward : blend);
    }
  }
}

TEST(Dense, FiresThePolarityOfTheChange) {
  const auto frames = castel_frames(10);
  if (frames.empty()) GTEST_SKIP() << "no pictures in " << variable("CASTEL");
  expect_agreement("castel", frames, 0.95, 0.95);
}

/// Here things move 20 pixels and more a frame: a pixel sees several of them pass within one
/// interval, and its polarities, which do not weigh the changes, need not add up to their sum.
TEST(Dense, FiresThePolarityOfTheChangeWhereMuchPassesBy) {
  if (!std::filesystem::exists(video(driving))) GTEST_SKIP() << "no " << video(driving);
  expect_agreement("driving", frames_of(video(driving), 5, 1280, 720), 0.83, 0.86);
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

/// Order, bounds, interval and polarity of every event.
TEST_P(EveryElement, MakesSoundEventsOfRealVideo) {
  const auto path = video(GetParam().name);
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "no " << path;
  GstClockTime end = 0;
  double events = 0;
  double on = 0;
  double fast = 0;
  int buffers = 0;
  for_each_sample(
      "filesrc location=" + path + " ! decodebin ! " + GetParam().element +
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
