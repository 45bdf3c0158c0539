// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/simulate/simulators.hpp"

#include "src/core/thread_pool.hpp"
#include "src/simulate/difference.hpp"

namespace eventcamera {
namespace {

template <class Pixel>
class FrameSimulator final : public Simulator {
 public:
  explicit FrameSimulator(const LumaFormat& format)
      : Simulator(format), last_(format.width, format.height) {}

 private:
  void start(const LumaView& frame) override { last_.assign(frame.as<Pixel>()); }

  void simulate(const LumaView& frame, const StepTimes& steps, const Settings& settings,
                StepBuckets& events) override {
    const auto now = frame.as<Pixel>();
    const auto thresholds = Thresholds::of(settings, format().bits);
    const auto t = steps.microseconds(steps.count());
    const int bands = band_count(now.height);
    events.reset(1, bands);
    threads().for_each(bands, [&](int band, int) {
      auto& fired = events.pixels(1, band);
      fired.begin(t);
      const BandRows rows(band, now.height);
      for (int y = rows.first; y < rows.last; ++y) {
        fire_differences(last_.row(y), now.row(y), now.width, y, thresholds, fired);
        last_.assign_row(y, now.row(y));
      }
    });
  }

  Image<Pixel> last_;
};

}  // namespace

std::unique_ptr<Simulator> make_frame_simulator(const LumaFormat& format) {
  if (format.bits > 8) return std::make_unique<FrameSimulator<std::uint16_t>>(format);
  return std::make_unique<FrameSimulator<std::uint8_t>>(format);
}

}  // namespace eventcamera
