// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/wire/datagram_unpacker.hpp"

#include <algorithm>

#include "src/wire/datagram_layouts.hpp"
#include "src/wire/sequence_tracker.hpp"

namespace eventcamera {
namespace {

using datagram_layouts::Reading;

/// Maximum delay by the network; an older datagram means that the sender has restarted.
constexpr Microseconds max_delay = 1'000'000;

template <class Layout>
class UnpackerOf final : public DatagramUnpacker {
 public:
  UnpackerOf(const Layout& layout, int width, int height)
      : layout_(layout), width_(width), height_(height) {}

  Reception unpack(std::span<const std::uint8_t> bytes, std::optional<Microseconds> arrival,
                   std::vector<AbsoluteEvent>& events) override {
    const auto reception = receive(bytes, arrival, events);
    if (reception.fault != nullptr || reception.late) events.clear();
    return reception;
  }

 private:
  Reception receive(std::span<const std::uint8_t> bytes, std::optional<Microseconds> arrival,
                    std::vector<AbsoluteEvent>& events) {
    Reading reading{events, width_, height_, arrival, clock_};
    if (arrival && arrival_) reading.clock.pass(*arrival - *arrival_);
    if (const auto* fault = read(bytes, reading)) return {.fault = fault};

    Reception reception;
    if (reading.sequence_number) {
      const auto [verdict, lost] = sequence_.take(*reading.sequence_number);
      if (verdict == SequenceTracker::Verdict::stray)
        return {.fault = "its sequence number does not continue the stream"};
      if (verdict == SequenceTracker::Verdict::late) return {.late = true};
      reception.restarted = verdict == SequenceTracker::Verdict::restarted;
      reception.lost = lost;
    }
    if (events.empty()) return reception;
    reception.restarted |= events.front().t < latest_ - max_delay;
    if (reception.restarted) {
      reading.clock = {};
      if (const auto* fault = read(bytes, reading)) return {.fault = fault};
    }
    const auto earliest = reception.restarted ? 0 : latest_;
    if (events.front().t < 0) return {.fault = datagram_layouts::time_range};
    reception.late = events.front().t < earliest;
    if (reception.late) return reception;
    latest_ = events.back().t;
    clock_ = reading.clock;
    arrival_ = arrival;
    return reception;
  }

  /// Reads the events of a datagram, and sorts them.
  const char* read(std::span<const std::uint8_t> bytes, Reading& reading) const {
    reading.events.clear();
    if (const auto* fault = layout_.read(bytes, reading)) return fault;
    auto& events = reading.events;
    const auto by_time = [](const AbsoluteEvent& a, const AbsoluteEvent& b) { return a.t < b.t; };
    if (!std::ranges::is_sorted(events, by_time)) std::ranges::stable_sort(events, by_time);
    if (events.empty()) return nullptr;
    if (events.back().t > datagram_layouts::max_time) return datagram_layouts::time_range;
    if (events.back().t - events.front().t > max_datagram_span)
      return "its events are more than 71 minutes apart";
    return nullptr;
  }

  Layout layout_;
  int width_;
  int height_;
  SequenceTracker sequence_;
  WrappedTime clock_;
  std::optional<Microseconds> arrival_;  ///< of the last datagram with events
  Microseconds latest_ = 0;              ///< time of the last event
};

}  // namespace

std::unique_ptr<DatagramUnpacker> make_datagram_unpacker(const DatagramSettings& settings) {
  return datagram_layouts::with_layout(
      settings, [&]<class Layout>(const Layout& layout) -> std::unique_ptr<DatagramUnpacker> {
        return std::make_unique<UnpackerOf<Layout>>(layout, settings.width, settings.height);
      });
}

}  // namespace eventcamera
