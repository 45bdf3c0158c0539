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

#include "gst/eventcamera/eventcamera.h"
#include "src/flow/dense_flow.hpp"
#include "src/flow/region_of_interest_flow.hpp"
#include "src/simulate/dense_simulator.hpp"
#include "tests/pipelines/video_frames.hpp"
#include "tests/reference/dense.hpp"

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
