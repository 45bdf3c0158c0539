// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <random>
#include <vector>

#include "bench/naive/frame.hpp"
#include "bench/naive/opencv.hpp"
#include "src/dvs/dvs_settings.hpp"
#include "src/simulate/warp.hpp"

namespace naive {

/// reference::denoised() in integers.
inline void denoise(const ImageView<std::uint8_t>& frame, int limit, ThreadPool& threads,
                    Image<std::uint8_t>& out) {
  constexpr int weights[] = {1, 2, 1};
  threads.for_each(frame.height, [&](int y, int) {
    for (int x = 0; x < frame.width; ++x) {
      const int centre = frame.row(y)[x];
      int sum = 8;
      for (int j = -1; j <= 1; ++j) {
        const auto* row = frame.row(std::clamp(y + j, 0, frame.height - 1));
        for (int i = -1; i <= 1; ++i)
          sum += weights[i + 1] * weights[j + 1] *
                 std::clamp(row[std::clamp(x + i, 0, frame.width - 1)] - centre, -limit, limit);
      }
      out.at(x, y) = static_cast<std::uint8_t>(centre + (sum >> 4));
    }
  });
}

/// The physical pixel as computed by v2e, frame by frame: an Euler step of the low-pass filter,
/// events spread evenly over the interval, noise at its end; thresholds, leak, shot noise.
class DvsPixels {
 public:
  DvsPixels(int width, int height, const DvsSettings& settings)
      : settings_(settings),
        filtered_(width, height),
        reference_(width, height),
        positive_(width, height),
        negative_(width, height),
        rises_(width, height),
        falls_(width, height) {
    std::mt19937 random(1);
    const auto sigma = static_cast<float>(settings.threshold_sigma);
    std::normal_distribution<float> normal(0, 1);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const auto draw = [&](double mean) {
          return std::max(0.01F, static_cast<float>(mean) + sigma * normal(random));
        };
        positive_.at(x, y) = draw(settings.positive_threshold);
        negative_.at(x, y) = draw(settings.negative_threshold);
      }
    }
    for (int band = 0; band < band_count(height); ++band)
      random_.emplace_back(static_cast<unsigned>(band));
  }

  void start(const FrameView& frame) {
    for (int y = 0; y < frame.height; ++y)
      for (int x = 0; x < frame.width; ++x)
        filtered_.at(x, y) = reference_.at(x, y) = lin_log(frame.row(y)[x]);
  }

  /// Advances the pixels from `begin` to `end`, seconds; events go to the buckets of `step`.
  void advance(const FrameView& frame, double begin, double end, int step, ThreadPool& threads,
               StepBuckets& events) {
    const auto duration = static_cast<float>(end - begin);
    max_counts_.assign(random_.size(), 0);
    threads.for_each(band_count(frame.height),
                     [&](int band, int) { count(frame, duration, band); });
    const int max_count = std::max(1, *std::max_element(max_counts_.begin(), max_counts_.end()));
    threads.for_each(band_count(frame.height), [&](int band, int) {
      auto& out = events.bucket(step, band);
      const BandRows rows(band, frame.height);
      for (int i = 1; i <= max_count; ++i) {
        const auto t = static_cast<std::uint32_t>((begin + (end - begin) * i / max_count) * 1e6);
        for (int y = rows.first; y < rows.last; ++y) {
          for (int x = 0; x < frame.width; ++x) {
            if (rises_.at(x, y) >= i) out.push_back(Event::at(x, y, t, Polarity::on));
            if (falls_.at(x, y) >= i) out.push_back(Event::at(x, y, t, Polarity::off));
          }
        }
      }
      if (settings_.shot_noise_rate > 0) add_noise(frame, duration, end, band, out);
    });
  }

 private:
  static float lin_log(float grey) {
    constexpr float edge = 20;
    return grey <= edge ? grey * std::log(edge) / edge : std::log(grey);
  }

  static float brightness(float grey) { return (grey + 20) / 275; }

  /// Counts the events of each pixel.
  void count(const FrameView& frame, float duration, int band) {
    const BandRows rows(band, frame.height);
    const auto bandwidth =
        static_cast<float>(2 * std::numbers::pi * settings_.cutoff_frequency) * duration;
    const auto leak = static_cast<float>(settings_.leak_rate) * duration;
    int max_count = 0;
    for (int y = rows.first; y < rows.last; ++y) {
      for (int x = 0; x < frame.width; ++x) {
        const float grey = frame.row(y)[x];
        float& filtered = filtered_.at(x, y);
        float& reference = reference_.at(x, y);
        const float share =
            settings_.cutoff_frequency > 0 ? std::min(1.0F, brightness(grey) * bandwidth) : 1;
        filtered += share * (lin_log(grey) - filtered);
        reference -= leak * positive_.at(x, y);
        const float change = filtered - reference;
        const int rise = static_cast<int>(std::max(change, 0.0F) / positive_.at(x, y));
        const int fall = static_cast<int>(std::max(-change, 0.0F) / negative_.at(x, y));
        reference += static_cast<float>(rise) * positive_.at(x, y) -
                     static_cast<float>(fall) * negative_.at(x, y);
        rises_.at(x, y) = rise;
        falls_.at(x, y) = fall;
        max_count = std::max({max_count, rise, fall});
      }
    }
    max_counts_[static_cast<std::size_t>(band)] = max_count;
  }

  void add_noise(const FrameView& frame, float duration, double end, int band,
                 std::vector<Event>& out) {
    const BandRows rows(band, frame.height);
    auto& random = random_[static_cast<std::size_t>(band)];
    std::uniform_real_distribution<float> uniform(0, 1);
    const auto rate = static_cast<float>(settings_.shot_noise_rate) / 2 * duration;
    const auto t = static_cast<std::uint32_t>(end * 1e6);
    for (int y = rows.first; y < rows.last; ++y) {
      for (int x = 0; x < frame.width; ++x) {
        const float share = rate * (1 - 0.75F * brightness(frame.row(y)[x]));
        const float drawn = uniform(random);
        if (drawn >= share && drawn <= 1 - share) continue;
        out.push_back(Event::at(x, y, t, drawn < share ? Polarity::off : Polarity::on));
        reference_.at(x, y) = filtered_.at(x, y);
      }
    }
  }

  DvsSettings settings_;
  Image<float> filtered_;
  Image<float> reference_;
  Image<float> positive_;
  Image<float> negative_;
  Image<int> rises_;
  Image<int> falls_;
  std::vector<int> max_counts_;  ///< by band
  std::vector<std::mt19937> random_;
};

/// Events between frames or, with motion, between interpolated frames, whose number is the length
/// of the maximum flow in pixels.
class DvsSimulator final : public Simulator {
 public:
  DvsSimulator(const LumaFormat& format, const DvsSettings& settings)
      : Simulator(format),
        settings_(settings),
        pixels_(format.width, format.height, settings),
        last_(format.width, format.height),
        between_(format.width, format.height),
        denoised_(format.width, format.height) {
    if (settings.upsampling == Upsampling::motion)
      flow_.emplace(FlowMethod::dis_mq, format.width, format.height);
  }

 private:
  ImageView<std::uint8_t> seen(const LumaView& frame) {
    if (settings_.denoise == 0) return frame.as<std::uint8_t>();
    denoise(frame.as<std::uint8_t>(), static_cast<int>(settings_.denoise), threads(), denoised_);
    return denoised_.view();
  }

  void start(const LumaView& frame) override {
    last_.assign(seen(frame));
    pixels_.start(last_.view());
  }

  void simulate(const LumaView& frame, const StepTimes& interval, const Settings&,
                StepBuckets& events) override {
    const auto now = seen(frame);
    const double duration = static_cast<double>(interval.duration()) * 1e-9;
    ImageView<Flow> flow;
    int steps = 1;
    if (flow_) {
      flow = flow_->find(last_.view(), now, threads().threads());
      float max_length = 0;
      for (int y = 0; y < now.height; ++y)
        for (int x = 0; x < now.width; ++x)
          max_length = std::max(max_length, std::hypot(flow.row(y)[x].x, flow.row(y)[x].y));
      steps = std::clamp(static_cast<int>(std::ceil(max_length)), 1,
                         settings_.max_interpolated_frames + 1);
    }
    events.reset(steps, band_count(now.height));
    const Warp<std::uint8_t> warp{last_.view(), now, steps};
    for (int j = 1; j <= steps; ++j) {
      if (j < steps) {
        threads().for_each(now.height, [&](int y, int) {
          for (int x = 0; x < now.width; ++x)
            between_.at(x, y) =
                warp.at<Interpolation::blend>(x, y, motion_per_step(flow.row(y)[x].x, steps),
                                              motion_per_step(flow.row(y)[x].y, steps), j);
        });
      }
      pixels_.advance(j < steps ? between_.view() : now, duration * (j - 1) / steps,
                      duration * j / steps, j, threads(), events);
    }
    copy(now, last_, threads());
  }

  DvsSettings settings_;
  DvsPixels pixels_;
  Image<std::uint8_t> last_;
  Image<std::uint8_t> between_;
  Image<std::uint8_t> denoised_;
  std::optional<OpenCvFlow> flow_;
};

}  // namespace naive
