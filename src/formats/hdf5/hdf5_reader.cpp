// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/hdf5/hdf5_reader.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <utility>
#include <vector>

#include "src/formats/byte_source.hpp"
#include "src/formats/corruption.hpp"
#include "src/formats/hdf5/hdf5_dataset.hpp"
#include "src/formats/hdf5/hdf5_file.hpp"
#include "src/formats/hdf5/hdf5_table.hpp"

namespace eventcamera {

/// Closes the file while no other thread uses the library.
struct Hdf5Reader::File {
  explicit File(Hdf5Handle opened) : handle(std::move(opened)) {}
  File(const File&) = delete;
  File& operator=(const File&) = delete;

  ~File() {
    const Hdf5Session session;
    handle = {};
  }

  Hdf5Handle handle;
};

namespace {

/// The events of a file.
class Hdf5Decoder final : public Decoder {
 public:
  explicit Hdf5Decoder(Hdf5Selection selection) : selection_(std::move(selection)) {}

  void push(std::span<const std::uint8_t> piece) override { collected_.push(piece); }

  void drain() override {
    reader_ = std::make_unique<Hdf5Reader>(collected_.finish(), selection_);
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
  bool events_due_ = false;  ///< next() returns events_
  Microseconds triggers_until_ = std::numeric_limits<Microseconds>::min();  ///< time of the last
  bool opened_ = false;  ///< opened, not collected
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

Hdf5Handle open_source(ByteSource& bytes) {
  if (!is_signed(bytes)) throw UnsupportedFormat("This is not an HDF5 file");
  auto file = open_hdf5(bytes);
  if (!file) throw UnsupportedFormat("This HDF5 file is corrupt, cut short, or being written");
  return file;
}

}  // namespace

std::unique_ptr<Decoder> make_hdf5_decoder(Hdf5Selection selection) {
  return std::make_unique<Hdf5Decoder>(std::move(selection));
}

/// Triggers of the Metavision layout.
class Hdf5Triggers {
 public:
  /// Returns null if the file has none.
  static std::unique_ptr<Hdf5Triggers> open(hid_t file) {
    if (!Hdf5Dataset::exists(file, "EXT_TRIGGER/events", H5O_TYPE_DATASET)) return nullptr;
    return std::unique_ptr<Hdf5Triggers>(new Hdf5Triggers(file));
  }

  /// Appends a bounded number of triggers from the next row on. False at the end.
  bool read(std::size_t count, std::vector<Trigger>& out, Corruption& corruption) {
    if (row_ >= dataset_.rows() || count == 0) return false;
    const auto end = std::min<std::uint64_t>(block_end(row_, dataset_.rows()), row_ + count);
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
  explicit Hdf5Triggers(hid_t file) : dataset_(file, "EXT_TRIGGER/events") {
    if (dataset_.rank() != 1)
      throw UnsupportedFormat("HDF5 dataset /EXT_TRIGGER/events must hold rows");
    const std::string members[] = {"t", "p", "id"};
    dataset_.choose(members);
    dataset_.require_filters();
  }

  Hdf5Dataset dataset_;
  std::uint64_t row_ = 0;
  std::vector<std::int64_t> numbers_;  ///< t, p and id of each row
};

Hdf5Reader::Hdf5Reader(std::unique_ptr<ByteSource> bytes, const Hdf5Selection& selection)
    : Hdf5Reader(*bytes, selection) {
  bytes_ = std::move(bytes);
}

Hdf5Reader::Hdf5Reader(ByteSource& bytes, const Hdf5Selection& selection)
    : file_(std::make_unique<File>(open_source(bytes))) {
  const Hdf5Session session;
  const auto id = file_->handle.get();
  table_ = Hdf5Table::open(id, selection);
  size_ = table_->size();
  has_labels_ = table_->has_labels();
  if (table_->format() == Hdf5Format::metavision) triggers_ = Hdf5Triggers::open(id);
  validator_.set_size(size_);
  if (table_->rows() < table_->claimed_rows())
    corruption_.note(0, "there are fewer events than the file says");
}

Hdf5Reader::~Hdf5Reader() {
  const Hdf5Session session;
  triggers_.reset();
  table_.reset();
  file_.reset();
}

std::string Hdf5Reader::others() const {
  return table_->others();
}

std::optional<Hdf5Reader::TimeRange> Hdf5Reader::time_range() const {
  const Hdf5Session session;
  if (table_->rows() == 0) return std::nullopt;
  const auto first = table_->time_at(0);
  const auto last = table_->time_at(table_->rows() - 1);
  if (!first || !last) return std::nullopt;
  return TimeRange{*first, *last};
}

/// Reads until there are events to return, or to the end.
void Hdf5Reader::fill() {
  while (returned_ == events_.size() && row_ < table_->rows()) {
    events_.clear();
    returned_ = 0;
    row_ = table_->read(row_, validator_, events_, corruption_);
    if (!not_before_) continue;
    const auto found = std::ranges::find_if(
        events_, [&](const AbsoluteEvent& event) { return event.t >= *not_before_; });
    returned_ = static_cast<std::size_t>(found - events_.begin());
    if (found != events_.end()) not_before_.reset();
  }
}

std::size_t Hdf5Reader::read(std::size_t count, std::vector<AbsoluteEvent>& out) {
  const Hdf5Session session;
  std::size_t read = 0;
  while (read < count) {
    fill();
    const auto part = std::min(count - read, events_.size() - returned_);
    if (part == 0) break;
    const auto begin = events_.begin() + static_cast<std::ptrdiff_t>(returned_);
    out.insert(out.end(), begin, begin + static_cast<std::ptrdiff_t>(part));
    returned_ += part;
    read += part;
  }
  return read;
}

std::size_t Hdf5Reader::read_triggers(std::size_t count, std::vector<Trigger>& out) {
  const Hdf5Session session;
  const auto before = out.size();
  while (triggers_ && triggers_->read(count - (out.size() - before), out, corruption_)) {
  }
  return out.size() - before;
}

void Hdf5Reader::seek(Microseconds t) {
  const Hdf5Session session;
  events_.clear();
  returned_ = 0;
  row_ = table_->row_before(t);
  not_before_ = t;
  if (triggers_) triggers_->seek(t);
}

}  // namespace eventcamera
