// SPDX-License-Identifier: LGPL-2.1-or-later
// Corrupt states of eventsim-dvs whose checksum is right. The first byte selects the settings, the
// second how much is missing at the end; three more are a place in the state and the byte there. A
// state that is accepted makes events of the sensor, in order.
#include <array>
#include <cstdint>
#include <cstring>
#include <span>
#include <stdexcept>
#include <vector>

#include "src/core/byte_order.hpp"
#include "src/dvs/dvs_simulator.hpp"
#include "src/dvs/state_bytes.hpp"
#include "tests/fuzz/fuzz_decoder.hpp"

namespace {

using namespace eventcamera;

constexpr LumaFormat format{13, 5, 8};
constexpr Nanoseconds frame_time = 30'000'000;

std::array<DvsSettings, 4> kinds() {
  std::array settings{settings_of(DvsPreset::ideal), settings_of(DvsPreset::davis346),
                      settings_of(DvsPreset::gen4), settings_of(DvsPreset::icns)};
  settings[1].exposure_compensation = true;
  settings[1].exposure_pulse = 0.1;
  settings[2].upsampling = Upsampling::motion;
  settings[2].max_rate = 1e4;
  settings[3].pixel_latency = 40'000'000;
  settings[3].threshold_jitter = 0.02;
  return settings;
}

std::span<const Event> push(DvsSimulator& simulator, int number, Nanoseconds time) {
  static std::vector<Event> events;
  std::array<std::uint8_t, format.width * format.height> frame{};
  for (std::size_t i = 0; i < frame.size(); ++i)
    frame[i] = static_cast<std::uint8_t>(i * 37 * static_cast<std::size_t>(number + 1));
  const auto* made =
      simulator.push({format, frame.data(), format.width}, time, {.threads = 1, .labels = true});
  events.resize(made != nullptr ? made->size() : 0);
  if (made != nullptr) made->write_to(events.data(), simulator.threads());
  return events;
}

std::vector<std::uint8_t> state_of(const DvsSettings& settings) {
  const auto simulator = make_dvs_simulator(format);
  simulator->set(settings);
  for (int i = 0; i < 4; ++i) push(*simulator, i, i * frame_time);
  return simulator->state();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) return 0;
  static const auto all = kinds();
  static const std::array states{state_of(all[0]), state_of(all[1]), state_of(all[2]),
                                 state_of(all[3])};
  const std::size_t kind = data[0] % all.size();
  auto state = states[kind];
  const auto body = std::span(state).first(state.size() - sizeof(std::uint64_t) - data[1]);
  for (data += 2, size -= 2; size >= 3; data += 3, size -= 3)
    body[little_endian<std::uint16_t>(data) % body.size()] = data[2];
  const auto sum = checksum_of(body);
  std::memcpy(body.data() + body.size(), &sum, sizeof sum);
  state.resize(body.size() + sizeof sum);

  const auto simulator = make_dvs_simulator(format);
  simulator->set(all[kind]);
  try {
    simulator->restore(state);
  } catch (const std::runtime_error&) {
    return 0;
  }
  const Nanoseconds time = *simulator->last_time();
  if (time > INT64_MAX - 2 * frame_time) return 0;
  for (int i = 1; i <= 2; ++i) {
    const Event* last = nullptr;
    for (const auto& event : push(*simulator, i, time + i * frame_time)) {
      const Event pixel = without_cause(event);
      fuzz::require(pixel.x < format.width && pixel.y() < format.height,
                    "events are on the sensor");
      fuzz::require(event.t <= frame_time / 1000, "events are within the interval");
      fuzz::require(last == nullptr || !is_before(event, *last), "events are in order");
      last = &event;
    }
  }
  return 0;
}
