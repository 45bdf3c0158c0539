// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/evt/word_scanner.hpp"

#include <algorithm>
#include <bit>
#include <stdexcept>
#include <type_traits>
#include <utility>

#include "src/core/byte_order.hpp"
#include "src/formats/evt/cd_words.hpp"
#include "src/formats/evt/evt3_words.hpp"
#include "src/formats/evt/words.hpp"
#include "src/formats/unit_stream_decoder.hpp"

namespace eventcamera {
namespace {

struct ScannedWord {
  enum class Kind : std::uint8_t {
    time_high,  ///< with a count of the clock
    events,
    other,     ///< any word that belongs to the stream
    unplaced,  ///< events whose row, column or time is not known
    past,      ///< a time before the last one: data of an earlier transfer
    invalid,   ///< no camera writes this here
  };

  Kind kind = Kind::other;
  std::uint32_t count = 0;  ///< of the clock, or of events
};

/// Low 12 bits of the word, of type OTHERS, at the end of a transfer.
inline constexpr std::uint32_t end_marker = 0x019;

/// Words of EVT2, EVT2.1 and EVT4, which state row and column of each event.
template <EvtFormat format>
class ScannedCdWords {
 public:
  using Word = std::conditional_t<format == EvtFormat::evt2 || format == EvtFormat::evt4,
                                  std::uint32_t, std::uint64_t>;
  static constexpr int clock_bits = 28;
  static constexpr int clock_shift = 6;

  explicit ScannedCdWords(SensorSize size) : bounds_(size, max_evt_side) {}

  /// Returns the word in the byte order that decoders read.
  static constexpr Word in_order(Word word) {
    return static_cast<Word>(evt21::in_order<format>(word));
  }

  static constexpr bool is_end_marker(Word word) {
    return (upper(word).bits & 0xf0000fff) == (others << 28 | end_marker);
  }

  ScannedWord read(Word word) {
    using enum ScannedWord::Kind;
    if (mask_follows_) {
      mask_follows_ = false;
      return placed(vector_, static_cast<std::uint32_t>(word));
    }
    const auto cd = upper(word);
    const auto type = cd.type();
    if (type == types.time_high) return {time_high, cd.count()};
    if (is_event(type)) {
      low_ = cd.time_low();
      return placed(cd, format == EvtFormat::evt2 || format == EvtFormat::evt4
                            ? 1
                            : static_cast<std::uint32_t>(word));
    }
    if (format == EvtFormat::evt4 && (type == evt4::cd_vec_off || type == evt4::cd_vec_on)) {
      low_ = cd.time_low();
      vector_ = cd;
      mask_follows_ = true;
      return {bounds_.contain(cd.x(), cd.y()) ? other : invalid};
    }
    return {type == types.trigger || (types.ignored >> type & 1) != 0 ? other : invalid};
  }

  /// Low bits of the time of the last event.
  std::uint32_t event_low() const { return low_; }

  /// Low bits of the earliest possible time of later events, now and before the last TIME_HIGH:
  /// cameras need not sort the events between two of these words.
  static constexpr std::uint32_t low() { return 0; }
  static constexpr std::uint32_t low_before() { return 0; }

  void begin_transfer() {}
  static constexpr bool may_be_past() { return false; }

  /// Forgets the words before a gap.
  void interrupt() {
    mask_follows_ = false;
    low_ = 0;
  }

 private:
  static constexpr CdTypes types = format == EvtFormat::evt2   ? evt2::types
                                   : format == EvtFormat::evt4 ? evt4::types
                                                               : evt21::types;
  static constexpr std::uint32_t others =
      format == EvtFormat::evt4 ? std::uint32_t{evt4::others} : std::uint32_t{evt2::others};

  static constexpr CdWord upper(Word word) {
    return {static_cast<std::uint32_t>(sizeof(Word) == 8 ? std::uint64_t{word} >> 32 : word)};
  }

  static constexpr bool is_event(std::uint32_t type) {
    return format == EvtFormat::evt4 ? type == evt4::cd_off || type == evt4::cd_on
                                     : type <= evt2::cd_on;
  }

  ScannedWord placed(CdWord cd, std::uint32_t mask) const {
    const auto inside = mask & bounds_.of_32(cd.x(), cd.y());
    const auto kind =
        bounds_.contain(cd.x(), cd.y()) ? ScannedWord::Kind::events : ScannedWord::Kind::invalid;
    return {kind, static_cast<std::uint32_t>(std::popcount(inside))};
  }

  Bounds bounds_;
  CdWord vector_{};
  bool mask_follows_ = false;
  std::uint32_t low_ = 0;
};

/// Words of EVT3, which set row, columns and time for those that follow.
class ScannedEvt3Words {
 public:
  using Word = std::uint16_t;
  static constexpr int clock_bits = 12;
  static constexpr int clock_shift = 12;

  explicit ScannedEvt3Words(SensorSize size) : bounds_(size, max_evt_side) {}

  static constexpr Word in_order(Word word) { return word; }

  static constexpr bool is_end_marker(Word word) {
    return word == (evt3::others << 12 | end_marker);
  }

  ScannedWord read(Word word) {
    using enum ScannedWord::Kind;
    const std::uint32_t value = word & 0x7ff;
    switch (word >> 12) {
      case evt3::addr_y:
        has_row_ = bounds_.contain(0, value);
        return {has_row_ ? other : invalid};
      case evt3::em_addr_y:
        has_row_ = false;
        return {other};
      case evt3::addr_x:
        if (!bounds_.contain(value, 0)) return {invalid, 1};
        return {has_row_ && has_low_ ? events : unplaced, 1};
      case evt3::vect_base_x:
        has_base_ = bounds_.contain(value, 0);
        base_ = value;
        return {has_base_ ? other : invalid};
      case evt3::vect_12:
        return masked(word & 0xfff, 12);
      case evt3::vect_8:
        return masked(word & 0xff, 8);
      case evt3::time_low:
        return time_low(word & 0xfff);
      case evt3::time_high:
        // A new count resets the low bits.
        low_before_ = low_;
        if (const std::uint32_t count = word & 0xfff; count != high_) {
          has_low_ = high_ != none;
          high_ = count;
          low_ = 0;
          may_be_past_ = false;
        }
        return {time_high, high_};
      case evt3::ext_trigger:
        return {has_low_ ? other : unplaced};
      case evt3::others:
      case evt3::continued_4:
      case evt3::continued_12:
        return {other};
      default:
        return {word == evt3::padding ? other : invalid};
    }
  }

  std::uint32_t event_low() const { return low_; }
  std::uint32_t low() const { return low_; }
  std::uint32_t low_before() const { return low_before_; }

  /// Until its high bits first change, a transfer may be an old one; decreasing low bits reveal
  /// that.
  void begin_transfer() { may_be_past_ = true; }
  bool may_be_past() const { return may_be_past_; }

  void interrupt() {
    has_row_ = has_base_ = has_low_ = may_be_past_ = false;
    high_ = none;
    low_ = low_before_ = 0;
  }

 private:
  static constexpr std::uint32_t none = ~std::uint32_t{0};

  ScannedWord time_low(std::uint32_t low) {
    const bool is_past = may_be_past_ && has_low_ && low < low_;
    has_low_ = high_ != none;
    low_ = low;
    return {is_past ? ScannedWord::Kind::past : ScannedWord::Kind::other};
  }

  ScannedWord masked(std::uint32_t mask, std::uint32_t columns) {
    const bool is_placed = has_base_ && has_row_ && has_low_;
    const auto inside = is_placed ? mask & bounds_.of_32(base_, 0) : mask;
    // A vector continues only after columns that were passed on.
    has_base_ = is_placed;
    base_ += columns;
    return {is_placed ? ScannedWord::Kind::events : ScannedWord::Kind::unplaced,
            static_cast<std::uint32_t>(std::popcount(inside))};
  }

  Bounds bounds_;
  std::uint32_t high_ = none;
  std::uint32_t low_ = 0;
  std::uint32_t low_before_ = 0;
  std::uint32_t base_ = 0;
  bool has_row_ = false;
  bool has_base_ = false;
  bool has_low_ = false;
  bool may_be_past_ = false;
};

using Kind = ScannedWord::Kind;

/// Limit of a stretch, in bytes.
constexpr std::ptrdiff_t max_stretch = std::ptrdiff_t{1} << 20;

/// Range of the shortest clock, EVT3's.
constexpr Microseconds clock_range = Microseconds{1} << 24;

/// Unwraps the counts of TIME_HIGH words.
template <int bits, int shift>
class CameraClock {
 public:
  /// Time of the last count, in microseconds.
  Microseconds time() const { return origin_ + static_cast<Microseconds>(high_ << shift); }

  static bool continues(std::uint64_t from, std::uint32_t count) {
    return step(from, count) <= max_step;
  }
  bool continues(std::uint32_t count) const { return continues(high_, count); }

  void follow(std::uint32_t count) {
    if (step(high_, count) == 0) return;
    before_ = high_;
    high_ += step(high_, count);
  }

  /// True if a count after a gap may follow the last one, or the one before, if the last was wrong.
  bool may_follow(std::uint32_t count) const {
    return !is_known_ || continues(count) ||
           (continues(before_, count) && step(before_, count) > 0);
  }

  bool is_last(std::uint32_t count) const { return is_known_ && step(high_, count) == 0; }

  /// Continues after a gap, for which another clock may expect a time. False if the count is of the
  /// past.
  bool resume(std::uint32_t count, std::optional<Microseconds> expected) {
    if (!std::exchange(is_known_, true)) {
      before_ = high_ = count;
    } else if (continues(count)) {
      follow(count);
    } else if (may_follow(count)) {
      high_ = before_ + step(before_, count);
    } else if (const auto next = nearest(count, expected); next > high_) {
      before_ = high_ = next;
    } else {
      return false;
    }
    return true;
  }

  /// Continues after the camera's clock started over, at the next time that decoders unwrap this
  /// count to.
  void start_over(std::uint32_t count, std::optional<Microseconds> expected) {
    const auto earliest = std::max(time(), expected.value_or(0));
    before_ = high_ = count;
    origin_ = 0;
    const auto missing = std::max<Microseconds>(earliest - time(), 0);
    origin_ = (missing + clock_range - 1) / clock_range * clock_range;
  }

 private:
  /// Limit of small steps: two minutes for 28 bits, two seconds for 12.
  static constexpr std::uint64_t max_step = std::uint64_t{1} << (bits * 3 / 4);
  static constexpr std::uint64_t range = std::uint64_t{1} << bits;

  static constexpr std::uint64_t step(std::uint64_t from, std::uint32_t count) {
    return (count - from) & (range - 1);
  }

  /// The time with this count that is nearest to the expected one, or else to the last one.
  std::uint64_t nearest(std::uint32_t count, std::optional<Microseconds> expected) const {
    auto from = high_;
    if (expected && *expected > time())
      from += static_cast<std::uint64_t>(*expected - time()) >> shift;
    const auto after = from + step(from, count);
    if (after - from <= range / 2) return after;
    return after >= range ? after - range : 0;
  }

  std::uint64_t high_ = 0;
  std::uint64_t before_ = 0;  ///< the count before
  Microseconds origin_ = 0;   ///< a multiple of clock_range
  bool is_known_ = false;
};

template <class Words>
class Scanner final : public WordScanner {
 public:
  Scanner(SensorSize sensor, Framing framing)
      : is_padded_(framing == Framing::padded), words_(sensor) {}

  void scan(const Transfer& transfer, std::vector<Piece>& out) override {
    if (transfer.is_discontinuous) interrupt(out);
    if (transfer.elapsed && elapsed_)
      *elapsed_ += *transfer.elapsed;
    else
      elapsed_.reset();
    auto pending = std::exchange(pending_, {});
    auto bytes = transfer.bytes;
    if (!pending.empty()) {
      pending.insert(pending.end(), bytes.begin(), bytes.end());
      bytes = pending;
    }
    committed_at_ = bytes.data();
    end_ = bytes.data() + bytes.size();
    if (is_padded_) {
      end_ = end_of_words(committed_at_, end_);
      words_.begin_transfer();
    }
    read(out);
    pending_.assign(committed_at_, end_);
  }

  void finish(std::vector<Piece>& out) override {
    is_ended_ = true;
    scan({}, out);
    is_ended_ = false;
    interrupt(out);
  }

 private:
  using Word = typename Words::Word;
  using Clock = CameraClock<Words::clock_bits, Words::clock_shift>;

  static constexpr std::ptrdiff_t size = sizeof(Word);

  /// Words read since the last commit.
  struct Stretch {
    std::uint64_t events = 0;
    std::uint64_t lost_bytes = 0;
    std::uint64_t lost_events = 0;
  };

  static Word word_at(const std::uint8_t* at) { return Words::in_order(little_endian<Word>(at)); }

  /// Returns the end of the words of a padded transfer: its first end marker, or else the end of
  /// its bytes without trailing zeros.
  static const std::uint8_t* end_of_words(const std::uint8_t* begin, const std::uint8_t* end) {
    constexpr std::ptrdiff_t min_zeros = 16;
    // A transfer may end within a word of 64 bits.
    for (std::ptrdiff_t half = 0; half < size && end - begin >= size; half += 4)
      for (const auto* at = begin + half; end - at >= size; at += size)
        if (Words::is_end_marker(word_at(at))) return at;
    const auto* last = end;
    while (last != begin && last[-1] == 0) --last;
    last = std::min(end, begin + (last - begin + size - 1) / size * size);
    return end - last >= min_zeros ? last : end;
  }

  /// Reads the bytes from committed_at_ to end_, the first of which may have been read before.
  void read(std::vector<Piece>& out) {
    while (true) {
      if (!is_synchronised_ && !find_stretches()) return;
      const auto fault = read_stretches();
      if (!fault) break;
      close(out);
      if (*fault == Kind::past) {
        discard();
        return;
      }
    }
    append_pending(out);
  }

  /// Moves committed_at_ to the first stretches that are complete and continue the clock, or to the
  /// first byte that may belong to such. Earlier bytes are lost.
  bool find_stretches() {
    auto skipped = words_;
    skipped.interrupt();
    while (end_ - committed_at_ >= size) {
      auto trial = words_;
      trial.interrupt();
      const auto first = trial.read(word_at(committed_at_));
      if (first.kind == Kind::time_high) {
        switch (try_stretches(trial, first.count)) {
          case Trial::valid:
            if (resume(first.count)) return true;
            discard();
            return false;
          case Trial::incomplete:
            return false;
          case Trial::invalid:
            break;
        }
      }
      lose(skipped, is_padded_ ? size : 1);
    }
    // The next transfer begins with a whole word.
    if (is_padded_) lose(skipped, end_ - committed_at_);
    return false;
  }

  enum class Trial : std::uint8_t { valid, invalid, incomplete };

  /// Reads the stretches after the TIME_HIGH at committed_at_. In a transfer, one is enough,
  /// because its words begin where it begins. Among loose bytes, several distinguish words from
  /// bytes that look like them; if one of them continues the clock and the first does not, the
  /// first has a wrong time.
  Trial try_stretches(Words& words, std::uint32_t first) const {
    const int needed = is_padded_ ? 1 : 4;
    // Whether an old transfer came again is not known while its time is the last one.
    if (is_padded_ && clock_.is_last(first)) return Trial::invalid;
    const bool is_leap = !clock_.may_follow(first);
    auto count = first;
    int found = 0;
    const auto* at = committed_at_ + size;
    for (; found < needed && end_ - at >= size; at += size) {
      if (at - committed_at_ > max_stretch) return Trial::invalid;
      const auto word = words.read(word_at(at));
      if (word.kind == Kind::invalid) return Trial::invalid;
      if (word.kind != Kind::time_high) continue;
      if (!Clock::continues(count, word.count)) return Trial::invalid;
      if (is_leap && !is_padded_ && clock_.continues(word.count)) return Trial::invalid;
      count = word.count;
      ++found;
    }
    if (found == needed || (is_ended_ && found > 0)) return Trial::valid;
    return Trial::incomplete;
  }

  /// Continues the clock after a gap. False if the transfer is an old one.
  bool resume(std::uint32_t count) {
    std::optional<Microseconds> expected;
    if (elapsed_) expected = clock_.time() + *elapsed_;
    if (!clock_.resume(count, expected)) {
      const bool has_started_over =
          !is_padded_ || (past_ && *past_ != count && Clock::continues(*past_, count));
      if (!has_started_over) return false;
      clock_.start_over(count, expected);
    }
    past_.reset();
    is_synchronised_ = true;
    words_.interrupt();
    piece_ = {.words = {}, .start = clock_.time(), .end = clock_.time(), .is_discontinuous = true};
    has_events_ = false;
    if (std::exchange(has_begun_, true)) ++counts_.gaps;
    return true;
  }

  /// Reads stretches up to the end, or to an invalid word, which it returns the kind of.
  std::optional<Kind> read_stretches() {
    const auto* at = committed_at_ + read_;
    run_ = at;
    for (; end_ - at >= size; at += size) {
      const auto word = words_.read(word_at(at));
      switch (word.kind) {
        case Kind::time_high:
          if (!clock_.continues(word.count)) return Kind::invalid;
          if (!words_.may_be_past()) commit(at, clock_.time() + words_.low_before());
          clock_.follow(word.count);
          break;
        case Kind::events:
          if (!std::exchange(has_events_, true)) first_event_ = clock_.time() + words_.event_low();
          stretch_.events += word.count;
          break;
        case Kind::other:
          break;
        case Kind::unplaced:
          append_run(at);
          run_ = at + size;
          stretch_.lost_bytes += sizeof(Word);
          stretch_.lost_events += word.count;
          continue;
        case Kind::past:
        case Kind::invalid:
          return word.kind;
      }
      if (at - committed_at_ >= max_stretch) return Kind::invalid;
    }
    if (is_padded_ || is_ended_) commit(at, time_after());
    append_run(at);
    read_ = static_cast<std::size_t>(at - committed_at_);
    return std::nullopt;
  }

  /// Appends the words from run_ to `at` to the piece.
  void append_run(const std::uint8_t* at) {
    auto& words = piece_.words;
    const auto old = words.size();
    words.insert(words.end(), run_, at);
    run_ = at;
    if constexpr (Words::in_order(1) != 1)
      for (auto half = words.begin() + static_cast<std::ptrdiff_t>(old); half != words.end();
           half += size)
        std::swap_ranges(half, half + size / 2, half + size / 2);
  }

  /// No later event is earlier.
  Microseconds time_after() const { return clock_.time() + words_.low(); }

  /// Decides that the words before `at` are passed on.
  void commit(const std::uint8_t* at, Microseconds end) {
    append_run(at);
    committed_at_ = at;
    committed_size_ = piece_.words.size();
    // Decoders set their clock by the first event, which has to be within its interval.
    piece_.end = std::max({piece_.end, end, first_event_.value_or(end)});
    first_event_.reset();
    counts_.events += stretch_.events;
    counts_.lost_bytes += stretch_.lost_bytes;
    counts_.lost_events += stretch_.lost_events;
    stretch_ = {};
    read_ = 0;
    elapsed_ = 0;
  }

  /// Appends the committed words.
  void append_pending(std::vector<Piece>& out) {
    if (committed_size_ == 0) return;
    Piece next{.words = {piece_.words.begin() + static_cast<std::ptrdiff_t>(committed_size_),
                         piece_.words.end()},
               .start = piece_.end,
               .end = piece_.end};
    piece_.words.resize(committed_size_);
    counts_.bytes += committed_size_;
    out.push_back(std::exchange(piece_, std::move(next)));
    committed_size_ = 0;
  }

  /// Ends the synchronisation; words since the last commit are not passed on.
  void close(std::vector<Piece>& out) {
    append_pending(out);
    is_synchronised_ = false;
    piece_ = {};
    first_event_.reset();
    stretch_ = {};
    read_ = 0;
  }

  void lose(Words& words, std::ptrdiff_t count) {
    if (count == size) {
      const auto word = words.read(word_at(committed_at_));
      if (word.kind == Kind::events || word.kind == Kind::unplaced)
        counts_.lost_events += word.count;
    }
    counts_.lost_bytes += static_cast<std::uint64_t>(count);
    committed_at_ += count;
  }

  /// Drops the words up to end_, of an old transfer or before a gap.
  void discard() {
    auto skipped = words_;
    skipped.interrupt();
    while (end_ - committed_at_ >= size) {
      if (const auto word = Words(skipped).read(word_at(committed_at_));
          word.kind == Kind::time_high)
        past_ = word.count;
      lose(skipped, size);
    }
    lose(skipped, end_ - committed_at_);
  }

  /// Something is missing before the next transfer.
  void interrupt(std::vector<Piece>& out) {
    close(out);
    committed_at_ = pending_.data();
    end_ = committed_at_ + pending_.size();
    discard();
    past_.reset();
    pending_.clear();
  }

  bool is_padded_;
  bool is_ended_ = false;  ///< no more bytes will come
  Words words_;
  Clock clock_;
  bool is_synchronised_ = false;
  bool has_begun_ = false;
  std::optional<std::uint32_t> past_;        ///< last count of an old transfer
  std::optional<Microseconds> elapsed_ = 0;  ///< since the last commit

  const std::uint8_t* committed_at_ = nullptr;  ///< everything before is passed on, or lost
  const std::uint8_t* end_ = nullptr;           ///< of the words of the transfer
  std::vector<std::uint8_t> pending_;           ///< bytes from committed_at_ of the last transfer
  const std::uint8_t* run_ = nullptr;           ///< words from here on are not yet in the piece
  std::size_t read_ = 0;                        ///< bytes from committed_at_ on that were read

  Piece piece_;
  std::size_t committed_size_ = 0;  ///< bytes of the piece
  Stretch stretch_;
  bool has_events_ = false;                  ///< since the last gap
  std::optional<Microseconds> first_event_;  ///< since the last gap, if not yet passed on
};

}  // namespace

std::unique_ptr<WordScanner> make_word_scanner(EvtFormat format, SensorSize size, Framing framing) {
  switch (format) {
    case EvtFormat::evt2:
      return std::make_unique<Scanner<ScannedCdWords<EvtFormat::evt2>>>(size, framing);
    case EvtFormat::evt21:
      return std::make_unique<Scanner<ScannedCdWords<EvtFormat::evt21>>>(size, framing);
    case EvtFormat::evt21_legacy:
      return std::make_unique<Scanner<ScannedCdWords<EvtFormat::evt21_legacy>>>(size, framing);
    case EvtFormat::evt3:
      return std::make_unique<Scanner<ScannedEvt3Words>>(size, framing);
    case EvtFormat::evt4:
      return std::make_unique<Scanner<ScannedCdWords<EvtFormat::evt4>>>(size, framing);
  }
  throw std::invalid_argument("unknown EVT format");
}

}  // namespace eventcamera
