// SPDX-License-Identifier: LGPL-2.1-or-later
// Filters that move events do what their plain definitions say, however a stream is cut into
// buffers; calibrations and masks from files.
#include <gtest/gtest.h>
#include <png.h>

#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "src/filter/camera_calibration.hpp"
#include "src/filter/crop_filter.hpp"
#include "src/filter/flip_filter.hpp"
#include "src/filter/pixel_mask.hpp"
#include "src/filter/polarity_filter.hpp"
#include "src/filter/scale_filter.hpp"
#include "src/filter/undistort_filter.hpp"
#include "tests/filter/streams.hpp"

namespace {

using namespace streams;
using eventcamera::CameraCalibration;
using eventcamera::CropFilter;
using eventcamera::FlipFilter;
using eventcamera::Orientation;
using eventcamera::PixelMask;
using eventcamera::PolarityFilter;
using eventcamera::ScaleFilter;
using eventcamera::UndistortFilter;

using Pixel = std::pair<int, int>;

constexpr SensorSize sensor{37, 23};

namespace reference {

/// Moves each event to the pixel that move(x, y) returns, if any.
template <class Move>
Events moved(const Events& events, const Move& move) {
  Events result;
  for (const auto& event : events)
    if (const std::optional<Pixel> pixel = move(event.x, event.y()))
      result.push_back(AbsoluteEvent::at(pixel->first, pixel->second, event.t, event.polarity()));
  return result;
}

/// Events of the output's pixels: the last of `min_events`, but not two in a microsecond.
Events scaled(const Events& events, SensorSize in, SensorSize out, unsigned min_events) {
  struct Cell {
    unsigned count = 0;
    std::optional<Microseconds> last{};
  };
  std::map<std::tuple<int, int, Polarity>, Cell> cells;
  Events result;
  for (const auto& event : events) {
    const int x = event.x * out.width / in.width;
    const int y = event.y() * out.height / in.height;
    auto& cell = cells[{x, y, event.polarity()}];
    if (++cell.count < min_events) continue;
    cell.count = 0;
    if (cell.last == event.t) continue;
    cell.last = event.t;
    result.push_back(AbsoluteEvent::at(x, y, event.t, event.polarity()));
  }
  return result;
}

}  // namespace reference

/// A filter that depends on neither time nor settings, as others.
template <class Core>
struct Adapted {
  struct Settings {};
  Core core;

  LabelledEvents filter(LabelledEvents events, Microseconds, const Settings&) {
    return core.filter(events);
  }
};

Events streams_of_all_pixels() {
  Events events = random_events(sensor, 20'000, 3, 1);
  const Events scene = made_scene(sensor);
  events.insert(events.end(), scene.begin(), scene.end());
  sort_by_time(events);
  return events;
}

template <class Make>
void expect_same(const Make& make, const auto& settings, const Events& events,
                 const Events& expected) {
  for (const std::size_t max_buffer : {std::size_t{1}, std::size_t{60}, std::size_t{60'000}}) {
    for (const bool is_labelled : {false, true}) {
      auto core = make();
      EXPECT_TRUE(filtered(core, events, settings, max_buffer, 7, is_labelled) == expected)
          << "buffers of " << max_buffer;
    }
  }
}

TEST(Crop, KeepsARegion) {
  const Events events = streams_of_all_pixels();
  const CropFilter::Settings regions[] = {
      {}, {.left = 3}, {.right = 36}, {.top = 22}, {.left = 5, .right = 6, .top = 7, .bottom = 8}};
  for (const auto& region : regions) {
    const SensorSize out{sensor.width - static_cast<int>(region.left + region.right),
                         sensor.height - static_cast<int>(region.top + region.bottom)};
    expect_same([&] { return CropFilter(sensor, out); }, region, events,
                reference::moved(events, [&](int x, int y) -> std::optional<Pixel> {
                  const int column = x - static_cast<int>(region.left);
                  const int row = y - static_cast<int>(region.top);
                  if (column < 0 || row < 0 || column >= out.width || row >= out.height) return {};
                  return Pixel(column, row);
                }));
  }
}

TEST(Flip, HasEightWays) {
  const Events events = streams_of_all_pixels();
  for (int way = 0; way < 8; ++way) {
    const Orientation orientation{(way & 1) != 0, (way & 2) != 0, (way & 4) != 0};
    const SensorSize out = orientation.size(sensor);
    expect_same([&] { return Adapted<FlipFilter>{FlipFilter(sensor, orientation)}; },
                Adapted<FlipFilter>::Settings{}, events,
                reference::moved(events, [&](int x, int y) -> std::optional<Pixel> {
                  if (orientation.transpose) std::swap(x, y);
                  return Pixel(orientation.mirror_x ? out.width - 1 - x : x,
                               orientation.mirror_y ? out.height - 1 - y : y);
                }));
  }
}

TEST(Polarity, IsKeptOrInverted) {
  const Events events = streams_of_all_pixels();
  using Kept = PolarityFilter::Kept;
  for (const auto keep : {Kept::both, Kept::on, Kept::off}) {
    for (const bool invert : {false, true}) {
      Events expected;
      for (const auto& event : events) {
        const bool is_on = event.polarity() == Polarity::on;
        if (keep != Kept::both && is_on != (keep == Kept::on)) continue;
        expected.push_back(AbsoluteEvent::at(event.x, event.y(), event.t,
                                             is_on != invert ? Polarity::on : Polarity::off));
      }
      expect_same([] { return PolarityFilter(sensor); }, PolarityFilter::Settings{keep, invert},
                  events, expected);
    }
  }
}

TEST(Scale, MergesAndCounts) {
  const Events streams[] = {streams_of_all_pixels(), random_events(sensor, 5000, 0, 3),
                            random_events({2, 2}, 20'000, 5, 4)};
  for (const auto& events : streams)
    for (const SensorSize out : {SensorSize{18, 11}, {10, 23}, {1, 1}, {80, 50}})
      for (const unsigned min_events : {1U, 4U})
        expect_same([&] { return ScaleFilter(sensor, out); }, ScaleFilter::Settings{min_events},
                    events, reference::scaled(events, sensor, out, min_events));
}

/// More microseconds with events than there are numbers for them.
TEST(Scale, MergesWhereMomentsStartOver) {
  Events events;
  for (Microseconds t = 0; t < 140'000; ++t)
    events.insert(events.end(), 1 + static_cast<std::size_t>(t % 3 == 0),
                  AbsoluteEvent::at(static_cast<int>(t % 37), 3, t, Polarity::on));
  ScaleFilter core(sensor, {10, 10});
  EXPECT_TRUE(filtered(core, events, {1}, 10'000) ==
              reference::scaled(events, sensor, {10, 10}, 1));
}

TEST(Scale, ForgetsWhatItCounted) {
  const Events events = streams_of_all_pixels();
  ScaleFilter core(sensor, {10, 10});
  const auto first = filtered(core, events, {3}, 1000);
  core.forget();
  EXPECT_TRUE(filtered(core, events, {3}, 1000) == first);
}

/* masks */

/// A PNG picture, whose pixels have one byte for each component of the format.
std::string png_of(int width, int height, unsigned format, const std::vector<png_byte>& pixels) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(width);
  image.height = static_cast<png_uint_32>(height);
  image.format = format;
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(image);
  std::string png(size, '\0');
  EXPECT_NE(png_image_write_to_memory(&image, png.data(), &size, 0, pixels.data(), 0, nullptr), 0);
  png.resize(size);
  return png;
}

TEST(Mask, KeepsBrightPixels) {
  std::vector<png_byte> pixels;
  for (int i = 0; i < sensor.width * sensor.height; ++i)
    pixels.push_back(static_cast<png_byte>(i * 7));
  const auto png = png_of(sensor.width, sensor.height, PNG_FORMAT_GRAY, pixels);
  const auto mask = PixelMask::parse_png(png, sensor);
  const Events events = streams_of_all_pixels();
  expect_same([&] { return Adapted<PixelMask>{mask}; }, Adapted<PixelMask>::Settings{}, events,
              reference::moved(events, [&](int x, int y) -> std::optional<Pixel> {
                if (pixels[static_cast<std::size_t>(y * sensor.width + x)] < 128) return {};
                return Pixel(x, y);
              }));
}

TEST(Mask, TakesTransparentPixelsAsBlack) {
  const auto png = png_of(2, 1, PNG_FORMAT_RGBA, {255, 255, 255, 0, 255, 255, 255, 255});
  const auto mask = PixelMask::parse_png(png, {2, 1});
  EXPECT_FALSE(mask.keeps(0, 0));
  EXPECT_TRUE(mask.keeps(1, 0));
}

template <class Error, class Work>
std::string error_of(const Work& work) {
  try {
    work();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(Mask, RefusesOtherSizesAndOtherFiles) {
  const auto png = png_of(2, 1, PNG_FORMAT_GRAY, {0, 0});
  EXPECT_EQ(error_of<std::runtime_error>([&] {
              PixelMask::parse_png(png, {2, 2});
            }),
            "it has 2 x 1 pixels, but the sensor has 2 x 2 pixels");
  EXPECT_NE(error_of<std::runtime_error>([&] {
              PixelMask::parse_png("no picture", {2, 2});
            }),
            "no error");
}

/* calibrations */

/// As OpenCV writes it.
std::string opencv_yaml(const std::string& distortion, const std::string& more = "") {
  return "%YAML:1.0\n---\ncalibration_time: \"Mon 01 Jan 2024\"\nimage_width: 346\n"
         "image_height: 260\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
         "   data: [ 250., 0., 172.5, 0., 2.52e+02, 130.,\n       0., 0., 1. ]\n"
         "distortion_coefficients: !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n   data: [ " +
         distortion + " ]\n" + more;
}

TEST(Calibration, IsReadFromOpenCv) {
  const auto calibration =
      eventcamera::parse_calibration(opencv_yaml("-0.35, +0.12, 1.e-03, -5.e-04, -0.02"));
  EXPECT_EQ(calibration.lens, CameraCalibration::Lens::plumb_bob);
  EXPECT_EQ(calibration.size, (SensorSize{346, 260}));
  EXPECT_EQ(calibration.fx, 250);
  EXPECT_EQ(calibration.fy, 252);
  EXPECT_EQ(calibration.cx, 172.5);
  EXPECT_EQ(calibration.cy, 130);
  EXPECT_EQ(calibration.distortion, (std::array{-0.35, 0.12, 1e-3, -5e-4, -0.02}));
  EXPECT_EQ(eventcamera::parse_calibration(opencv_yaml("0.1, 0, 0, 0", "fisheye_model: 1\n")).lens,
            CameraCalibration::Lens::fisheye);
}

TEST(Calibration, IsReadFromRos) {
  const auto calibration = eventcamera::parse_calibration(
      "image_width: 640\nimage_height: 480\ncamera_name: davis\ncamera_matrix:\n  rows: 3\n  cols: "
      "3\n  data: [300, 0, 320, 0, 301, 240, 0, 0, 1]\ndistortion_model: equidistant\n"
      "distortion_coefficients:\n  rows: 1\n  cols: 4\n  data: [0.1, 0.01, 0, 0]\n"
      "rectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n");
  EXPECT_EQ(calibration.lens, CameraCalibration::Lens::fisheye);
  EXPECT_EQ(calibration.fy, 301);
  EXPECT_EQ(calibration.distortion[1], 0.01);
}

/// As GStreamer's cameracalibrate writes its property `settings`.
std::string opencv_xml(const std::string& distortion) {
  return "<?xml version=\"1.0\"?>\n<opencv_storage>\n<cameraMatrix type_id=\"opencv-matrix\">\n"
         "  <rows>3</rows>\n  <cols>3</cols>\n  <dt>d</dt>\n  <data>\n    250. 0. 1.725e+02 0.\n"
         "    252. 130. 0. 0. 1.</data></cameraMatrix>\n"
         "<distCoeffs type_id=\"opencv-matrix\">\n  <rows>5</rows>\n  <data>\n    " +
         distortion + "</data></distCoeffs>\n</opencv_storage>\n";
}

TEST(Calibration, IsReadFromXml) {
  const auto calibration = eventcamera::parse_calibration(opencv_xml("-3.5e-01 0.12 0 0\n -.02"));
  EXPECT_EQ(calibration.lens, CameraCalibration::Lens::plumb_bob);
  EXPECT_EQ(calibration.size, SensorSize());
  EXPECT_EQ(calibration.fx, 250);
  EXPECT_EQ(calibration.fy, 252);
  EXPECT_EQ(calibration.cx, 172.5);
  EXPECT_EQ(calibration.cy, 130);
  EXPECT_EQ(calibration.distortion, (std::array{-0.35, 0.12, 0.0, 0.0, -0.02}));
  const auto sized =
      opencv_xml("0").insert(opencv_xml("").find("<distCoeffs"), "<image_width>346</image_width>");
  EXPECT_EQ(eventcamera::parse_calibration(sized).size.width, 346);
}

TEST(Calibration, SaysWhatIsWrong) {
  const std::pair<std::string, std::string> errors[] = {
      {"", "no camera_matrix"},
      {"a: [", "line"},
      {"<?xml?>", "no camera_matrix"},
      {"<?xml?><a", "no end"},
      {opencv_xml("x"), "\"x\" in place of a number"},
      {"camera_matrix: [1, 2]", "2 numbers, not 9"},
      {"camera_matrix: [0, 0, 0, 0, 1, 0, 0, 0, 1]", "focal"},
      {opencv_yaml("0, 0, 0, 0, 0, 0.1"), "more than 5"},
      {opencv_yaml("0", "distortion_model: odd\n"), "odd"}};
  for (const auto& [file, words] : errors) {
    const auto error =
        error_of<std::invalid_argument>([&text = file] { eventcamera::parse_calibration(text); });
    EXPECT_NE(error.find(words), std::string::npos) << error;
  }
}

/// Undistorting is the inverse of the model's equations.
TEST(Undistort, InvertsTheModel) {
  const char* const lenses[] = {"-0.35, 0.12, 1.e-03, -5.e-04, -0.02", "0.2, 0.05, 0, 0, 0"};
  for (const char* lens : lenses) {
    for (const char* model : {"fisheye_model: 0\n", "fisheye_model: 1\n"}) {
      const auto calibration = eventcamera::parse_calibration(opencv_yaml(
          model == std::string("fisheye_model: 1\n") ? "0.05, 0.01, -0.01, 0" : lens, model));
      for (int y = 0; y < 260; y += 13) {
        for (int x = 0; x < 346; x += 7) {
          const auto point = calibration.undistorted({double(x), double(y)});
          const auto back = calibration.distorted(point);
          EXPECT_NEAR(back.x, x, 1e-4);
          EXPECT_NEAR(back.y, y, 1e-4);
        }
      }
    }
  }
}

TEST(Undistort, FollowsTheEquations) {
  // k1 = -0.1, k2 = 0.01, p1 = 0.002, p2 = 0.003, k3 = 0.001 at (0.5, -0.25), by hand.
  const auto calibration =
      eventcamera::parse_calibration(opencv_yaml("-0.1, 0.01, 2e-3, 3e-3, 1e-3"));
  const double r2 = 0.3125;
  const double radial = 1 - 0.1 * r2 + 0.01 * r2 * r2 + 0.001 * r2 * r2 * r2;
  const double x = 0.5 * radial + 2 * 0.002 * 0.5 * -0.25 + 0.003 * (r2 + 2 * 0.25);
  const double y = -0.25 * radial + 0.002 * (r2 + 2 * 0.0625) + 2 * 0.003 * 0.5 * -0.25;
  const auto point = calibration.distorted({172.5 + 250 * 0.5, 130 - 252 * 0.25});
  EXPECT_NEAR(point.x, 172.5 + 250 * x, 1e-9);
  EXPECT_NEAR(point.y, 130 + 252 * y, 1e-9);
}

TEST(Undistort, MovesEventsAndDropsThoseThatLeaveThePicture) {
  const CameraCalibration calibration{
      .fx = 20, .fy = 21, .cx = 18, .cy = 11, .distortion = {-0.4, 0.1, 0.01, 0, 0}};
  const Events events = streams_of_all_pixels();
  const auto expected = reference::moved(events, [&](int x, int y) -> std::optional<Pixel> {
    const auto point = calibration.undistorted({double(x), double(y)});
    const double column = std::floor(point.x + 0.5);
    const double row = std::floor(point.y + 0.5);
    if (!(column >= 0 && row >= 0 && column < sensor.width && row < sensor.height)) return {};
    return Pixel(static_cast<int>(column), static_cast<int>(row));
  });
  EXPECT_GT(expected.size(), events.size() / 4);
  EXPECT_LT(expected.size(), events.size());
  expect_same([&] { return Adapted<UndistortFilter>{UndistortFilter(sensor, calibration)}; },
              Adapted<UndistortFilter>::Settings{}, events, expected);
}

}  // namespace
