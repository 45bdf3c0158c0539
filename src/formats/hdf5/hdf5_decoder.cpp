// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/hdf5/hdf5_decoder.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <utility>

#include "src/formats/hdf5/hdf5_file.hpp"
#include "src/formats/hdf5/hdf5_table.hpp"

namespace eventcamera {

struct Hdf5Decoder::File {
  File() = default;
  File(File&&) = default;
  File& operator=(File&&) = delete;
  ~File() {
    const Hdf5Session session;
    handle = {};
  }

  std::unique_ptr<ByteSource> bytes;  ///< null if not owned by the reader
  Hdf5Handle handle;
};

namespace {

Hdf5Handle open_path(const std::filesystem::path& path) {
  const Hdf5Session session;
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error))
    throw std::runtime_error("No such file: " + path.string());
  const auto is_hdf5 = H5Fis_hdf5(path.c_str());
  if (is_hdf5 == 0) throw UnsupportedFormat(path.string() + " is not an HDF5 file");
  Hdf5Handle file(is_hdf5 > 0 ? H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT) : -1, H5Fclose);
  if (!file)
    throw std::runtime_error(
        path.string() + " cannot be opened: it may not be read, is corrupt, or is being written");
  return file;
}

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

Hdf5Decoder::Hdf5Decoder(const std::filesystem::path& path)
    : Hdf5Decoder([&] {
        File file;
        file.handle = open_path(path);
        return file;
      }()) {}

Hdf5Decoder::Hdf5Decoder(std::unique_ptr<ByteSource> bytes)
    : Hdf5Decoder([&] {
        File file;
        file.handle = open_source(*bytes);
        file.bytes = std::move(bytes);
        return file;
      }()) {}

Hdf5Decoder::Hdf5Decoder(ByteSource& bytes)
    : Hdf5Decoder([&] {
        File file;
        file.handle = open_source(bytes);
        return file;
      }()) {}

Hdf5Decoder::Hdf5Decoder(File file) : file_(std::make_unique<File>(std::move(file))) {
  const Hdf5Session session;
  const auto id = file_->handle.get();
  table_ = Hdf5Table::open(id);
  format_ = table_->format();
  size_ = table_->size();
  has_labels_ = table_->has_labels();
  if (format_ == Hdf5Format::metavision) triggers_ = Hdf5Triggers::open(id);
  validator_.set_size(size_);
  if (table_->rows() < table_->claimed_rows())
    corruption_.note(0, "there are fewer events than the file says");
}

Hdf5Decoder::~Hdf5Decoder() {
  const Hdf5Session session;
  triggers_.reset();
  table_.reset();
  file_.reset();
}

std::uint64_t Hdf5Decoder::count() const {
  return table_->rows();
}

std::optional<Hdf5Decoder::TimeRange> Hdf5Decoder::time_range() const {
  const Hdf5Session session;
  if (table_->rows() == 0) return std::nullopt;
  const auto first = table_->time_at(0);
  const auto last = table_->time_at(table_->rows() - 1);
  if (!first || !last) return std::nullopt;
  return TimeRange{*first, *last};
}

/// Reads until there are events to return, or to the end.
void Hdf5Decoder::fill() {
  while (taken_ == events_.size() && row_ < table_->rows()) {
    events_.clear();
    taken_ = 0;
    row_ = table_->read(row_, validator_, events_, corruption_);
    if (!not_before_) continue;
    const auto found = std::ranges::find_if(
        events_, [&](const AbsoluteEvent& event) { return event.t >= *not_before_; });
    taken_ = static_cast<std::size_t>(found - events_.begin());
    if (found != events_.end()) not_before_.reset();
  }
}

std::size_t Hdf5Decoder::read(std::size_t count, std::vector<AbsoluteEvent>& out) {
  const Hdf5Session session;
  std::size_t read = 0;
  while (read < count) {
    fill();
    const auto part = std::min(count - read, events_.size() - taken_);
    if (part == 0) break;
    const auto begin = events_.begin() + static_cast<std::ptrdiff_t>(taken_);
    out.insert(out.end(), begin, begin + static_cast<std::ptrdiff_t>(part));
    taken_ += part;
    read += part;
  }
  return read;
}

std::size_t Hdf5Decoder::read_triggers(std::size_t count, std::vector<Trigger>& out) {
  const Hdf5Session session;
  const auto before = out.size();
  while (triggers_ && triggers_->read(count - (out.size() - before), out, corruption_)) {
  }
  return out.size() - before;
}

void Hdf5Decoder::seek(Microseconds t) {
  const Hdf5Session session;
  events_.clear();
  taken_ = 0;
  row_ = table_->row_before(t);
  not_before_ = t;
  if (triggers_) triggers_->seek(t);
}

namespace {

/// The events of a file.
class Hdf5Items final : public RecordingDecoder {
 public:
  void push(std::span<const std::uint8_t> piece) override {
    constexpr std::size_t max_collected = std::size_t{1} << 28;
    if (piece.size() > max_collected - collected_.size())
      throw UnsupportedFormat("an HDF5 file this large has to be pulled, as from filesrc");
    collected_.insert(collected_.end(), piece.begin(), piece.end());
  }

  void finish() override {
    file_ = std::make_unique<Hdf5Decoder>(std::make_unique<MemoryBytes>(std::move(collected_)));
    describe();
  }

  bool open(ByteSource& source) override {
    file_ = std::make_unique<Hdf5Decoder>(source);
    opened_ = true;
    describe();
    return true;
  }

  /// Returns events after the triggers up to their time.
  std::optional<Item> next() override {
    if (!file_) return std::nullopt;
    if (!events_due_) {
      events_.clear();
      events_due_ = file_->read(read_at_once, events_) > 0;
    }
    if (!events_due_ || triggers_until_ <= events_.back().t) {
      triggers_.clear();
      if (file_->read_triggers(read_at_once, triggers_) > 0) {
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
    return file_ ? file_->corruption() : none;
  }

  /// A pushed file must be pushed again as a whole.
  std::optional<SeekPoint> seek_point_before(Microseconds t) const override {
    if (!opened_) return std::nullopt;
    return SeekPoint{.t = t};
  }

  void restart(const SeekPoint& seek_point) override {
    events_due_ = false;
    triggers_until_ = std::numeric_limits<Microseconds>::min();
    file_->seek(seek_point.t);
  }

  std::optional<Microseconds> last_time() override {
    const auto range = file_ ? file_->time_range() : std::nullopt;
    if (!range) return std::nullopt;
    return range->last;
  }

 private:
  static constexpr std::size_t read_at_once = std::size_t{1} << 14;

  void describe() {
    streams_.front().size = file_->size();
    streams_.front().labelled = file_->has_labels();
  }

  std::vector<std::uint8_t> collected_;
  std::unique_ptr<Hdf5Decoder> file_;  ///< set once the file can be read
  std::vector<StreamInfo> streams_{{.id = 0, .kind = StreamKind::events, .size = {}, .source = {}}};
  std::vector<AbsoluteEvent> events_;
  std::vector<Trigger> triggers_;
  bool events_due_ = false;  ///< events_ are to be returned
  Microseconds triggers_until_ = std::numeric_limits<Microseconds>::min();  ///< time of the last
  bool opened_ = false;  ///< opened, not collected
};

}  // namespace

std::unique_ptr<RecordingDecoder> make_hdf5_decoder() {
  return std::make_unique<Hdf5Items>();
}

}  // namespace eventcamera
