// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/wire/datagrams.hpp"

#include <algorithm>
#include <array>
#include <stdexcept>

#include "src/core/address_layout.hpp"
#include "src/core/byte_order.hpp"

namespace eventcamera {

namespace {

// Layouts of the datagrams of each format. A layout derives from LayoutOf, and has
//
// - write(event, out): writes an event;
// - read(bytes, in): reads a received datagram, and returns why it is invalid, or null.

/// Unwraps 32-bit times in microseconds: each is assumed to be less than half the range (36
/// minutes) from the expected time.
class WrappedTime {
 public:
  Microseconds at(std::uint32_t t) {
    if (!expected_) {
      expected_ = t;
    } else {
      *expected_ += static_cast<std::int32_t>(t - static_cast<std::uint32_t>(*expected_));
    }
    return *expected_;
  }

  void pass(Microseconds time) {
    if (expected_) *expected_ += time;
  }

 private:
  std::optional<Microseconds> expected_;
};

/// Largest time that fits into 64-bit nanoseconds.
constexpr Microseconds max_time = std::numeric_limits<Nanoseconds>::max() / 1000;

class Writer {
 public:
  std::size_t size() const { return size_; }
  std::span<const std::uint8_t> bytes() const { return std::span(bytes_).first(size_); }
  void clear() { size_ = 0; }

  template <std::unsigned_integral Number>
  void put(Number number, std::endian order = std::endian::little) {
    store(number, bytes_.data() + size_, order);
    size_ += sizeof number;
  }

 private:
  std::array<std::uint8_t, 1400> bytes_;  // fits into an Ethernet frame
  std::size_t size_ = 0;
};

using Fault = const char*;
constexpr Fault partial_event = "it ends in a partial event";
constexpr Fault outside = "an event lies outside the sensor";
constexpr Fault no_header = "it is shorter than its header";
constexpr Fault no_time = "an event has no time";
constexpr Fault time_range = "a time is out of range";
constexpr Fault not_boolean = "a polarity is neither 0 nor 1";

struct Reading {
  std::vector<AbsoluteEvent>& events;
  int width;   ///< of the sensor
  int height;  ///< of the sensor
  std::optional<Microseconds> arrival;
  WrappedTime clock;
  std::optional<std::uint32_t> sequence_number{};

  /// Returns the fault of an event outside the sensor.
  Fault add(Microseconds t, int x, int y, bool on) {
    if (x < 0 || x >= width || y < 0 || y >= height) return outside;
    events.push_back(AbsoluteEvent::at(x, y, t, on ? Polarity::on : Polarity::off));
    return nullptr;
  }
};

bool is_on(const AbsoluteEvent& event) {
  return event.polarity() == Polarity::on;
}

/// Base of layouts, by default without a header, of events of the same size.
template <std::size_t event_size, std::size_t max_sent>
struct LayoutOf {
  static constexpr std::size_t min_event_size = event_size;
  /// Maximum size of a sent datagram; received ones may have any size.
  static constexpr std::size_t max_size = max_sent;

  /// Writes the header.
  void begin(Microseconds /*first*/, Writer& /*out*/) {}

  /// Bytes that write() would write.
  std::size_t size_of(const AbsoluteEvent& /*event*/) const { return event_size; }
};

/// 32-bit words: bit 31: no timestamp follows, 30-16: x, 15: ON, 14-0: y; then optionally a word
/// with the low 32 bits of the time. AEStream reads at most 512 bytes, without timestamps, and
/// spiffer at most 1024.
template <bool has_timestamps>
class Spif : public LayoutOf<has_timestamps ? 8 : 4, has_timestamps ? 1024 : 512> {
 public:
  explicit Spif(const DatagramSettings& settings) : order_(settings.byte_order) {}

  void write(const AbsoluteEvent& event, Writer& out) {
    out.put((has_timestamps ? 0U : untimed) | std::uint32_t{event.x} << 16 | event.y_p, order_);
    if constexpr (has_timestamps) out.put(static_cast<std::uint32_t>(event.t), order_);
  }

  Fault read(std::span<const std::uint8_t> bytes, Reading& in) const {
    for (std::size_t at = 0; at < bytes.size();) {
      if (bytes.size() - at < 4) return partial_event;
      const auto word = load<std::uint32_t>(&bytes[at], order_);
      at += 4;
      std::optional<Microseconds> t;
      if ((word & untimed) == 0) {
        if (bytes.size() - at < 4) return partial_event;
        t = in.clock.at(load<std::uint32_t>(&bytes[at], order_));
        at += 4;
      }
      if constexpr (!has_timestamps) t = in.arrival;
      if (!t) return no_time;
      const auto x = static_cast<int>(word >> 16 & 0x7fff);
      const auto y = static_cast<int>(word & 0x7fff);
      if (const auto* fault = in.add(*t, x, y, (word & on) != 0)) return fault;
    }
    return nullptr;
  }

 private:
  static constexpr std::uint32_t untimed = 1U << 31;
  static constexpr std::uint32_t on = 1U << 15;

  std::endian order_;
};

/// Events of 13 bytes: 64-bit t, x, y, and a byte for ON.
class T64X16Y16On8 : public LayoutOf<13, 1300> {
 public:
  void write(const AbsoluteEvent& event, Writer& out) {
    out.put(static_cast<std::uint64_t>(event.t));
    out.put(event.x);
    out.put(static_cast<std::uint16_t>(event.y()));
    out.put(static_cast<std::uint8_t>(is_on(event)));
  }

  Fault read(std::span<const std::uint8_t> bytes, Reading& in) const {
    if (bytes.size() % min_event_size != 0) return partial_event;
    for (; !bytes.empty(); bytes = bytes.subspan(min_event_size)) {
      const auto t = little_endian<std::uint64_t>(bytes.data());
      const auto x = little_endian<std::uint16_t>(&bytes[8]);
      const auto y = little_endian<std::uint16_t>(&bytes[10]);
      if (t > max_time) return time_range;
      if (bytes[12] > 1) return not_boolean;
      if (const auto* fault = in.add(static_cast<Microseconds>(t), x, y, bytes[12] == 1))
        return fault;
    }
    return nullptr;
  }
};

/// Events of 8 bytes: the low 32 bits of t, x, and y << 1 | ON.
class T32X16Y15On1 : public LayoutOf<8, 800> {
 public:
  void write(const AbsoluteEvent& event, Writer& out) {
    out.put(static_cast<std::uint32_t>(event.t));
    out.put(event.x);
    out.put(static_cast<std::uint16_t>(event.y() << 1 | (is_on(event) ? 1 : 0)));
  }

  Fault read(std::span<const std::uint8_t> bytes, Reading& in) const {
    if (bytes.size() % min_event_size != 0) return partial_event;
    for (; !bytes.empty(); bytes = bytes.subspan(min_event_size)) {
      const auto t = in.clock.at(little_endian<std::uint32_t>(bytes.data()));
      const auto x = little_endian<std::uint16_t>(&bytes[4]);
      const auto y_on = little_endian<std::uint16_t>(&bytes[6]);
      if (const auto* fault = in.add(t, x, y_on >> 1, (y_on & 1) != 0)) return fault;
    }
    return nullptr;
  }
};

/// A 64-bit t, then the body of an Event Stream of DVS events. Rows count from the bottom, as in
/// the tools of its authors.
class EventStream : public LayoutOf<5, 1400> {
 public:
  explicit EventStream(const DatagramSettings& settings) : height_(settings.height) {}

  void begin(Microseconds first, Writer& out) {
    written_ = first;
    out.put(static_cast<std::uint64_t>(first));
  }

  std::size_t size_of(const AbsoluteEvent& event) const {
    return static_cast<std::size_t>((event.t - written_) / max_step) + min_event_size;
  }

  void write(const AbsoluteEvent& event, Writer& out) {
    for (; event.t - written_ >= max_step; written_ += max_step) out.put(pause);
    const auto step = static_cast<std::uint32_t>(event.t - written_);
    written_ = event.t;
    out.put(static_cast<std::uint8_t>(step << 1 | (is_on(event) ? 1U : 0U)));
    out.put(event.x);
    out.put(static_cast<std::uint16_t>(height_ - 1 - event.y()));
  }

  Fault read(std::span<const std::uint8_t> bytes, Reading& in) const {
    constexpr std::size_t header_size = 8;
    if (bytes.size() < header_size) return no_header;
    auto t = little_endian<std::uint64_t>(bytes.data());
    if (t > max_time) return time_range;
    for (std::size_t at = header_size; at < bytes.size();) {
      const auto byte = bytes[at];
      if (byte == pause || byte == ignored) {
        t += byte == pause ? std::uint64_t{max_step} : 0;
        ++at;
        continue;
      }
      if (bytes.size() - at < min_event_size) return partial_event;
      t += byte >> 1;
      const auto x = little_endian<std::uint16_t>(&bytes[at + 1]);
      const auto row = little_endian<std::uint16_t>(&bytes[at + 3]);
      if (const auto* fault =
              in.add(static_cast<Microseconds>(t), x, height_ - 1 - row, (byte & 1) != 0))
        return fault;
      at += min_event_size;
    }
    return nullptr;
  }

 private:
  static constexpr int max_step = 127;
  static constexpr std::uint8_t pause = 0xff;
  static constexpr std::uint8_t ignored = 0xfe;

  int height_;
  Microseconds written_ = 0;  ///< time at the end of the bytes so far
};

/// Optionally a sequence number, then pairs of a camera address and the low 32 bits of t;
/// big-endian.
class Jaer : public LayoutOf<8, 1400> {
 public:
  explicit Jaer(const DatagramSettings& settings)
      : addresses_(settings.width == 128 && settings.height == 128 ? dvs128_layout : davis_layout),
        has_sequence_number_(settings.has_sequence_number),
        width_(settings.width),
        height_(settings.height) {
    if (settings.width > addresses_.width() || settings.height > addresses_.height())
      throw std::invalid_argument("jAER's addresses support sensors of up to 1024x512 pixels");
  }

  void begin(Microseconds /*first*/, Writer& out) {
    sent_ = (sent_ + 1) & 0x7fff'ffff;
    if (has_sequence_number_) out.put(sent_, std::endian::big);
  }

  void write(const AbsoluteEvent& event, Writer& out) {
    out.put(addresses_.address(width_ - 1 - event.x, height_ - 1 - event.y(), is_on(event)),
            std::endian::big);
    out.put(static_cast<std::uint32_t>(event.t), std::endian::big);
  }

  Fault read(std::span<const std::uint8_t> bytes, Reading& in) const {
    if (has_sequence_number_) {
      if (bytes.size() < 4) return no_header;
      in.sequence_number = load<std::uint32_t>(bytes.data(), std::endian::big);
      bytes = bytes.subspan(4);
    }
    if (bytes.size() % min_event_size != 0) return partial_event;
    for (; !bytes.empty(); bytes = bytes.subspan(min_event_size)) {
      const auto address = load<std::uint32_t>(bytes.data(), std::endian::big);
      if (addresses_.is_sample(address) || addresses_.is_external(address)) continue;
      const auto t = in.clock.at(load<std::uint32_t>(&bytes[4], std::endian::big));
      const int x = width_ - 1 - addresses_.x(address);
      const int y = height_ - 1 - addresses_.y(address);
      if (address > addresses_.max_address) return outside;
      if (const auto* fault = in.add(t, x, y, addresses_.is_on(address))) return fault;
    }
    return nullptr;
  }

 private:
  AddressLayout addresses_;
  bool has_sequence_number_;
  int width_;
  int height_;
  std::uint32_t sent_ = 0;
};

/// Calls `use` with the layout of a format.
template <class Use>
auto with_layout(const DatagramSettings& settings, const Use& use) {
  switch (settings.format) {
    case DatagramFormat::spif:
      return use(Spif<false>(settings));
    case DatagramFormat::spif_timestamps:
      return use(Spif<true>(settings));
    case DatagramFormat::t64_x16_y16_on8:
      return use(T64X16Y16On8());
    case DatagramFormat::t32_x16_y15_on1:
      return use(T32X16Y15On1());
    case DatagramFormat::es:
      return use(EventStream(settings));
    case DatagramFormat::jaer:
      return use(Jaer(settings));
  }
  throw std::invalid_argument("unknown datagram format");
}

template <class Layout>
class PackerOf final : public DatagramPacker {
 public:
  explicit PackerOf(const Layout& layout) : layout_(layout) {}

  void pack(std::span<const AbsoluteEvent> events, const Send& send) override {
    for (const auto& event : events) {
      if (count_ > 0 && !is_next(event)) flush(send);
      if (count_ == 0) {
        first_ = event.t;
        layout_.begin(event.t, bytes_);
      }
      layout_.write(event, bytes_);
      last_ = event.t;
      ++count_;
      if (bytes_.size() + Layout::min_event_size > Layout::max_size) flush(send);
    }
  }

  void flush(const Send& send) override {
    if (count_ == 0) return;
    send({bytes_.bytes(), count_, first_, last_});
    drop();
  }

  void drop() noexcept override {
    bytes_.clear();
    count_ = 0;
  }

  std::optional<Microseconds> waiting_since() const override {
    if (count_ == 0) return std::nullopt;
    return first_;
  }

 private:
  /// True if the event may join the incomplete datagram.
  bool is_next(const AbsoluteEvent& event) const {
    return event.t >= last_ && event.t - first_ <= max_span_ &&
           bytes_.size() + layout_.size_of(event) <= Layout::max_size;
  }

  Layout layout_;
  Writer bytes_;
  std::size_t count_ = 0;
  Microseconds first_ = 0;
  Microseconds last_ = 0;
};

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
    if (events.front().t < 0) return {.fault = time_range};
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
    if (events.back().t > max_time) return time_range;
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

std::unique_ptr<DatagramPacker> make_datagram_packer(const DatagramSettings& settings) {
  return with_layout(settings,
                     []<class Layout>(const Layout& layout) -> std::unique_ptr<DatagramPacker> {
                       return std::make_unique<PackerOf<Layout>>(layout);
                     });
}

std::unique_ptr<DatagramUnpacker> make_datagram_unpacker(const DatagramSettings& settings) {
  return with_layout(
      settings, [&]<class Layout>(const Layout& layout) -> std::unique_ptr<DatagramUnpacker> {
        return std::make_unique<UnpackerOf<Layout>>(layout, settings.width, settings.height);
      });
}

}  // namespace eventcamera
