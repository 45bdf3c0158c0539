// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/hdf5/hdf5_decoder.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "src/formats/byte_source.hpp"
#include "src/formats/corruption.hpp"
#include "src/formats/hdf5/hdf5_dataset.hpp"
#include "src/formats/hdf5/hdf5_file.hpp"
#include "src/formats/hdf5/hdf5_table.hpp"

namespace eventcamera {

namespace {

constexpr const char* triggers_path = "EXT_TRIGGER/events";

/// Triggers of the Metavision layout.
class Hdf5Triggers {
 public:
  explicit Hdf5Triggers(hid_t file) : dataset_(file, triggers_path) {
    if (dataset_.rank() != 1)
      throw UnsupportedFormat("HDF5 dataset /EXT_TRIGGER/events must hold rows");
    const std::string members[] = {"t", "p", "id"};
    dataset_.choose(members);
    dataset_.require_filters();
  }

  /// Appends a bounded number of triggers from the next row on. False at the end.
  bool read(std::vector<Trigger>& out, Corruption& corruption) {
    if (row_ >= dataset_.rows()) return false;
    const auto end = block_end(row_, dataset_.rows());
    if (dataset_.read(row_, end - row_, numbers_)) {
      for (std::size_t i = 0; i < numbers_.size(); i += 3)
        out.push_back(
            {numbers_[i], static_cast<std::uint16_t>(numbers_[i + 2]), numbers_[i + 1] > 0});
    } else {
      note(corruption, dataset_, row_, "unreadable part of an HDF5 dataset");
    }
    row_ = end;
    return true;
  }

  void seek(Microseconds t) {
    row_ = first_row(dataset_.rows(), [&](std::uint64_t row) {
      return dataset_.read(row, 1, numbers_) && numbers_[0] < t;
    });
  }

 private:
  Hdf5Dataset dataset_;
  std::uint64_t row_ = 0;
  std::vector<std::int64_t> numbers_;  ///< t, p and id of each row
};

/// Checks the signature, which may follow a user block whose size is a power of two.
bool is_signed(ByteSource& bytes) {
  constexpr std::array<std::uint8_t, 8> signature = {0x89, 'H', 'D', 'F', '\r', '\n', 0x1a, '\n'};
  const auto size = bytes.size();
  for (std::uint64_t at = 0; at + signature.size() <= size; at = at == 0 ? 512 : 2 * at) {
    std::array<std::uint8_t, 8> found = {};
    if (bytes.read(at, found) != found.size()) return false;
    if (found == signature) return true;
  }
  return false;
}

class Hdf5Decoder final : public Decoder {
 public:
  explicit Hdf5Decoder(Hdf5Selection selection) : selection_(std::move(selection)) {}

  ~Hdf5Decoder() override {
    const Hdf5Session session;
    triggers_.reset();
    table_.reset();
    file_ = {};
  }

  void push(std::span<const std::uint8_t> piece) override { collected_.push(piece); }

  void drain() override {
    bytes_ = collected_.finish();
    open_file(*bytes_);
  }

  bool open(ByteSource& source) override {
    open_file(source);
    return true;
  }

  bool is_table() const override { return true; }

  /// Returns events after the triggers up to their time.
  std::optional<Item> next() override {
    if (!table_) return std::nullopt;
    const Hdf5Session session;
    if (!events_due_) read_events();
    if (!events_due_ || triggers_until_ <= events_.back().t) {
      read_triggers_.clear();
      while (triggers_ && read_triggers_.empty() && triggers_->read(read_triggers_, corruption_))
        continue;
      if (!read_triggers_.empty()) {
        triggers_until_ = read_triggers_.back().t;
        return TriggerItem{0, read_triggers_};
      }
    }
    if (!std::exchange(events_due_, false)) return std::nullopt;
    return EventItem{0, events_};
  }

  const std::vector<StreamInfo>& streams() const override { return streams_; }
  const Corruption& corruption() const override { return corruption_; }

  UnreadStreams unread_streams() const override {
    if (!table_ || table_->others().empty()) return {};
    return {.names = "events in " + table_->others(), .property = "events-path"};
  }

  /// A pushed file must be pushed again as a whole.
  std::optional<SeekPoint> seek_point_before(Microseconds t) const override {
    if (!table_ || bytes_) return std::nullopt;
    return SeekPoint{.t = t};
  }

  void restart(const SeekPoint& seek_point) override {
    const Hdf5Session session;
    row_ = table_->row_before(seek_point.t);
    not_before_ = seek_point.t;
    if (triggers_) triggers_->seek(seek_point.t);
    events_due_ = false;
    triggers_until_ = std::numeric_limits<Microseconds>::min();
  }

  std::optional<Microseconds> last_time() override {
    const Hdf5Session session;
    if (!table_ || table_->rows() == 0) return std::nullopt;
    return table_->time_at(table_->rows() - 1);
  }

 private:
  void open_file(ByteSource& bytes) {
    const Hdf5Session session;
    if (!is_signed(bytes)) throw UnsupportedFormat("This is not an HDF5 file");
    file_ = open_hdf5(bytes);
    if (!file_) throw UnsupportedFormat("This HDF5 file is corrupt, cut short, or being written");
    table_ = Hdf5Table::open(file_.get(), selection_);
    streams_.front().size = table_->size();
    streams_.front().labelled = table_->has_labels();
    validator_.set_size(table_->size());
    if (table_->is_metavision() &&
        Hdf5Dataset::exists(file_.get(), triggers_path, H5O_TYPE_DATASET))
      triggers_.emplace(file_.get());
    if (table_->rows() < table_->claimed_rows())
      corruption_.note(0, "there are fewer events than the file says");
  }

  /// Reads until there are events to return, or to the end.
  void read_events() {
    events_.clear();
    while (events_.empty() && row_ < table_->rows()) {
      row_ = table_->read(row_, validator_, events_, corruption_);
      if (!not_before_) continue;
      const auto found = std::ranges::find_if(
          events_, [&](const AbsoluteEvent& event) { return event.t >= *not_before_; });
      events_.erase(events_.begin(), found);
      if (!events_.empty()) not_before_.reset();
    }
    events_due_ = !events_.empty();
  }

  Hdf5Selection selection_;
  CollectedBytes collected_{"an HDF5 file"};
  std::unique_ptr<ByteSource> bytes_;  ///< collected; null if the file was opened
  Hdf5Handle file_;
  std::unique_ptr<Hdf5Table> table_;  ///< set once the file can be read
  std::optional<Hdf5Triggers> triggers_;
  RowValidator validator_;
  Corruption corruption_;
  std::vector<StreamInfo> streams_{{.id = 0, .kind = StreamKind::events, .size = {}, .source = {}}};

  std::uint64_t row_ = 0;                   ///< next row to read
  std::optional<Microseconds> not_before_;  ///< time of a seek, until its first event is found
  std::vector<AbsoluteEvent> events_;
  bool events_due_ = false;  ///< next() returns events_
  std::vector<Trigger> read_triggers_;
  Microseconds triggers_until_ = std::numeric_limits<Microseconds>::min();  ///< time of the last
};

}  // namespace

std::unique_ptr<Decoder> make_hdf5_decoder(Hdf5Selection selection) {
  return std::make_unique<Hdf5Decoder>(std::move(selection));
}

}  // namespace eventcamera
