// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "src/filter/filter.hpp"
#include "src/filter/stamped_pixels.hpp"

namespace eventcamera {

/// Part of a burst to keep. A burst is a run of events of one pixel and polarity, each less than
/// the threshold after the previous one.
enum class TrailMode {
  trail,           ///< the first event
  stc_cut_trail,   ///< the second event
  stc_keep_trail,  ///< all events but the first
};

/// The event trail filter of Prophesee's sensors (OpenEB, I_EventTrailFilterModule), per pixel. STC
/// (spatio-temporal contrast) treats single events as noise. 4 bytes per pixel.
class TrailFilter {
 public:
  struct Settings {
    TrailMode mode = TrailMode::trail;
    Nanoseconds threshold = 10'000'000;  ///< 0 to max_filter_time
  };

  explicit TrailFilter(SensorSize sensor) : last_(sensor) {}

  LabelledEvents filter(LabelledEvents events, Microseconds start, const Settings& settings) {
    const Stamp threshold = in_stamps(settings.threshold);
    // Events to keep: the first of a burst or the others, and whether only the second of these.
    const int kept = settings.mode == TrailMode::trail ? 0 : 1;
    const int keeps_all = settings.mode == TrailMode::stc_cut_trail ? 0 : 1;
    return last_.keep_if(events, start, [=](const Event& event, Stamp now, LastEvent* last) {
      const bool is_on = event.polarity() == Polarity::on;
      // Branches on random polarities would be mispredicted.
      const int follows = static_cast<int>(is_on == last->is_on()) &
                          static_cast<int>(now - last->stamp() < threshold);
      const int is_second = follows & static_cast<int>(!last->follows());
      *last = LastEvent(now, follows != 0, is_on);
      return (static_cast<int>(follows == kept) & (keeps_all | is_second)) != 0;
    });
  }

  void forget() { last_.forget(); }

 private:
  /// The last event of a pixel.
  class LastEvent {
   public:
    LastEvent() = default;
    LastEvent(Stamp stamp, bool follows, bool is_on)
        : bits_(stamp << 2 | (follows ? 2U : 0U) | (is_on ? 1U : 0U)) {}

    Stamp stamp() const { return bits_ >> 2; }
    bool follows() const { return (bits_ & 2) != 0; }  ///< it was not the first of a burst
    bool is_on() const { return (bits_ & 1) != 0; }
    void lower(std::uint64_t amount) { bits_ = lowered(stamp(), amount) << 2 | (bits_ & 3); }

   private:
    std::uint32_t bits_ = 0;
  };
  static_assert(stamp_bits + 2 <= 32);

  StampedPixels<LastEvent> last_;
};
static_assert(Filter<TrailFilter>);

}  // namespace eventcamera
