// SPDX-License-Identifier: LGPL-2.1-or-later
// Filters of arbitrary valid streams. Seven bytes are an event, or end a buffer: x, y and polarity,
// time after the last one. The same events are kept of one buffer and of many, in order; those that
// are moved fit into the output, and merged streams have all events, in order.
#include <array>
#include <vector>

#include "src/core/byte_order.hpp"
#include "src/filter/camera_calibration.hpp"
#include "src/filter/denoise_filter.hpp"
#include "src/filter/event_merge.hpp"
#include "src/filter/flicker_filter.hpp"
#include "src/filter/hot_pixel_filter.hpp"
#include "src/filter/rate_filter.hpp"
#include "src/filter/refractory_filter.hpp"
#include "src/filter/scale_filter.hpp"
#include "src/filter/trail_filter.hpp"
#include "src/filter/undistort_filter.hpp"
#include "tests/fuzz/fuzz_decoder.hpp"

namespace {

using namespace fuzz;

constexpr SensorSize sensor{16, 9};

struct Buffer {
  Microseconds start;
  std::vector<Event> events;
};

std::vector<Buffer> read_stream(const std::uint8_t* data, std::size_t size) {
  std::vector<Buffer> buffers;
  Microseconds t = 0;
  for (; size >= 7; data += 7, size -= 7) {
    t += static_cast<Microseconds>(little_endian<std::uint32_t>(data + 3)) << data[2] % 4 * 4;
    const Microseconds max_start = Microseconds{UINT32_MAX};
    if (buffers.empty() || data[2] >= 0xe0 || t - buffers.back().start > max_start)
      buffers.push_back({t, {}});
    auto& [start, events] = buffers.back();
    events.push_back(
        {static_cast<std::uint32_t>(t - start), static_cast<std::uint16_t>(data[0] % sensor.width),
         static_cast<std::uint16_t>((data[1] & 0x7f) % sensor.height | (data[1] & 0x80) << 8)});
  }
  return buffers;
}

template <class Core>
std::vector<AbsoluteEvent> filtered(const std::vector<Buffer>& buffers, std::size_t max_size,
                                    const typename Core::Settings& settings) {
  Core core(sensor);
  std::vector<AbsoluteEvent> kept;
  for (auto [start, events] : buffers)
    for (std::span<Event> rest(events); !rest.empty();) {
      const auto part = rest.first(std::min(max_size, rest.size()));
      rest = rest.subspan(part.size());
      for (const auto& event : core.filter({part, {}}, start, settings).events)
        kept.push_back({start + event.t, event.x, event.y_p});
    }
  return kept;
}

template <class Core>
void check(const std::vector<Buffer>& buffers, const typename Core::Settings& settings) {
  const auto kept = filtered<Core>(buffers, SIZE_MAX, settings);
  require(filtered<Core>(buffers, 1, settings) == kept, "buffers do not matter");
  std::size_t next = 0;
  for (const auto& [start, events] : buffers)
    for (const auto& event : events)
      next += next < kept.size() && kept[next] == AbsoluteEvent{start + event.t, event.x, event.y_p}
                  ? 1
                  : 0;
  require(next == kept.size(), "what is kept is part of the stream, in order");
}

/// Filters that move events, which then have to fit into the output.
template <class Filter>
void check_moved(const std::vector<Buffer>& buffers, SensorSize out, const Filter& filter) {
  for (auto [start, events] : buffers)
    for (const auto& event : filter(LabelledEvents{events, {}}, start).events)
      require(event.x < out.width && event.y() < out.height, "events are inside the output");
}

void check_scaled(const std::vector<Buffer>& buffers) {
  for (const SensorSize size : {SensorSize{5, 4}, SensorSize{40, 30}})
    for (const unsigned min_events : {1U, 3U}) {
      ScaleFilter scale(sensor, size);
      check_moved(buffers, size, [&](LabelledEvents events, Microseconds start) {
        return scale.filter(events, start, {.min_events = min_events});
      });
    }
}

/// A camera with a lens as the bytes say, however odd.
CameraCalibration calibration_of(CameraCalibration::Lens lens,
                                 std::span<const std::uint8_t> bytes) {
  const auto number = [&](std::size_t i) { return i < bytes.size() ? bytes[i] / 16.0 : 0; };
  CameraCalibration calibration{
      .lens = lens, .fx = number(0) + 0.1, .fy = number(1) + 0.1, .cx = number(2), .cy = number(3)};
  for (std::size_t i = 0; i < calibration.distortion.size(); ++i)
    calibration.distortion[i] = number(4 + i) - 8;
  return calibration;
}

void check_undistorted(const std::vector<Buffer>& buffers, std::span<const std::uint8_t> bytes) {
  for (const auto lens : {CameraCalibration::Lens::plumb_bob, CameraCalibration::Lens::fisheye}) {
    const UndistortFilter filter(sensor, calibration_of(lens, bytes));
    check_moved(buffers, sensor,
                [&](LabelledEvents events, Microseconds) { return filter.filter(events); });
  }
}

/// Merges the ON with the OFF events.
void check_merged(const std::vector<Buffer>& buffers) {
  EventMerger merger;
  std::array<MergeInput, 2> inputs;
  Microseconds last = 0;
  for (const auto& [start, events] : buffers) {
    std::array<std::vector<Event>, 2> parts;
    for (const auto& event : events)
      parts[event.polarity() == Polarity::on ? 1 : 0].push_back(event);
    for (std::size_t i = 0; i < parts.size(); ++i) {
      inputs[i].load(parts[i], {}, sensor, events.back().t);
      inputs[i].place(start, 0, 0);
    }
    std::size_t merged = 0;
    for (;;) {
      std::vector<MergeInput*> loaded;
      for (auto& input : inputs)
        if (input.is_loaded()) loaded.push_back(&input);
      if (loaded.empty()) break;
      const auto interval = merger.next(loaded);
      std::vector<Event> out(interval.events);
      EventMerger::merge(loaded, interval, {out, {}});
      for (const auto& event : out) {
        require(interval.start + event.t >= last, "merged events are sorted");
        last = interval.start + event.t;
      }
      merged += out.size();
      for (auto* input : loaded)
        if (input->is_merged(interval.end)) input->unload();
    }
    require(merged == events.size(), "all events are merged");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto buffers = read_stream(data, size);
  check<RefractoryFilter>(buffers, {});
  for (const auto mode : {TrailMode::trail, TrailMode::stc_cut_trail, TrailMode::stc_keep_trail})
    check<TrailFilter>(buffers, {.mode = mode});
  for (const auto mode : {FlickerMode::band_stop, FlickerMode::band_pass})
    check<FlickerFilter>(buffers, {.mode = mode, .start_threshold = 2, .stop_threshold = 1});
  check<HotPixelFilter>(buffers, {.learning_period = 10'000'000, .min_rate = 0, .ratio = 2});
  check<RateFilter>(buffers, {.max_rate = 1000});
  for (const auto method :
       {DenoiseMethod::baf, DenoiseMethod::stcf, DenoiseMethod::time_kernel, DenoiseMethod::dwf})
    for (const bool match_polarity : {false, true})
      check<DenoiseFilter>(buffers, {.method = method, .match_polarity = match_polarity});
  check_scaled(buffers);
  check_undistorted(buffers, {data, size});
  check_merged(buffers);
  return 0;
}
