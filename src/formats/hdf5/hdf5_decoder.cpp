// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/hdf5/hdf5_decoder.hpp"

#include <limits>
#include <utility>
#include <vector>

#include "src/formats/collected_bytes.hpp"
#include "src/formats/hdf5/hdf5_reader.hpp"

namespace eventcamera {

namespace {

/// The events of a file.
class Hdf5Decoder final : public Decoder {
 public:
  explicit Hdf5Decoder(Hdf5Selection selection) : selection_(std::move(selection)) {}

  void push(std::span<const std::uint8_t> piece) override { collected_.push(piece); }

  void drain() override {
    reader_ = std::make_unique<Hdf5Reader>(collected_.take(), selection_);
    describe();
  }

  bool open(ByteSource& source) override {
    reader_ = std::make_unique<Hdf5Reader>(source, selection_);
    opened_ = true;
    describe();
    return true;
  }

  bool is_table() const override { return true; }

  /// Returns events after the triggers up to their time.
  std::optional<Item> next() override {
    if (!reader_) return std::nullopt;
    if (!events_due_) {
      events_.clear();
      events_due_ = reader_->read(read_at_once, events_) > 0;
    }
    if (!events_due_ || triggers_until_ <= events_.back().t) {
      triggers_.clear();
      if (reader_->read_triggers(read_at_once, triggers_) > 0) {
        triggers_until_ = triggers_.back().t;
        return TriggerItem{0, triggers_};
      }
    }
    if (!std::exchange(events_due_, false)) return std::nullopt;
    return EventItem{0, events_};
  }

  const std::vector<StreamInfo>& streams() const override { return streams_; }

  const Corruption& corruption() const override {
    static const Corruption none;
    return reader_ ? reader_->corruption() : none;
  }

  UnreadStreams unread_streams() const override {
    if (!reader_ || reader_->others().empty()) return {};
    return {.names = "events in " + reader_->others(), .property = "events-path"};
  }

  /// A pushed file must be pushed again as a whole.
  std::optional<SeekPoint> seek_point_before(Microseconds t) const override {
    if (!opened_) return std::nullopt;
    return SeekPoint{.t = t};
  }

  void restart(const SeekPoint& seek_point) override {
    events_due_ = false;
    triggers_until_ = std::numeric_limits<Microseconds>::min();
    reader_->seek(seek_point.t);
  }

  std::optional<Microseconds> last_time() override {
    const auto range = reader_ ? reader_->time_range() : std::nullopt;
    if (!range) return std::nullopt;
    return range->last;
  }

 private:
  static constexpr std::size_t read_at_once = std::size_t{1} << 14;

  void describe() {
    streams_.front().size = reader_->size();
    streams_.front().labelled = reader_->has_labels();
  }

  Hdf5Selection selection_;
  CollectedBytes collected_{"an HDF5 file"};
  std::unique_ptr<Hdf5Reader> reader_;  ///< set once the file can be read
  std::vector<StreamInfo> streams_{{.id = 0, .kind = StreamKind::events, .size = {}, .source = {}}};
  std::vector<AbsoluteEvent> events_;
  std::vector<Trigger> triggers_;
  bool events_due_ = false;  ///< events_ are to be returned
  Microseconds triggers_until_ = std::numeric_limits<Microseconds>::min();  ///< time of the last
  bool opened_ = false;  ///< opened, not collected
};

}  // namespace

std::unique_ptr<Decoder> make_hdf5_decoder(Hdf5Selection selection) {
  return std::make_unique<Hdf5Decoder>(std::move(selection));
}

}  // namespace eventcamera
