// SPDX-License-Identifier: LGPL-2.1-or-later
// Cuts events at arbitrary times and places into windows, and makes tensors of them. The first
// bytes select the windows and the tensor; then, eight bytes are an event or the end of an
// interval.
#include <numeric>
#include <vector>

#include "src/core/byte_order.hpp"
#include "src/tensor/event_tensor.hpp"
#include "src/tensor/window_queue.hpp"
#include "tests/fuzz/fuzz_decoder.hpp"

namespace {

using namespace fuzz;

constexpr int width = 24;
constexpr int height = 16;

/// A window holds sorted events of the sensor, and its histogram each of them.
void check(const WindowQueue::Window& window, const WindowSettings& settings, EventTensor& tensor,
           EventTensor& histogram) {
  require(window.start <= window.end, "a window does not end before it starts");
  Microseconds last = window.start / 1000;
  for (const auto& event : window.events) {
    require(event.x < width && event.y() < height, "events are inside the sensor");
    require(event.t >= last, "events are sorted, and not before their window");
    last = event.t;
  }
  if (settings.events > 0) require(window.events.size() <= settings.events, "counts are limited");
  std::vector<std::byte> out(tensor.bytes());
  tensor.write(window.events, std::max(last, window.end / 1000), out.data());
  std::vector<float> counts(histogram.shape().elements());
  histogram.write(window.events, 0, reinterpret_cast<std::byte*>(counts.data()));
  require(std::accumulate(counts.begin(), counts.end(), 0.0) ==
              static_cast<double>(window.events.size()),
          "a histogram has every event");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 6) return 0;
  const WindowSettings windows{.events = data[0] % 8U,
                               .duration = data[1] % 8 * Nanoseconds{123'456},
                               .intervals = 1U + data[2] % 4U,
                               .overlap = data[3] % 100 / 100.0};
  const TensorSettings settings{.representation = static_cast<Representation>(data[4] % 4),
                                .bins = 1 + data[4] / 4 % 8,
                                .decay = static_cast<Decay>(data[5] % 2),
                                .time_constant = 1 + data[5],
                                .normalization = static_cast<Normalization>(data[5] / 2 % 3),
                                .type = static_cast<ElementType>(data[5] / 8 % 3)};
  WindowQueue queue(width, height, windows);
  EventTensor tensor(width, height, settings);
  EventTensor histogram(width, height, {.representation = Representation::histogram});
  std::vector<Event> events;
  Nanoseconds start = 0;
  for (data += 6, size -= 6; size >= 8; data += 8, size -= 8) {
    const auto number = little_endian<std::uint32_t>(data);
    if (data[7] % 8 != 7) {
      events.push_back({number % 4096, static_cast<std::uint16_t>(data[4] % (width + 1)),
                        static_cast<std::uint16_t>(data[5] % (height + 1) | (data[6] % 2) << 15)});
      continue;
    }
    // The end of an interval of up to 2 ms, after a pause, or after a step back.
    const auto end = start + number % 2'000'000;
    queue.add(events, start / 1000, start, end);
    while (const auto window = queue.next()) check(*window, windows, tensor, histogram);
    events.clear();
    start = std::max<Nanoseconds>(0, end + (data[6] - 16) * Nanoseconds{10'000});
  }
  if (const auto window = queue.finish()) check(*window, windows, tensor, histogram);
  return 0;
}
