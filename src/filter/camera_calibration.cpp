// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/filter/camera_calibration.hpp"

#include <yaml.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "src/core/sensor_size.hpp"

namespace eventcamera {
namespace {

using Point = CameraCalibration::Point;

/// libyaml's parser; its events are freed as the next one is parsed.
class YamlParser {
 public:
  explicit YamlParser(std::string_view text) {
    if (yaml_parser_initialize(&parser_) == 0) throw std::bad_alloc();
    yaml_parser_set_input_string(&parser_, reinterpret_cast<const unsigned char*>(text.data()),
                                 text.size());
  }
  ~YamlParser() {
    yaml_event_delete(&event_);
    yaml_parser_delete(&parser_);
  }
  YamlParser(const YamlParser&) = delete;
  YamlParser& operator=(const YamlParser&) = delete;

  /// Valid until the next call. Throws std::invalid_argument.
  const yaml_event_t& next() {
    yaml_event_delete(&event_);
    if (yaml_parser_parse(&parser_, &event_) == 0)
      throw std::invalid_argument("line " + std::to_string(parser_.problem_mark.line + 1) + ": " +
                                  (parser_.problem != nullptr ? parser_.problem : "invalid YAML"));
    return event_;
  }

 private:
  yaml_parser_t parser_{};
  yaml_event_t event_{};
};

/// Maximum number of scalars of an entry that are kept: a 3x4 matrix and its description.
constexpr std::size_t max_scalars = 20;

/// Entries of the outermost mapping, each with its scalars in order.
using Entries = std::map<std::string, std::vector<std::string>>;

Entries entries_of_yaml(std::string_view yaml) {
  // Written by OpenCV's FileStorage, but not valid YAML.
  if (yaml.starts_with("%YAML:")) yaml.remove_prefix(std::min(yaml.find('\n'), yaml.size()));
  YamlParser parser(yaml);
  Entries entries;
  std::vector<std::string>* entry = nullptr;
  for (int depth = 0;;) {
    const auto& event = parser.next();
    switch (event.type) {
      case YAML_MAPPING_START_EVENT:
      case YAML_SEQUENCE_START_EVENT:
        ++depth;
        break;
      case YAML_MAPPING_END_EVENT:
      case YAML_SEQUENCE_END_EVENT:
        if (--depth == 1) entry = nullptr;
        break;
      case YAML_SCALAR_EVENT: {
        const std::string text(reinterpret_cast<const char*>(event.data.scalar.value),
                               event.data.scalar.length);
        if (depth == 1 && entry == nullptr) {
          entry = &entries[text];
        } else if (entry != nullptr) {
          if (entry->size() < max_scalars) entry->push_back(text);
          if (depth == 1) entry = nullptr;
        }
        break;
      }
      case YAML_DOCUMENT_END_EVENT:
      case YAML_STREAM_END_EVENT:
        return entries;
      default:
        break;
    }
  }
}

/// Entries of XML, as OpenCV's FileStorage writes it: without attributes, comments and entities.
Entries entries_of_xml(std::string_view xml) {
  constexpr std::string_view space = " \t\r\n";
  Entries entries;
  std::vector<std::string>* entry = nullptr;
  const auto add = [&entry](std::string_view text) {
    if (entry != nullptr && entry->size() < max_scalars) entry->emplace_back(text);
  };
  int depth = 0;
  while (!xml.empty()) {
    if (!xml.starts_with('<')) {
      const auto end = std::min(xml.find_first_of("< \t\r\n"), xml.size());
      if (end > 0) add(xml.substr(0, end));
      xml.remove_prefix(end);
      xml.remove_prefix(std::min(xml.find_first_not_of(space), xml.size()));
      continue;
    }
    const auto end = xml.find('>');
    if (end == std::string_view::npos) throw std::invalid_argument("its last tag has no end");
    const auto tag = xml.substr(1, end - 1);
    xml.remove_prefix(end + 1);
    if (tag.starts_with('?')) continue;
    if (tag.starts_with('/')) {
      if (--depth == 1) entry = nullptr;
      continue;
    }
    const auto name = tag.substr(0, tag.find_first_of(space));
    if (++depth == 2) entry = &entries[std::string(name)];
    if (name == "data") add(name);
  }
  return entries;
}

double number(const std::string& text, const std::string& name) {
  // Not strtod(), whose decimal separator is the locale's.
  std::string_view digits = text;
  if (digits.starts_with('+')) digits.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error != std::errc() || end != digits.data() + digits.size() || !std::isfinite(value))
    throw std::invalid_argument(name + " has \"" + text + "\" in place of a number");
  return value;
}

const std::vector<std::string>* find(const Entries& entries,
                                     std::initializer_list<const char*> names) {
  for (const char* name : names)
    if (const auto found = entries.find(name); found != entries.end()) return &found->second;
  return nullptr;
}

/// The numbers of a matrix: those after the key `data`, or all.
std::vector<double> matrix(const Entries& entries, std::initializer_list<const char*> names) {
  const std::string name = *names.begin();
  const auto* scalars = find(entries, names);
  if (scalars == nullptr) throw std::invalid_argument("it has no " + name);
  const auto data = std::ranges::find(*scalars, "data");
  std::vector<double> numbers;
  for (auto next = data == scalars->end() ? scalars->begin() : data + 1; next != scalars->end();
       ++next)
    numbers.push_back(number(*next, name));
  return numbers;
}

int side(const Entries& entries, const char* name) {
  const auto* scalars = find(entries, {name});
  if (scalars == nullptr || scalars->empty()) return 0;
  const double value = number(scalars->front(), name);
  if (!(value >= 1 && value <= max_side))
    throw std::invalid_argument(std::string(name) + " is " + scalars->front());
  return static_cast<int>(value);
}

CameraCalibration::Lens lens_of(const Entries& entries) {
  using Lens = CameraCalibration::Lens;
  if (const auto* model = find(entries, {"distortion_model"});
      model != nullptr && !model->empty()) {
    const auto& name = model->front();
    if (name == "equidistant" || name == "fisheye") return Lens::fisheye;
    if (name == "plumb_bob" || name == "radtan") return Lens::plumb_bob;
    throw std::invalid_argument("its distortion_model, " + name +
                                ", is not supported; plumb_bob and equidistant are");
  }
  const auto* fisheye = find(entries, {"fisheye_model"});
  const bool is_fisheye =
      fisheye != nullptr && !fisheye->empty() && number(fisheye->front(), "fisheye_model") != 0;
  return is_fisheye ? Lens::fisheye : Lens::plumb_bob;
}

/// Distorts a point of the plane at distance 1 from the camera.
Point distorted_by_plumb_bob(Point point, const std::array<double, 5>& distortion) {
  const auto [k1, k2, p1, p2, k3] = distortion;
  const auto [x, y] = point;
  const double r2 = x * x + y * y;
  const double radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
  return {x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
          y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y};
}

Point distorted_by_fisheye(Point point, const std::array<double, 5>& distortion) {
  const auto [k1, k2, k3, k4, unused] = distortion;
  const double r = std::hypot(point.x, point.y);
  if (r == 0) return point;
  const double angle = std::atan(r);
  const double a2 = angle * angle;
  const double scale = angle * (1 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4)))) / r;
  return {point.x * scale, point.y * scale};
}

}  // namespace

CameraCalibration::Point CameraCalibration::distorted(Point point) const {
  const Point plane{(point.x - cx) / fx, (point.y - cy) / fy};
  const Point bent = lens == Lens::fisheye ? distorted_by_fisheye(plane, distortion)
                                           : distorted_by_plumb_bob(plane, distortion);
  return {bent.x * fx + cx, bent.y * fy + cy};
}

/// Newton's method with finite differences, starting at the point itself.
CameraCalibration::Point CameraCalibration::undistorted(Point point) const {
  constexpr int max_steps = 50;
  constexpr double accuracy = 1e-6;  // pixels
  constexpr double delta = 1e-3;
  Point guess = point;
  for (int step = 0; step < max_steps; ++step) {
    const Point at = distorted(guess);
    const double dx = at.x - point.x;
    const double dy = at.y - point.y;
    if (std::abs(dx) < accuracy && std::abs(dy) < accuracy) return guess;
    const Point right = distorted({guess.x + delta, guess.y});
    const Point below = distorted({guess.x, guess.y + delta});
    const double xx = (right.x - at.x) / delta;
    const double yx = (right.y - at.y) / delta;
    const double xy = (below.x - at.x) / delta;
    const double yy = (below.y - at.y) / delta;
    const double determinant = xx * yy - xy * yx;
    // The picture folds over where the determinant changes its sign.
    if (!(determinant > 1e-3)) break;
    guess.x -= (yy * dx - xy * dy) / determinant;
    guess.y -= (xx * dy - yx * dx) / determinant;
  }
  constexpr double nowhere = std::numeric_limits<double>::quiet_NaN();
  return {nowhere, nowhere};
}

CameraCalibration parse_calibration(std::string_view text) {
  const Entries entries = text.starts_with("<?xml") ? entries_of_xml(text) : entries_of_yaml(text);
  CameraCalibration calibration;
  const auto camera = matrix(entries, {"camera_matrix", "cameraMatrix", "K"});
  if (camera.size() != 9)
    throw std::invalid_argument("camera_matrix has " + std::to_string(camera.size()) +
                                " numbers, not 9");
  calibration.fx = camera[0];
  calibration.fy = camera[4];
  calibration.cx = camera[2];
  calibration.cy = camera[5];
  if (!(calibration.fx > 0) || !(calibration.fy > 0) || camera[1] != 0 || camera[3] != 0)
    throw std::invalid_argument(
        "camera_matrix is not a valid camera matrix: focal lengths must be positive, without skew");
  calibration.lens = lens_of(entries);
  const auto distortion =
      matrix(entries, {"distortion_coefficients", "dist_coeffs", "distCoeffs", "D"});
  const std::size_t max_count = calibration.lens == CameraCalibration::Lens::fisheye ? 4 : 5;
  for (std::size_t i = 0; i < distortion.size(); ++i) {
    if (i < max_count)
      calibration.distortion.at(i) = distortion[i];
    else if (distortion[i] != 0)
      throw std::invalid_argument("distortion_coefficients has more than " +
                                  std::to_string(max_count) + " that are not 0");
  }
  calibration.size = {side(entries, "image_width"), side(entries, "image_height")};
  return calibration;
}

}  // namespace eventcamera
