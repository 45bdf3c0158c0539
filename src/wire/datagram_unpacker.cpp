// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/wire/datagram_unpacker.hpp"

#include <algorithm>
#include <cstdint>
#include <optional>

#include "src/wire/datagram_layouts.hpp"

namespace eventcamera {
namespace {

/// Tracks 31-bit sequence numbers, like RFC 3550: a jump is accepted only once the next number
/// confirms it, so a stray datagram neither disturbs the stream nor counts as loss.
class SequenceTracker {
 public:
  enum class Verdict : std::uint8_t { next, late, stray, restarted };
  struct Result {
    Verdict verdict = Verdict::next;
    std::uint32_t lost = 0;  ///< numbers missing before this one
  };

  Result update(std::uint32_t number) {
    number &= mask;
    const auto ahead = (number - next_.value_or(number)) & mask;
    if (ahead <= max_lost) return accept(number, Verdict::next, ahead);
    if (number == after_stray_) return accept(number, Verdict::restarted, 0);
    if (mask - ahead < max_late) return {Verdict::late};
    after_stray_ = (number + 1) & mask;
    return {Verdict::stray};
  }

 private:
  static constexpr std::uint32_t mask = 0x7fff'ffff;
  static constexpr std::uint32_t max_lost = 1 << 16;
  static constexpr std::uint32_t max_late = 100;

  Result accept(std::uint32_t number, Verdict verdict, std::uint32_t lost) {
    next_ = (number + 1) & mask;
    after_stray_.reset();
    return {verdict, lost};
  }

  std::optional<std::uint32_t> next_;
  std::optional<std::uint32_t> after_stray_;  ///< number that confirms a jump
};

using datagram_layouts::Reading;
using datagram_layouts::WrappedTime;

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
      const auto [verdict, lost] = sequence_.update(*reading.sequence_number);
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
