// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "src/formats/evt/words.hpp"
#include "src/formats/ros/topic_decoder.hpp"
#include "src/formats/sensor_sizes.hpp"
#include "src/formats/unwrapped_clock.hpp"

namespace eventcamera {

namespace {

/// Fields of event_camera_msgs/EventPacket (github.com/ros-event-camera/event_camera_msgs).
struct EventPacket {
  std::uint64_t stamp;  ///< ROS time of the first event, nanoseconds
  std::uint32_t height;
  std::uint32_t width;
  std::uint64_t sequence;
  std::uint64_t time_base;  ///< sensor time, nanoseconds; of no meaning with words
  std::string_view encoding;
  bool is_big_endian;
  std::span<const std::uint8_t> events;

  explicit EventPacket(MessageCursor& fields)
      : stamp(fields.header_stamp()),
        height(fields.number<std::uint32_t>()),
        width(fields.number<std::uint32_t>()),
        sequence(fields.number<std::uint64_t>()),
        time_base(fields.number<std::uint64_t>()),
        encoding(fields.text()),
        is_big_endian(fields.boolean()),
        events(fields.bytes()) {}
};

/// Nanoseconds to microseconds, rounded down. Times are unsigned, because overflow must be
/// well-defined for any file.
constexpr Microseconds microseconds(std::uint64_t nanoseconds) {
  const auto time = static_cast<std::int64_t>(nanoseconds);
  return time / 1000 - (time % 1000 < 0 ? 1 : 0);
}

/// Maximum drift between the clocks of the sensor and of ROS in a recording, less than half of the
/// wrap period of EVT3. If they are further apart after a seek, the camera was started again.
constexpr Microseconds max_drift = 4'000'000;

bool is_drift(Microseconds late) {
  return late > -max_drift && late < max_drift;
}

/// Words of a Prophesee sensor. Packets continue each other, and each may begin within the words of
/// an event.
class EvtPackets {
 public:
  EvtPackets(EvtFormat format, Microseconds clock_range, SensorSize size, Corruption& corruption)
      : format_(format),
        clock_range_(clock_range),
        words_(make_evt_unit_decoder(format, size)),
        batch_(corruption) {}

  /// `continues`: the packet before was decoded. `resumes`: it is the first after a seek.
  void begin(const EventPacket& packet, std::uint64_t position, bool continues, bool resumes) {
    if (!continues) words_->restore({});
    resumes_ = resumes;
    if (continues && packet.stamp - stamp_ > max_pause && states_time(packet.events)) forget_time();
    stamp_ = packet.stamp;
    rest_ = packet.events;
    position_ = position;
    shift_.reset();
  }

  /// `offset` of the clocks is set with the first event, and then kept.
  bool next(Decoded& out, std::optional<std::uint64_t>& offset) {
    const auto count = words_->decode(rest_, position_, batch_, out);
    rest_ = rest_.subspan(count);
    if (!out.events.empty() || !out.triggers.empty()) shift(out, offset);
    return count > 0;
  }

 private:
  /// Turns times of the sensor into times of ROS. The sensor's clock wraps; the stamp determines
  /// how often.
  void shift(Decoded& out, std::optional<std::uint64_t>& offset) {
    if (!shift_) {
      const auto first = out.events.empty() ? out.triggers.front().t
                         : out.triggers.empty()
                             ? out.events.front().t
                             : std::min(out.events.front().t, out.triggers.front().t);
      const auto first_nanoseconds = static_cast<std::uint64_t>(first) * 1000;
      if (!offset) offset = stamp_ - first_nanoseconds;
      const auto late = microseconds(stamp_ - first_nanoseconds - *offset);
      const auto half = late < 0 ? -clock_range_ / 2 : clock_range_ / 2;
      auto wraps = (late + half) / clock_range_ * clock_range_;
      if (resumes_ && !is_drift(late - wraps)) {
        offset = stamp_ - first_nanoseconds;
        wraps = 0;
      }
      shift_ = microseconds(*offset) + wraps;
    }
    for (auto& event : out.events) event.t += *shift_;
    for (auto& trigger : out.triggers) trigger.t += *shift_;
  }

  /// Pauses that the clock of EVT3 words may not follow, nanoseconds.
  static constexpr std::uint64_t max_pause = 2'000'000'000;

  /// True if EVT3 words begin with a time.
  bool states_time(std::span<const std::uint8_t> words) const {
    return format_ == EvtFormat::evt3 && words.size() >= 2 && words[1] >> 4 == 0x8;
  }

  /// Lets the next time be any, and keeps the rest of the state.
  void forget_time() {
    constexpr std::uint64_t time_known = 1;
    words_->restore({0, words_->state().rest & ~time_known});
  }

  EvtFormat format_;
  Microseconds clock_range_;  ///< wrap period of the words' clock
  std::unique_ptr<UnitDecoder> words_;
  Batch batch_;
  std::uint64_t stamp_ = 0;
  bool resumes_ = false;
  std::span<const std::uint8_t> rest_;
  std::uint64_t position_ = 0;
  std::optional<Microseconds> shift_;  ///< of this packet, once its first time is known
};

/// Events of 64 bits, encoding mono: nanoseconds after the time base in bits 0 to 31, x in 32 to
/// 47, y in 48 to 62, polarity in 63.
class MonoPackets {
 public:
  MonoPackets(SensorSize size, Corruption& corruption) : size_(size), corruption_(corruption) {}

  /// `resumes`: the packet is the first after a seek.
  void begin(const EventPacket& packet, std::uint64_t position, bool resumes) {
    resumes_ = resumes;
    packet_stamp_ = packet.stamp;
    time_base_ = packet.time_base;
    rest_ = packet.events;
    if (rest_.size() % sizeof(std::uint64_t) != 0)
      corruption_.note(position, "an event packet ends within an event");
  }

  bool next(Decoded& out, std::optional<std::uint64_t>& offset) {
    constexpr std::size_t max_events = 4096;
    const auto stated = packet_stamp_ - time_base_;
    if (!offset || (resumes_ && !is_drift(microseconds(stated - *offset)))) offset = stated;
    const auto count = std::min(rest_.size() / sizeof(std::uint64_t), max_events);
    const auto base = time_base_ + *offset;
    out.events.resize(count);
    auto* to = out.events.data();
    for (const auto* from = rest_.data(); from != rest_.data() + 8 * count; from += 8) {
      const auto word = little_endian<std::uint64_t>(from);
      *to++ = {microseconds(base + (word & 0xffffffff)), static_cast<std::uint16_t>(word >> 32),
               static_cast<std::uint16_t>(word >> 48)};
    }
    if (size_ != SensorSize{}) corruption_.outside += std::erase_if(out.events, is_outside(size_));
    rest_ = rest_.subspan(8 * count);
    return count > 0;
  }

 private:
  SensorSize size_;
  Corruption& corruption_;
  std::uint64_t packet_stamp_ = 0;
  bool resumes_ = false;
  std::uint64_t time_base_ = 0;
  std::span<const std::uint8_t> rest_;
};

/// Events of iniVation's cameras, encodings libcaer and libcaer_cmp. Their times are ROS times.
class LibcaerPackets {
 public:
  LibcaerPackets(bool is_compressed, SensorSize size, Corruption& corruption)
      : is_compressed_(is_compressed), size_(size), corruption_(corruption) {}

  void begin(const EventPacket& packet, std::uint64_t position) {
    rest_ = packet.events;
    position_ = position;
    base_ = microseconds(packet.time_base);
    clock_ = {};
    word_state_ = {};
    if (rest_.size() % unit() != 0)
      corruption_.note(position, "an event packet ends within an event");
  }

  bool next(Decoded& out) {
    constexpr std::size_t max_units = 4096;
    const auto count = std::min(rest_.size() / unit(), max_units);
    for (const auto* from = rest_.data(); from != rest_.data() + unit() * count; from += unit()) {
      if (is_compressed_)
        read_word(little_endian<std::uint16_t>(from), out.events);
      else
        read_event(little_endian<std::uint64_t>(from), out.events);
    }
    if (size_ != SensorSize{}) corruption_.outside += std::erase_if(out.events, is_outside(size_));
    rest_ = rest_.subspan(unit() * count);
    return count > 0;
  }

 private:
  std::size_t unit() const { return is_compressed_ ? 2 : 8; }

  /// Polarity events of libcaer: validity in bit 0, polarity in 1, y in 2 to 16, x in 17 to 31, and
  /// microseconds in 32 to 62, which wrap.
  void read_event(std::uint64_t word, std::vector<AbsoluteEvent>& events) {
    const auto t = clock_.follow(static_cast<std::uint32_t>(word >> 32 & 0x7fffffff));
    const auto polarity = static_cast<std::uint16_t>((word & 2) << 14);
    events.push_back({time(t), static_cast<std::uint16_t>(word >> 17 & 0x7fff),
                      static_cast<std::uint16_t>((word >> 2 & 0x7fff) | polarity)});
  }

  /// Words of 16 bits, with their type in bits 12 to 15.
  void read_word(std::uint32_t word, std::vector<AbsoluteEvent>& events) {
    enum Type : std::uint32_t { time_high, time_low, addr_x, addr_y, vect_base_y, vect_8 };
    const auto value = word & 0x7ff;
    const auto polarity = (word & 0x800) << 4;
    auto& state = word_state_;
    const auto event_at = [&](std::uint32_t y_p) {
      events.push_back({time(static_cast<Microseconds>(state.high | state.low)),
                        static_cast<std::uint16_t>(state.x), static_cast<std::uint16_t>(y_p)});
    };
    switch (word >> 12) {
      case time_high:
        state.high = (word & 0xfff) << 12;
        break;
      case time_low:
        state.low = word & 0xfff;
        break;
      case addr_x:
        state.x = value;
        break;
      case addr_y:
        event_at(value | polarity);
        break;
      case vect_base_y:
        state.base = value | polarity;
        break;
      case vect_8:
        for (std::uint32_t i = 0; i < 8; ++i)
          if ((word >> i & 1) != 0) event_at(state.base + i);
        if ((state.base & 0x7fff) < max_evt_side) state.base += 8;
        break;
      default:
        corruption_.note(position_, "a libcaer_cmp word of unknown type");
    }
  }

  /// Overflow is well-defined for any file.
  Microseconds time(Microseconds since_base) const {
    return static_cast<Microseconds>(static_cast<std::uint64_t>(base_) +
                                     static_cast<std::uint64_t>(since_base));
  }

  /// Words set the time, the column and the first row of vectors, with the polarity in bit 15.
  struct WordState {
    std::uint32_t high = 0;
    std::uint32_t low = 0;
    std::uint32_t x = 0;
    std::uint32_t base = 0;
  };

  bool is_compressed_;
  SensorSize size_;
  Corruption& corruption_;
  std::span<const std::uint8_t> rest_;
  std::uint64_t position_ = 0;
  Microseconds base_ = 0;
  UnwrappedClock<31> clock_;  ///< of libcaer, since the base
  WordState word_state_;      ///< of libcaer_cmp
};

class EventPacketDecoder final : public TopicDecoder {
 public:
  EventPacketDecoder(BagTopic topic, Corruption& corruption)
      : TopicDecoder(corruption), topic_(std::move(topic)) {}

  void begin(const BagMessage& message) override {
    is_decoding_ = false;
    MessageCursor fields(message.bytes, *topic_.serialization);
    EventPacket packet(fields);
    if (fields.failed()) {
      corruption_.note(message.position, "an event packet with missing bytes");
      return;
    }
    if (encoding_.empty()) {
      set_size(packet.width, packet.height);
      choose(packet);
    }
    if (packet.encoding != encoding_ || packet.is_big_endian) {
      corruption_.note(message.position, "an event packet of another encoding");
      return;
    }
    // Some recorders leave it out.
    if (packet.stamp == 0) packet.stamp = static_cast<std::uint64_t>(message.logged) * 1000;
    const bool restarted = sequence_ && packet.sequence <= *sequence_;
    const bool continues = sequence_ && packet.sequence == *sequence_ + 1;
    if (sequence_ && packet.sequence > *sequence_ + 1)
      corruption_.note(message.position, "event packets are missing");
    // A camera that was started again counts and measures time from the start.
    if (restarted) offset_.reset();
    const bool resumes = !sequence_;
    sequence_ = packet.sequence;
    is_decoding_ = true;
    if (evt_)
      evt_->begin(packet, message.position, continues, resumes);
    else if (libcaer_)
      libcaer_->begin(packet, message.position);
    else
      mono_->begin(packet, message.position, resumes);
  }

  bool next() override {
    decoded_.events.clear();
    decoded_.triggers.clear();
    if (!is_decoding_) return false;
    if (libcaer_) return libcaer_->next(decoded_);
    return evt_ ? evt_->next(decoded_, offset_) : mono_->next(decoded_, offset_);
  }

  void restart() override {
    is_decoding_ = false;
    sequence_.reset();
  }

  std::optional<std::uint64_t> clock_offset() const override { return offset_; }
  void set_clock_offset(std::uint64_t offset) override { offset_ = offset; }

 private:
  /// Chooses the decoder from the first packet, whose sensor size holds for all.
  void choose(const EventPacket& packet) {
    struct Words {
      std::string_view encoding;
      EvtFormat format;
      int clock_bits;
    };
    constexpr Words words[] = {{"evt3", EvtFormat::evt3, 24},
                               {"evt2", EvtFormat::evt2, 34},
                               {"evt21", EvtFormat::evt21, 34}};
    const auto* const found = std::ranges::find(words, packet.encoding, &Words::encoding);
    if (found != std::end(words)) {
      if (size_.width > max_evt_side || size_.height > max_evt_side) size_ = {};
      evt_.emplace(found->format, Microseconds{1} << found->clock_bits, size_, corruption_);
    } else if (packet.encoding == "mono" && !packet.is_big_endian) {
      mono_.emplace(size_, corruption_);
    } else if ((packet.encoding == "libcaer" || packet.encoding == "libcaer_cmp") &&
               !packet.is_big_endian) {
      libcaer_.emplace(packet.encoding == "libcaer_cmp", size_, corruption_);
    } else {
      constexpr std::size_t max_name = 32;
      throw UnsupportedFormat("the events of topic " + topic_.name + " have the encoding \"" +
                              std::string(packet.encoding.substr(0, max_name)) +
                              (packet.is_big_endian ? "\", big-endian" : "\"") +
                              "; evt2, evt21, evt3, libcaer, libcaer_cmp and mono can be read");
    }
    encoding_ = packet.encoding;
  }

  BagTopic topic_;
  std::string encoding_;  ///< of the first packet
  std::optional<EvtPackets> evt_;
  std::optional<MonoPackets> mono_;
  std::optional<LibcaerPackets> libcaer_;
  std::optional<std::uint64_t> offset_;
  std::optional<std::uint64_t> sequence_;  ///< of the last packet
  bool is_decoding_ = false;
};

}  // namespace

std::unique_ptr<TopicDecoder> make_event_packet_decoder(const BagTopic& topic,
                                                        Corruption& corruption) {
  return std::make_unique<EventPacketDecoder>(topic, corruption);
}

}  // namespace eventcamera
