// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/hdf5/hdf5_reader.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "src/formats/hdf5/hdf5_file.hpp"
#include "src/formats/hdf5/hdf5_table.hpp"
#include "src/formats/hdf5/hdf5_triggers.hpp"
#include "src/formats/unsupported_format.hpp"

namespace eventcamera {

struct Hdf5Reader::File {
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

Hdf5Reader::Hdf5Reader(std::unique_ptr<ByteSource> bytes, const Hdf5Selection& selection)
    : Hdf5Reader(
          [&] {
            File file;
            file.handle = open_source(*bytes);
            file.bytes = std::move(bytes);
            return file;
          }(),
          selection) {}

Hdf5Reader::Hdf5Reader(ByteSource& bytes, const Hdf5Selection& selection)
    : Hdf5Reader(
          [&] {
            File file;
            file.handle = open_source(bytes);
            return file;
          }(),
          selection) {}

Hdf5Reader::Hdf5Reader(File file, const Hdf5Selection& selection)
    : file_(std::make_unique<File>(std::move(file))) {
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
