// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/image.hpp"
#include "src/core/label.hpp"
#include "src/dvs/dvs_settings.hpp"
#include "src/dvs/pixel_model.hpp"
#include "src/flow/dense_flow.hpp"

/// Reference equations of the physical pixel, implemented literally, in double precision and in
/// order of time.
namespace eventcamera::reference {

/// out(x, y) = round(I(x, y) + sum over i, j in {-1, 0, 1} of
///   w(i) w(j) clamp(I(x + i, y + j) - I(x, y), -limit, limit)), w = 1/4, 1/2, 1/4;
/// halves are rounded up, the border is replicated.
template <class Pixel>
Image<Pixel> denoised(const ImageView<Pixel>& frame, int limit) {
  Image<Pixel> out(frame.width, frame.height);
  const auto weight = [](int i) { return i == 0 ? 0.5 : 0.25; };
  for (int y = 0; y < frame.height; ++y) {
    for (int x = 0; x < frame.width; ++x) {
      const int centre = frame.row(y)[x];
      double value = centre;
      for (int j = -1; j <= 1; ++j)
        for (int i = -1; i <= 1; ++i) {
          const int neighbour = frame.row(
              std::clamp(y + j, 0, frame.height - 1))[std::clamp(x + i, 0, frame.width - 1)];
          value += weight(i) * weight(j) * std::clamp(neighbour - centre, -limit, limit);
        }
      out.at(x, y) = static_cast<Pixel>(std::floor(value + 0.5));
    }
  }
  return out;
}

/// The sharp light L of a frame I (white is 255, plus half a grey level) that is its mean along
/// `path(x, y)`, which has dx, dy and length:
///   mean(J)(x) = 1 / length sum over j of w(j) J(x + j (dx, dy)),
///   w(j) = clamp(length / 2 + 1/2 - |j|, 0, 1)
///   L = L * mean(min(I / mean(L), 4))^2, repeated, at first L = I.
/// Samples are bilinear, the border is replicated. Returns L - 1/2, in [0, 255].
template <class Pixel, class PathOf>
Image<double> deblurred(const Image<Pixel>& frame, int bits, int iterations, const PathOf& path) {
  const int width = frame.width();
  const int height = frame.height();
  const auto map = [&](const auto& value) {
    Image<double> out(width, height);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) out.at(x, y) = value(x, y);
    return out;
  };
  const auto sample = [&](const Image<double>& image, double x, double y) {
    x = std::clamp(x, 0.0, width - 1.0);
    y = std::clamp(y, 0.0, height - 1.0);
    const int left = static_cast<int>(x);
    const int top = static_cast<int>(y);
    const auto row = [&](int v) {
      return std::lerp(image.at(left, v), image.at(std::min(left + 1, width - 1), v), x - left);
    };
    return std::lerp(row(top), row(std::min(top + 1, height - 1)), y - top);
  };
  const auto mean = [&](const Image<double>& image, int x, int y) {
    const auto& along = path(x, y);
    const int reach = static_cast<int>(along.length);
    double sum = 0;
    for (int j = -reach; j <= reach; ++j)
      sum += std::clamp(along.length / 2 + 0.5 - std::abs(j), 0.0, 1.0) *
             sample(image, x + j * along.dx, y + j * along.dy);
    return sum / along.length;
  };
  const auto light =
      map([&](int x, int y) { return frame.at(x, y) * 255.0 / ((1 << bits) - 1) + 0.5; });
  auto found = light;
  for (int i = 0; i < iterations; ++i) {
    const auto ratio =
        map([&](int x, int y) { return std::min(light.at(x, y) / mean(found, x, y), 4.0); });
    found = map([&](int x, int y) {
      const double gain = mean(ratio, x, y);
      return found.at(x, y) * gain * gain;
    });
  }
  return map([&](int x, int y) { return std::clamp(found.at(x, y) - 0.5, 0.0, 255.0); });
}

/// Gain of the exposure from one frame to the next:
///   usable   a pixel whose luma is above 16/255 and below 235/255 of white in both frames
///   block    8x8 pixels, half of them usable: d = ln(sum of light now / sum of light before)
///   region   one of 4x4, by equal numbers of blocks: m = median of d
///   gain     g = exp(median of m), if there are 8 regions, 1.01 <= max(g, 1/g) <= 1.25, and 3/4 of
///            the regions have |m - ln g| <= |ln g| / 2; 1 otherwise
/// Light as in DvsPixel; of two values in the middle, the median is the upper one.
template <class Pixel>
double exposure_gain(const ImageView<Pixel>& last, const ImageView<Pixel>& now, int bits,
                     bool linear_light) {
  const double white = (1 << bits) - 1;
  const auto is_usable = [&](double luma) {
    return 255 * luma > 16 * white && 255 * luma < 235 * white;
  };
  const auto light = [&](double luma) {
    return linear_light ? std::pow((luma / white + 0.055) / 1.055, 2.4) : luma / white;
  };
  const auto median = [](std::vector<double> values) {
    std::sort(values.begin(), values.end());
    return values[values.size() / 2];
  };
  const int columns = (now.width + 7) / 8;
  const int rows = (now.height + 7) / 8;
  std::map<std::pair<int, int>, std::vector<double>> regions;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      double before = 0;
      double after = 0;
      int usable = 0;
      for (int y = 8 * row; y < std::min(8 * row + 8, now.height); ++y)
        for (int x = 8 * column; x < std::min(8 * column + 8, now.width); ++x)
          if (is_usable(last.row(y)[x]) && is_usable(now.row(y)[x])) {
            before += light(last.row(y)[x]);
            after += light(now.row(y)[x]);
            ++usable;
          }
      if (usable >= 32)
        regions[{4 * row / rows, 4 * column / columns}].push_back(std::log(after / before));
    }
  }
  if (regions.size() < 8) return 1;
  std::vector<double> medians;
  for (const auto& [place, changes] : regions) medians.push_back(median(changes));
  const double change = median(medians);
  if (std::abs(change) < std::log(1.01) || std::abs(change) > std::log(1.25)) return 1;
  double agreeing = 0;
  for (const double other : medians)
    agreeing += std::abs(other - change) <= std::abs(change) / 2 ? 1 : 0;
  return agreeing >= 0.75 * static_cast<double>(medians.size()) ? std::exp(change) : 1;
}

/// Upsampling along the flow F: a tile of 32x8 pixels is divided into steps by its longest motion
/// along an axis,
///   m = max over the tile of |F.x| and |F.y|; NaN counts as 0
///   n = ceil(m <= 4 ? m : sqrt(4 m)), in 1 ... max
inline int steps_of_tile(const Image<Flow>& flow, int x, int y, int max) {
  float longest = 0;
  for (int v = y / 8 * 8; v < std::min(y / 8 * 8 + 8, flow.height()); ++v)
    for (int u = x / 32 * 32; u < std::min(x / 32 * 32 + 32, flow.width()); ++u)
      for (const float motion : {flow.at(u, v).x, flow.at(u, v).y})
        if (!std::isnan(motion)) longest = std::max(longest, std::abs(motion));
  const float steps = longest > 4 ? std::sqrt(4 * longest) : longest;
  return static_cast<int>(std::min(std::max(std::ceil(steps), 1.0F), static_cast<float>(max)));
}

/// Luma of a pixel at step j of n, a = j/n, in grey levels of the frames:
///   (1 - a) I(x - a F) + a J(x + (1 - a) F)
/// I, J bilinear with a replicated border; F/n is rounded to 1/65536 of a pixel, positions are to
/// 1/64, a as a weight to 1/256. NaN counts as 0.
template <class Pixel>
double moving_luma(const Image<Pixel>& earlier, const Image<Pixel>& later, const Flow& flow, int x,
                   int y, int j, int n) {
  const auto per_step = [&](double motion) {
    const double clamped = std::isnan(motion) ? 0 : std::clamp(motion, -16384.0, 16384.0);
    return std::nearbyint(clamped * 65536 / n) / 65536;
  };
  const auto sample = [&](const Image<Pixel>& frame, double steps) {
    const auto place = [&](int from, double motion, int end) {
      return std::clamp(std::floor((from + steps * per_step(motion)) * 64 + 0.5) / 64, 0.0,
                        end - 1.0);
    };
    const double u = place(x, flow.x, frame.width());
    const double v = place(y, flow.y, frame.height());
    const int left = static_cast<int>(u);
    const int top = static_cast<int>(v);
    const int right = std::min(left + 1, frame.width() - 1);
    const int bottom = std::min(top + 1, frame.height() - 1);
    const auto row = [&](int line) {
      return frame.at(left, line) * (1 - (u - left)) + frame.at(right, line) * (u - left);
    };
    return row(top) * (1 - (v - top)) + row(bottom) * (v - top);
  };
  const double weight = std::floor(256.0 * j / n + 0.5) / 256;
  return (1 - weight) * sample(earlier, -j) + weight * sample(later, n - j);
}

struct TimedEvent {
  double t;  ///< microseconds
  int x;
  int y;
  Polarity polarity;
  Cause cause = Cause::unknown;

  friend bool operator==(const TimedEvent&, const TimedEvent&) = default;
};

/// One pixel, with the simulator's random numbers, evaluated every microsecond.
/// Luma is a share of white, 0 to 1; pixels have numbers in raster order.
///   light      I = luma / g, or with the sRGB transfer function inverted: luma/12.92 / g up to
///              0.04045, ((luma + 0.055)/1.055)^2.4 / g above; g is the gain of the exposure
///   saturated  a luma of 235/255 or more with g != 1 keeps the L of the frame before if larger
///   response   log: ln(eps + I); lin-log: x ln(20)/20 or ln(x), x = 255 I; linear: ln(255) I
///   input      L(t), a straight line from frame to frame
///   brightness b = (I + d)/(1 + d), I of the later frame in 8 bits, at most 1
///   low pass   dV/dt = 2 pi f b (L(t) - V)
///   leak       dR/dt = -rate C+, and of a hot pixel more
///   pulse      V rises by P over 100 us, stays for 800 us, and falls over 100 us; it begins
///              `exposure_lead` before each frame, but at least 100 us
///   noise      N = rate (1 - 3/4 b) per second; an event of random polarity each time the integral
///              of N has grown by a number drawn from the exponential distribution with mean 1
///   events     ON where V - R >= (1 + G) C+, OFF where R - V >= (1 + G) C-
///   jitter     C+ and C- are drawn anew after each event
///   adaptation G grows by a with each event; dG/dt = -a / T down to 0 afterwards
///   reset      level: R = R +- (1 + G) C, G before the event, and after noise R = V;
///              signal: R = V when the refractory period ends
///   cause      what moves V - R fastest towards the threshold as it is crossed: light, dV/dt;
///              the pulse, dP/dt; the leak, -dR/dt; or the fall of the threshold, which has the
///              cause of the last event; light if none
/// Draw k of interval i has the number 2^16 i + k, so noise needs intervals that are not divided.
class DvsPixel {
 public:
  DvsPixel(const DvsSettings& settings, std::uint64_t number, double luma)
      : settings_(settings),
        model_(settings),
        number_(number),
        random_(settings.seed),
        traits_(model_.traits_of(number)),
        leak_cause_(model_.is_hot(number) ? Cause::hot_pixel : Cause::leak),
        input_(response(true_light(luma))),
        signal_(input_),
        reference_(input_ - model_.leaked(number, traits_)),
        noise_left_(random_.exponential(number, Random::Purpose::first_noise)) {}

  /// Events until the next frame, `microseconds` later.
  /// Its exposure is `gain` times the first frame's.
  std::vector<TimedEvent> push(double luma, int microseconds, double gain = 1) {
    std::vector<TimedEvent> events;
    std::uint64_t draw = interval_++ << 16;
    const double last = input_;
    double next = response(true_light(luma) / gain);
    if (gain != 1 && 255 * luma >= 235) next = std::max(next, last);
    const double dark = settings_.dark_light;
    const double shade = std::min(std::floor(luma * 65535 / 256), 255.0) / 255;
    const double brightness = (std::min(light(shade) / gain, 1.0) + dark) / (1 + dark);
    const double decay =
        std::exp(-2 * std::numbers::pi * settings_.cutoff_frequency / 1e6 * brightness);
    const double growth_decay = settings_.adaptation / in_microseconds(settings_.adaptation_time);
    const double noise = settings_.shot_noise_rate / 1e6 * (1 - 0.75 * brightness);
    const double lead = std::max(in_microseconds(settings_.exposure_lead), 100.0);
    if (now_ + microseconds - lead >= std::max(pulse_ + 1000, now_))
      next_pulse_ = now_ + microseconds - lead;
    // Sampled every microsecond, the line is exact to the resolution of events.
    for (int i = 1; i <= microseconds; ++i, ++now_) {
      const double last_signal = signal_;
      input_ = last + (next - last) * i / microseconds;
      signal_ = settings_.cutoff_frequency > 0 ? input_ + (signal_ - input_) * decay : input_;
      if (now_ >= next_pulse_) pulse_ = next_pulse_;
      const double rise = pulse_at(now_ + 1) - pulse_at(now_);
      // A falling reference is equivalent to a rising signal.
      reference_ -= traits_.leak + rise;
      const double last_growth = growth_;
      growth_ = std::max(0.0, growth_ - growth_decay);
      const bool is_refractory = now_ + 1 < ready_;
      noise_left_ -= noise;
      const bool is_noise = noise_left_ <= 0;
      if (is_noise) noise_left_ += random_.exponential(number_, Random::Purpose::event, draw++);
      if (settings_.refractory_reset == RefractoryReset::signal && is_refractory) {
        reference_ = signal_;
        continue;
      }
      const auto fire = [&](bool is_on, Cause cause) {
        last_cause_ = cause;
        growth_ += settings_.adaptation;
        if (!std::isinf(traits_.thresholds.positive)) {
          events.push_back({now_ + 1, 0, 0, is_on ? Polarity::on : Polarity::off, cause});
          if (settings_.threshold_jitter > 0) {
            traits_.thresholds = model_.next_thresholds(number_, draw++);
          }
        }
        ready_ = now_ + 1 + in_microseconds(settings_.refractory_period);
        if (settings_.refractory_reset == RefractoryReset::signal) reference_ = signal_;
      };
      if (is_noise && !is_refractory) {
        reference_ = signal_;
        fire(random_.coin(number_, Random::Purpose::event, draw++), Cause::shot_noise);
        continue;
      }
      const bool is_on = signal_ - reference_ >= (1 + growth_) * traits_.thresholds.positive;
      const double threshold = is_on ? traits_.thresholds.positive : traits_.thresholds.negative;
      if (!is_on && reference_ - signal_ < (1 + growth_) * threshold) continue;
      reference_ += (is_on ? 1 : -1) * (1 + growth_) * threshold;
      if (is_refractory) continue;
      const double sign = is_on ? 1 : -1;
      const double by_light = sign * (signal_ - last_signal);
      const double by_leak = sign * traits_.leak;
      const double by_pulse = sign * rise;
      const double by_fall = growth_ > 0 ? (last_growth - growth_) * threshold : 0;
      const double fastest = std::max({0.0, by_light, by_leak, by_pulse, by_fall});
      if (by_light >= fastest || fastest == 0)
        fire(is_on, Cause::light);
      else if (by_pulse >= fastest)
        fire(is_on, Cause::exposure_pulse);
      else
        fire(is_on, by_fall >= fastest ? last_cause_ : leak_cause_);
    }
    input_ = next;
    return events;
  }

 private:
  double light(double luma) const {
    if (!settings_.linear_light) return luma;
    return luma <= 0.04045 ? luma / 12.92 : std::pow((luma + 0.055) / 1.055, 2.4);
  }

  /// Light of a pixel that may be overexposed.
  double true_light(double luma) const {
    const double over = std::clamp((255 * luma - 235) / 20, 0.0, 1.0);
    return light(luma) * (1 + over * (settings_.overexposed_light - 1));
  }

  double response(double light) const {
    if (settings_.response == Response::log) return std::log(settings_.log_eps + light);
    if (settings_.response == Response::linear) return std::log(255) * light;
    const double x = 255 * light;
    return x <= 20 ? x * std::log(20) / 20 : std::log(x);
  }

  double pulse_at(double time) const {
    if (settings_.exposure_pulse == 0) return 0;
    return settings_.exposure_pulse * (std::clamp((time - pulse_) / 100, 0.0, 1.0) -
                                       std::clamp((time - pulse_ - 900) / 100, 0.0, 1.0));
  }

  DvsSettings settings_;
  PixelModel model_;
  std::uint64_t number_;
  Random random_;
  PixelTraits traits_;
  Cause leak_cause_;
  double input_;
  double signal_;
  double reference_;
  double noise_left_;
  std::uint64_t interval_ = 0;
  Cause last_cause_ = Cause::unknown;
  double now_ = 0;
  double ready_ = 0;
  double growth_ = 0;
  double pulse_ = -1000;       ///< when the last pulse began
  double next_pulse_ = -1000;  ///< when the next one begins
};

}  // namespace eventcamera::reference
