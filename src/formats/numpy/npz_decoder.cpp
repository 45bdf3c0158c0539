// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/numpy/npz.hpp"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "src/core/sensor_size.hpp"
#include "src/formats/byte_source.hpp"
#include "src/formats/numpy/npy_decoder.hpp"
#include "src/formats/numpy/zip_archive.hpp"

namespace eventcamera {

namespace {

/// Bytes of elements read at once, at least one element.
constexpr std::size_t block_size = std::size_t{1} << 16;

/// Array of the archive, with its file positioned after the header.
struct ArrayFile {
  ZipEntry entry;
  NpyHeader header;
  std::vector<std::uint8_t> rest;  ///< bytes read but not consumed
};

/// Reads the header of an array. Throws UnsupportedFormat.
ArrayFile open_array(ZipArchive& archive, std::size_t index) {
  auto entry = archive.open(index);
  NpyPreamble preamble;
  std::array<std::uint8_t, 128> block;  // typical size of NumPy headers of plain numbers
  while (true) {
    const auto count = entry.read(block);
    std::span<const std::uint8_t> bytes = std::span(block).first(count.value_or(0));
    if (bytes.empty())
      throw UnsupportedFormat(archive.names()[index] + " in the NumPy archive has no header");
    if (auto header = preamble.read(bytes))
      return {std::move(entry), *std::move(header), {bytes.begin(), bytes.end()}};
  }
}

/// Joins arrays to elements of t, x, y and p, or of these and labels.
class JoinedColumns {
 public:
  /// Adds an array with these columns, or a whole array of events without any.
  void add(ArrayFile array, std::span<const EventColumn> columns) {
    for (std::size_t i = 0; i < columns.size(); ++i) {
      auto& field = header_.fields[static_cast<std::size_t>(columns[i])] = array.header.columns[i];
      field.offset += header_.element_bytes;
    }
    header_.element_bytes += array.header.element_bytes;
    // Too many if another array is shorter, which NpyDecoder reports.
    header_.count = std::max(header_.count, array.header.count);
    arrays_.push_back(std::move(array));
  }

  NpyHeader header(std::optional<TimeUnit> unit) const {
    auto header = header_;
    header.unit = unit;
    return header;
  }

  /// Returns the next bytes, valid until the next call; empty at the end. Nothing if the archive is
  /// corrupt.
  std::optional<std::span<const std::uint8_t>> next() {
    const auto rows_at_once = std::max<std::size_t>(1, block_size / header_.element_bytes);
    auto rows = rows_at_once;
    for (auto& [entry, header, rest] : arrays_) {
      const auto had = rest.size();
      const auto wanted = rows_at_once * header.element_bytes;
      if (had < wanted) {
        rest.resize(wanted);
        const auto count = entry.read(std::span(rest).subspan(had));
        if (!count) return std::nullopt;
        rest.resize(had + *count);
      }
      rows = std::min(rows, rest.size() / header.element_bytes);
    }
    if (arrays_.size() == 1) return joined_ = std::exchange(arrays_.front().rest, {});
    joined_.resize(rows * header_.element_bytes);
    std::size_t offset = 0;
    for (auto& [entry, header, rest] : arrays_) {
      const std::size_t size = header.element_bytes;
      for (std::size_t row = 0; row < rows; ++row)
        std::copy_n(rest.data() + row * size, size,
                    joined_.data() + row * header_.element_bytes + offset);
      rest.erase(rest.begin(), rest.begin() + static_cast<std::ptrdiff_t>(rows * size));
      offset += size;
    }
    return joined_;
  }

 private:
  std::vector<ArrayFile> arrays_;
  NpyHeader header_;  ///< header of the joined elements
  std::vector<std::uint8_t> joined_;
};

/// Name of an array in the archive without folder and extension; empty if it is not an array.
std::string_view array_name(std::string_view name) {
  constexpr std::string_view ending = ".npy";
  if (!name.ends_with(ending)) return {};
  name.remove_suffix(ending.size());
  return name.substr(name.rfind('/') + 1);
}

/// Integer from 1 to `max` that is the only element of an array; 0 if the array is another.
int extent_in(ZipArchive& archive, std::size_t index) {
  try {
    auto [entry, header, bytes] = open_array(archive, index);
    if (header.columns.size() != 1 || header.count != 1) return 0;
    const auto had = bytes.size();
    // Reads past the number, because the checksum is verified at the end.
    bytes.resize(had + sizeof(std::uint64_t) + 1);
    const auto count = entry.read(std::span(bytes).subspan(had));
    if (!count || had + *count != header.element_bytes) return 0;
    const auto extent = npy_integer(header.columns.front(), bytes.data()).value_or(0);
    return is_side(extent) ? static_cast<int>(extent) : 0;
  } catch (const UnsupportedFormat&) {
    return 0;
  }
}

/// The events of an archive.
class NpzDecoder final : public Decoder {
 public:
  explicit NpzDecoder(const TableSettings& settings) : settings_(settings) {}

  void push(std::span<const std::uint8_t> piece) override { collected_.push(piece); }

  void drain() override {
    bytes_ = collected_.finish();
    open(*bytes_);
  }

  /// Throws UnsupportedFormat.
  bool open(ByteSource& source) override {
    archive_.emplace(source);
    if (settings_.size == SensorSize{}) settings_.size = stated_size();
    if (!open_columns()) open_first_array();
    streams_.front().size = decoder_->size();
    return true;
  }

  std::optional<Item> next() override {
    while (decoder_ && !ended_) {
      decoded_.events.clear();
      read();
      streams_.front().labelled = decoder_->streams().front().labelled;
      if (!decoded_.events.empty()) return EventItem{0, decoded_.events};
    }
    return std::nullopt;
  }

  const std::vector<StreamInfo>& streams() const override { return streams_; }
  const Corruption& corruption() const override { return corruption_; }
  bool is_table() const override { return true; }

  /// Arrays can only be decompressed from their start.
  std::optional<SeekPoint> seek_point_before(Microseconds /*t*/) const override {
    return std::nullopt;
  }
  void restart(const SeekPoint& /*seek_point*/) override {}

 private:
  /// Reads the next events.
  void read() {
    const auto bytes = joined_.next();
    ended_ = !bytes || bytes->empty();
    try {
      if (ended_)
        decoder_->finish(decoded_);
      else
        decoder_->decode(*bytes, decoded_);
    } catch (const UnsupportedFormat& error) {
      throw UnsupportedFormat(error_prefix_ + error.what());
    }
    corruption_ = decoder_->corruption();
    if (size_unreadable_) corruption_.note(0, "the arrays width and height are not a sensor size");
    if (!bytes) corruption_.note(0, "the ZIP archive cannot be unpacked further");
  }

  /// Size in the arrays width and height; 0x0 if it is missing or not one of a sensor.
  SensorSize stated_size() {
    const auto width = index_of("width");
    const auto height = index_of("height");
    if (!width || !height) return {};
    const SensorSize size{extent_in(*archive_, *width), extent_in(*archive_, *height)};
    size_unreadable_ = size.width == 0 || size.height == 0;
    return size_unreadable_ ? SensorSize{} : size;
  }

  std::optional<std::size_t> index_of(std::string_view array) const {
    const auto& names = archive_->names();
    const auto found = std::ranges::find(names, array, array_name);
    if (found == names.end()) return std::nullopt;
    return static_cast<std::size_t>(found - names.begin());
  }

  /// Opens arrays t, x, y and p, or t, xy (of two columns) and p. False unless all of them exist.
  bool open_columns() {
    std::array<std::optional<std::size_t>, all_columns> indices;
    std::optional<TimeUnit> unit;
    for (std::size_t i = 0; i < archive_->names().size(); ++i) {
      const auto name = column_named(array_name(archive_->names()[i]));
      if (!name) continue;
      auto& index = indices[static_cast<std::size_t>(name->column)];
      if (index) continue;
      index = i;
      if (name->column == EventColumn::t) unit = name->unit;
    }
    struct Part {
      std::optional<std::size_t> index;
      std::vector<EventColumn> columns;
    };
    std::vector<Part> parts;
    for (const auto column : {EventColumn::t, EventColumn::x, EventColumn::y, EventColumn::p})
      parts.push_back({indices[static_cast<std::size_t>(column)], {column}});
    if (!parts[1].index && !parts[2].index) {
      const auto& names = archive_->names();
      const auto xy = std::ranges::find_if(names, [](const std::string& name) {
        const auto array = array_name(name);
        return array == "xy" || array.ends_with("_xy");
      });
      if (xy == names.end()) return false;
      parts[1] = {static_cast<std::size_t>(xy - names.begin()), {EventColumn::x, EventColumn::y}};
      parts.erase(parts.begin() + 2);
    }
    for (const auto& [index, columns] : parts)
      if (!index) return false;
    for (const auto& [index, columns] : parts) {
      auto array = open_array(*archive_, *index);
      if (array.header.columns.size() != columns.size() || array.header.by_columns)
        throw UnsupportedFormat(archive_->names()[*index] +
                                " in the NumPy archive must have one column" +
                                (columns.size() > 1 ? " for x and one for y" : ""));
      joined_.add(std::move(array), columns);
    }
    add_labels(std::span(indices).subspan(event_columns));
    decoder_ = make_npy_decoder(joined_.header(unit), settings_);
    return true;
  }

  /// Opens the arrays cause and class, if both are there and have a number for each event.
  void add_labels(std::span<const std::optional<std::size_t>> indices) {
    std::vector<ArrayFile> labels;
    for (const auto& index : indices) {
      if (!index) return;
      try {
        labels.push_back(open_array(*archive_, *index));
      } catch (const UnsupportedFormat&) {
        return;
      }
      const auto& header = labels.back().header;
      if (header.columns.size() != 1 || header.count < joined_.header({}).count) return;
    }
    constexpr EventColumn columns[] = {EventColumn::cause, EventColumn::object_class};
    for (std::size_t i = 0; i < labels.size(); ++i)
      joined_.add(std::move(labels[i]), std::span(columns).subspan(i, 1));
  }

  /// Opens the first array that may be one of events.
  void open_first_array() {
    std::string cause;
    for (std::size_t i = 0; i < archive_->names().size(); ++i) {
      if (array_name(archive_->names()[i]).empty()) continue;
      try {
        auto array = open_array(*archive_, i);
        if (array.header.columns.size() == 1) continue;
        decoder_ = make_npy_decoder(array.header, settings_);
        joined_.add(std::move(array), {});
        error_prefix_ = archive_->names()[i] + ": ";
        return;
      } catch (const UnsupportedFormat& error) {
        cause = std::string("; of ") + archive_->names()[i] + ": " + error.what();
      }
    }
    throw UnsupportedFormat("the NumPy archive has neither arrays t, x, y and p nor one of events" +
                            cause);
  }

  TableSettings settings_;
  CollectedBytes collected_{"a NumPy archive"};
  std::unique_ptr<ByteSource> bytes_;  ///< collected bytes
  std::optional<ZipArchive> archive_;  ///< set once it can be read
  JoinedColumns joined_;
  std::unique_ptr<EventDecoder> decoder_;
  std::string error_prefix_;  ///< name of the array of events
  Corruption corruption_;
  bool size_unreadable_ = false;
  bool ended_ = false;
  std::vector<StreamInfo> streams_{{.id = 0, .kind = StreamKind::events, .size = {}, .source = {}}};
  Decoded decoded_;
};

}  // namespace

std::unique_ptr<Decoder> make_npz_decoder(const TableSettings& settings) {
  return std::make_unique<NpzDecoder>(settings);
}

}  // namespace eventcamera
