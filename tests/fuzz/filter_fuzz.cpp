// SPDX-License-Identifier: LGPL-2.1-or-later
// Filters of arbitrary valid streams. Seven bytes are an event, or end a buffer: x, y and polarity,
// time after the last one. The same events are kept of one buffer and of many, in order.
#include <vector>

#include "src/filter/denoise_filter.hpp"
#include "src/filter/flicker_filter.hpp"
#include "src/filter/hot_pixel_filter.hpp"
#include "src/filter/rate_filter.hpp"
#include "src/filter/refractory_filter.hpp"
#include "src/filter/trail_filter.hpp"
#include "src/formats/little_endian.hpp"
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
  return 0;
}
