// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/numpy/npz.hpp"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <deque>
#include <string>
#include <string_view>
#include <utility>

#include "src/formats/numpy/npy_header.hpp"
#include "src/formats/numpy/zip_archive.hpp"
#include "src/formats/temporary_file.hpp"

namespace eventcamera {

namespace {

/// Bytes of a column that finish() appends at once.
constexpr std::uint64_t piece_size = std::uint64_t{1} << 18;

std::uint32_t checksum_of(const void* bytes, std::size_t size, std::uint32_t before = 0) {
  return static_cast<std::uint32_t>(crc32_z(before, static_cast<const Bytef*>(bytes), size));
}

std::string preamble(std::string_view type, const std::string& shape) {
  return npy_preamble("{'descr': '" + std::string(type) + "', 'fortran_order': False, 'shape': (" +
                      shape + "), }");
}

/// Adds an array without dimensions.
void add_number(std::string_view name, std::int64_t number, ZipWriter& archive,
                std::vector<std::uint8_t>& out) {
  auto content = preamble("<i8", "");
  content.append(reinterpret_cast<const char*>(&number), sizeof number);
  archive.begin_file(name, content.size(), checksum_of(content.data(), content.size()), out);
  out.insert(out.end(), content.begin(), content.end());
}

/// Numbers of an array, until its place in the archive is known.
class Column {
 public:
  Column(std::string_view name, std::string_view type) : name_(name), type_(type) {}

  void append(std::span<const std::uint8_t> bytes) {
    checksum_ = checksum_of(bytes.data(), bytes.size(), checksum_);
    bytes_.append(bytes);
  }

  /// Adds the array of `count` numbers to the archive, without its content.
  void begin(std::uint64_t count, ZipWriter& archive, std::vector<std::uint8_t>& out) const {
    const auto start = preamble(type_, std::to_string(count) + ',');
    const auto of_start = checksum_of(start.data(), start.size());
    const auto of_all = crc32_combine(of_start, checksum_, static_cast<z_off_t>(bytes_.size()));
    archive.begin_file(name_, start.size() + bytes_.size(), static_cast<std::uint32_t>(of_all),
                       out);
    out.insert(out.end(), start.begin(), start.end());
  }

  /// Appends the next piece of the content. False after the last.
  bool read(std::vector<std::uint8_t>& out) {
    const auto at = out.size();
    out.resize(at + std::min(piece_size, bytes_.size() - read_));
    const auto piece = std::span(out).subspan(at);
    bytes_.read(read_, piece);
    read_ += piece.size();
    return read_ < bytes_.size();
  }

 private:
  std::string_view name_;
  std::string_view type_;
  TemporaryFile bytes_;
  std::uint32_t checksum_ = 0;
  std::uint64_t read_ = 0;  ///< position in the file
};

class NpzEncoder final : public Encoder {
 public:
  /// `header` begins the archive.
  NpzEncoder(std::string header, ZipWriter archive)
      : Encoder(std::move(header)), archive_(std::move(archive)) {
    columns_.emplace_back("t.npy", "<i8");
    columns_.emplace_back("x.npy", "<u2");
    columns_.emplace_back("y.npy", "<u2");
    columns_.emplace_back("p.npy", "|u1");
  }

  std::uint64_t pending() const override { return ended_ ? 0 : count_; }

  std::size_t label(std::span<const Label> labels) override {
    if (labels.empty()) return 0;
    if (columns_.size() == event_columns) {
      columns_.emplace_back("cause.npy", "|u1");
      columns_.emplace_back("class.npy", "<u2");
    }
    complete_labels();
    add_labels(labels);
    return labels.size();
  }

 private:
  static constexpr std::size_t event_columns = 4;

  void append(std::span<const AbsoluteEvent> events, std::vector<std::uint8_t>& /*out*/) override {
    if (events.empty()) return;
    count_ += events.size();
    add(columns_[0], events, [](const AbsoluteEvent& event) { return event.t; });
    add(columns_[1], events, [](const AbsoluteEvent& event) { return event.x; });
    add(columns_[2], events,
        [](const AbsoluteEvent& event) { return static_cast<std::uint16_t>(event.y()); });
    add(columns_[3], events, [](const AbsoluteEvent& event) { return event.polarity(); });
  }

  /// Appends a number of each item.
  template <class Item, class NumberOf>
  void add(Column& column, std::span<const Item> items, const NumberOf& number_of) {
    constexpr auto size = sizeof number_of(items.front());
    numbers_.resize(items.size() * size);
    auto* at = numbers_.data();
    for (const auto& item : items) {
      const auto number = number_of(item);
      std::memcpy(at, &number, size);
      at += size;
    }
    column.append(numbers_);
  }

  void add_labels(std::span<const Label> labels) {
    add(columns_[4], labels, [](const Label& label) { return label.cause; });
    add(columns_[5], labels, [](const Label& label) { return label.object_class; });
    labels_ += labels.size();
  }

  /// Adds empty labels for the events without.
  void complete_labels() {
    constexpr std::array<Label, 4096> empty = {};
    while (columns_.size() > event_columns && labels_ < count_)
      add_labels(std::span(empty).first(std::min<std::uint64_t>(empty.size(), count_ - labels_)));
  }

  bool append_end(std::vector<std::uint8_t>& out) override {
    complete_labels();
    if (next_ == columns_.size()) {
      archive_.finish(out);
      ended_ = true;
      return false;
    }
    auto& column = columns_[next_];
    if (!begun_) column.begin(count_, archive_, out);
    begun_ = column.read(out);
    if (!begun_) ++next_;
    return true;
  }

  ZipWriter archive_;
  std::uint64_t count_ = 0;
  std::uint64_t labels_ = 0;
  std::deque<Column> columns_;
  std::size_t next_ = 0;  ///< column to write
  bool begun_ = false;    ///< a part of it is written
  bool ended_ = false;
  std::vector<std::uint8_t> numbers_;  ///< of one column, kept for its memory
};

}  // namespace

std::unique_ptr<Encoder> make_npz_encoder(SensorSize size) {
  ZipWriter archive;
  std::vector<std::uint8_t> header;
  add_number("width.npy", size.width, archive, header);
  add_number("height.npy", size.height, archive, header);
  return std::make_unique<NpzEncoder>(std::string(header.begin(), header.end()),
                                      std::move(archive));
}

}  // namespace eventcamera
