// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/hdf5/hdf5_writer.hpp"

#include <algorithm>
#include <cstddef>
#include <initializer_list>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "src/core/sensor_size.hpp"
#include "src/formats/hdf5/ecf.hpp"
#include "src/formats/hdf5/hdf5_file.hpp"
#include "src/formats/hdf5/hdf5_handle.hpp"

namespace eventcamera {

struct Hdf5Writer::File {
  explicit File(const std::filesystem::path& path) : output(path) {}

  Hdf5Output output;
  Hdf5Handle handle;
};

/// Writes the datasets of one layout.
class Hdf5Layout {
 public:
  virtual ~Hdf5Layout() = default;
  virtual void append(std::span<const AbsoluteEvent> events) = 0;
  virtual bool append(std::span<const Trigger> triggers) = 0;
  virtual std::size_t label(std::span<const Label> /*labels*/) { return 0; }

  /// Passes rows to the library. Partial chunks are slow: the library compresses and writes them
  /// again when rows are added.
  virtual void flush(bool with_partial_chunks) = 0;
  virtual void close() = 0;
};

namespace {

/// A commit starts after a tenth more events, or this many. A crash or a full disk loses at most
/// the events of two commits, since the last one may be incomplete.
constexpr std::size_t new_share = 10;
constexpr std::size_t max_uncommitted = std::size_t{1} << 20;

void check(const Hdf5Writer::Settings& settings) {
  const auto [width, height] = settings.size;
  const bool ecf = settings.format == Hdf5Format::metavision;
  const int limit = ecf ? ecf_max_pixels : max_side;
  if (width <= 0 || height <= 0 || width > limit || height > limit)
    throw std::invalid_argument("HDF5 files need a sensor size of at most " +
                                std::to_string(limit) + " pixels in a row or column");
}

/// Throws std::runtime_error if a call of the library failed.
void require(bool succeeded) {
  if (!succeeded) throw std::runtime_error("the HDF5 library failed to write the file");
}

Hdf5Handle make_group(hid_t file, const char* name) {
  Hdf5Handle group(H5Gcreate2(file, name, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose);
  require(static_cast<bool>(group));
  return group;
}

/// Creates the properties of a dataset, without modification times.
Hdf5Handle make_creation() {
  Hdf5Handle creation(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  require(H5Pset_obj_track_times(creation.get(), false) >= 0);
  return creation;
}

/// Dataset to which rows are appended.
class GrowingDataset {
 public:
  GrowingDataset(hid_t parent, const char* name, hid_t stored, hid_t memory, hsize_t chunk,
                 Hdf5Compression compression, int filter = 0)
      : memory_(memory) {
    constexpr hsize_t none = 0;
    constexpr hsize_t no_limit = H5S_UNLIMITED;
    constexpr unsigned level = 1;  // the fastest; others hardly make events smaller
    const Hdf5Handle space(H5Screate_simple(1, &none, &no_limit), H5Sclose);
    const auto creation = make_creation();
    require(H5Pset_chunk(creation.get(), 1, &chunk) >= 0);
    if (compression == Hdf5Compression::gzip)
      require(H5Pset_shuffle(creation.get()) >= 0 && H5Pset_deflate(creation.get(), level) >= 0);
    if (filter != 0)
      require(H5Pset_filter(creation.get(), filter, H5Z_FLAG_OPTIONAL, 0, nullptr) >= 0);
    dataset_ = {
        H5Dcreate2(parent, name, stored, space.get(), H5P_DEFAULT, creation.get(), H5P_DEFAULT),
        H5Dclose};
    require(static_cast<bool>(dataset_));
  }

  void append(const void* rows, hsize_t count) {
    if (count == 0) return;
    const auto begin = rows_;
    extend(count);
    const auto space = select(begin, count);
    const Hdf5Handle memory(H5Screate_simple(1, &count, nullptr), H5Sclose);
    require(H5Dwrite(dataset_.get(), memory_, memory.get(), space.get(), H5P_DEFAULT, rows) >= 0);
  }

  /// Writes a filtered chunk of `count` rows, the last ones of the dataset, from `begin` on.
  void write_chunk(std::span<const std::uint8_t> chunk, hsize_t begin, hsize_t count) {
    extend(begin + count - rows_);
    require(H5Dwrite_chunk(dataset_.get(), H5P_DEFAULT, 0, &begin, chunk.size(), chunk.data()) >=
            0);
  }

  void read(hsize_t first, hsize_t count, void* rows) const {
    const auto space = select(first, count);
    const Hdf5Handle memory(H5Screate_simple(1, &count, nullptr), H5Sclose);
    require(H5Dread(dataset_.get(), memory_, memory.get(), space.get(), H5P_DEFAULT, rows) >= 0);
  }

  hid_t id() const { return dataset_.get(); }
  hsize_t rows() const { return rows_; }

 private:
  void extend(hsize_t count) {
    rows_ += count;
    require(H5Dset_extent(dataset_.get(), &rows_) >= 0);
  }

  Hdf5Handle select(hsize_t first, hsize_t count) const {
    Hdf5Handle space(H5Dget_space(dataset_.get()), H5Sclose);
    require(H5Sselect_hyperslab(space.get(), H5S_SELECT_SET, &first, nullptr, &count, nullptr) >=
            0);
    return space;
  }

  Hdf5Handle dataset_;
  hid_t memory_;
  hsize_t rows_ = 0;
};

/// Buffers rows until a chunk is full, or they are flushed.
template <class Row>
class BufferedDataset : public GrowingDataset {
 public:
  BufferedDataset(hid_t parent, const char* name, hid_t stored, hid_t memory, hsize_t chunk,
                  Hdf5Compression compression)
      : GrowingDataset(parent, name, stored, memory, chunk, compression), chunk_(chunk) {}

  void put(const Row& row) {
    buffer_.push_back(row);
    if (count() % chunk_ == 0) flush();
  }

  void flush() {
    append(buffer_.data(), buffer_.size());
    buffer_.clear();
  }

  /// Includes the rows in the buffer.
  hsize_t count() const { return rows() + buffer_.size(); }

 private:
  hsize_t chunk_;
  std::vector<Row> buffer_;
};

/// Rows per chunk. The index has small chunks, because each commit writes the last one.
constexpr hsize_t hdf5_chunk = 16384;
constexpr hsize_t hdf5_index_chunk = 4096;

/// Returns the time since the first event of a recording. Throws std::invalid_argument after a
/// week, because the index of both layouts grows with time, even without events.
Microseconds since(Microseconds first, Microseconds t) {
  constexpr Microseconds max_recording = 7LL * 24 * 3600 * 1'000'000;
  Microseconds passed = 0;
  if (__builtin_sub_overflow(t, first, &passed) || passed > max_recording)
    throw std::invalid_argument("an HDF5 recording cannot be longer than a week");
  return passed;
}

class DsecLayout final : public Hdf5Layout {
 public:
  DsecLayout(hid_t file, SensorSize size, Hdf5Compression compression)
      : file_(file),
        compression_(compression),
        group_(make_group(file, "events")),
        p_(group_.get(), "p", H5T_STD_U8LE, H5T_NATIVE_UINT8, hdf5_chunk, compression_),
        x_(group_.get(), "x", H5T_STD_U16LE, H5T_NATIVE_UINT16, hdf5_chunk, compression_),
        y_(group_.get(), "y", H5T_STD_U16LE, H5T_NATIVE_UINT16, hdf5_chunk, compression_),
        t_(group_.get(), "t", H5T_STD_U32LE, H5T_NATIVE_UINT64, hdf5_chunk, compression_),
        // Compressed, because a pause of a day takes 691 MB.
        index_(file, "ms_to_idx", H5T_STD_U64LE, H5T_NATIVE_UINT64, hdf5_index_chunk,
               Hdf5Compression::gzip) {
    write_number(file, "width", size.width);
    write_number(file, "height", size.height);
  }

  void append(std::span<const AbsoluteEvent> events) override {
    for (const auto& event : events) {
      if (!first_) first_ = event.t;
      const auto t = static_cast<std::uint64_t>(since(*first_, event.t));
      if (t > std::numeric_limits<std::uint32_t>::max() && !wide_) widen();
      for (; index_.count() * 1000 <= t;) index_.put(t_.count());
      p_.put(static_cast<std::uint8_t>(event.polarity()));
      x_.put(event.x);
      y_.put(static_cast<std::uint16_t>(event.y()));
      t_.put(t);
    }
  }

  bool append(std::span<const Trigger> /*triggers*/) override { return false; }

  std::size_t label(std::span<const Label> labels) override {
    if (labels.empty()) return 0;
    if (!labels_) labels_.emplace(group_.get(), compression_);
    labels_->complete(t_.count());
    for (const auto& label : labels) labels_->put(label);
    return labels.size();
  }

  void flush(bool with_partial_chunks) override {
    if (labels_) labels_->complete(t_.count());
    if (with_partial_chunks) {
      if (labels_) labels_->flush();
      p_.flush();
      x_.flush();
      y_.flush();
      t_.flush();
    }
    index_.flush();
    if (first_ && !has_offset_) write_offset(*first_);
  }

  void close() override {
    flush(true);
    if (!has_offset_) write_offset(0);
  }

 private:
  static void write_number(hid_t object, const char* name, int number) {
    const Hdf5Handle space(H5Screate(H5S_SCALAR), H5Sclose);
    const Hdf5Handle attribute(
        H5Acreate2(object, name, H5T_STD_I32LE, space.get(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    require(H5Awrite(attribute.get(), H5T_NATIVE_INT, &number) >= 0);
  }

  void write_offset(Microseconds first) {
    const Hdf5Handle space(H5Screate(H5S_SCALAR), H5Sclose);
    const auto creation = make_creation();
    const Hdf5Handle offset(H5Dcreate2(file_, "t_offset", H5T_STD_I64LE, space.get(), H5P_DEFAULT,
                                       creation.get(), H5P_DEFAULT),
                            H5Dclose);
    require(H5Dwrite(offset.get(), H5T_NATIVE_INT64, H5S_ALL, H5S_ALL, H5P_DEFAULT, &first) >= 0);
    has_offset_ = true;
  }

  /// Continues with times of 64 bits, which readers accept. DSEC has 32 bits, which last 71
  /// minutes.
  void widen() {
    t_.flush();
    wide_ = true;
    Times wide(group_.get(), "t64", H5T_STD_U64LE, H5T_NATIVE_UINT64, hdf5_chunk, compression_);
    std::vector<std::uint64_t> times(hdf5_chunk);
    while (wide.rows() < t_.rows()) {
      const auto count = std::min(hdf5_chunk, t_.rows() - wide.rows());
      t_.read(wide.rows(), count, times.data());
      wide.append(times.data(), count);
    }
    t_ = std::move(wide);
    require(H5Ldelete(group_.get(), "t", H5P_DEFAULT) >= 0 &&
            H5Lmove(group_.get(), "t64", group_.get(), "t", H5P_DEFAULT, H5P_DEFAULT) >= 0);
  }

  using Times = BufferedDataset<std::uint64_t>;

  struct Labels {
    Labels(hid_t group, Hdf5Compression compression)
        : cause(group, "cause", H5T_STD_U8LE, H5T_NATIVE_UINT8, hdf5_chunk, compression),
          object_class(group, "class", H5T_STD_U16LE, H5T_NATIVE_UINT16, hdf5_chunk, compression) {}

    void put(const Label& label) {
      cause.put(static_cast<std::uint8_t>(label.cause));
      object_class.put(label.object_class);
    }

    /// Adds empty labels for unlabelled events, up to this number of events.
    void complete(hsize_t events) {
      while (cause.count() < events) put({});
    }

    void flush() {
      cause.flush();
      object_class.flush();
    }

    BufferedDataset<std::uint8_t> cause;
    BufferedDataset<std::uint16_t> object_class;
  };

  hid_t file_;
  Hdf5Compression compression_;
  Hdf5Handle group_;
  BufferedDataset<std::uint8_t> p_;
  BufferedDataset<std::uint16_t> x_, y_;
  Times t_;                               ///< relative to the first event
  BufferedDataset<std::uint64_t> index_;  ///< first event at or after each millisecond
  std::optional<Labels> labels_;
  std::optional<Microseconds> first_;
  bool has_offset_ = false;
  bool wide_ = false;
};

struct Member {
  const char* name;
  std::size_t offset;
  hid_t type;
};

Hdf5Handle make_compound(std::size_t size, std::initializer_list<Member> members) {
  Hdf5Handle type(H5Tcreate(H5T_COMPOUND, size), H5Tclose);
  for (const auto& member : members) H5Tinsert(type.get(), member.name, member.offset, member.type);
  return type;
}

/// Index of the first event to read for each 2 ms since the first event. Compressed, because a
/// pause of a day takes 691 MB.
class MetavisionIndex {
 public:
  explicit MetavisionIndex(hid_t group)
      : type_(make_type()),
        out_(group, "indexes", type_.get(), type_.get(), hdf5_index_chunk, Hdf5Compression::gzip) {}

  void add(std::uint64_t id, Microseconds t) {
    if (!first_) {
      first_ = t;
      require(write_text_attribute(
          out_.id(), "offset",
          std::to_string(static_cast<Microseconds>(0 - static_cast<std::uint64_t>(t)))));
    }
    const auto passed = since(*first_, t);
    // The entry of a period is the first event of the last earlier period with events.
    for (const auto periods = passed / period; count_ <= periods; ++count_) {
      out_.put(last_);
      if (count_ == periods) last_ = {id, passed};
    }
  }

  void flush() { out_.flush(); }

  void close() {
    if (first_) out_.put(last_);
    out_.flush();
  }

 private:
  static constexpr Microseconds period = 2000;

  struct Entry {
    std::uint64_t id;
    std::int64_t t;
  };

  static Hdf5Handle make_type() {
    return make_compound(sizeof(Entry), {{"id", offsetof(Entry, id), H5T_NATIVE_UINT64},
                                         {"ts", offsetof(Entry, t), H5T_NATIVE_INT64}});
  }

  Hdf5Handle type_;
  BufferedDataset<Entry> out_;
  std::optional<Microseconds> first_;
  Microseconds count_ = 0;
  Entry last_ = {0, -1};
};

class MetavisionLayout final : public Hdf5Layout {
 public:
  MetavisionLayout(hid_t file, SensorSize size)
      : cd_(make_group(file, "CD")),
        trigger_(make_group(file, "EXT_TRIGGER")),
        event_type_(make_event_type()),
        trigger_type_(make_trigger_type()),
        events_out_(cd_.get(), "events", event_type_.get(), event_type_.get(), hdf5_chunk,
                    Hdf5Compression::none, ecf_filter),
        triggers_(trigger_.get(), "events", trigger_type_.get(), trigger_type_.get(), hdf5_chunk,
                  Hdf5Compression::none),
        event_index_(cd_.get()),
        trigger_index_(trigger_.get()) {
    const auto width = std::to_string(size.width);
    const auto height = std::to_string(size.height);
    const Hdf5Handle root(H5Gopen2(file, "/", H5P_DEFAULT), H5Gclose);
    require(
        write_text_attribute(root.get(), "version", "1.0") &&
        write_text_attribute(root.get(), "geometry", width + "x" + height) &&
        write_text_attribute(root.get(), "format", "EVT3;height=" + height + ";width=" + width));
  }

  void append(std::span<const AbsoluteEvent> events) override {
    for (const auto& event : events) {
      event_index_.add(complete_ + events_.size(), event.t);
      events_.push_back(event);
      if (events_.size() < hdf5_chunk) continue;
      write_chunk();
      complete_ += hdf5_chunk;
      events_.clear();
    }
  }

  bool append(std::span<const Trigger> triggers) override {
    for (const auto& trigger : triggers) {
      trigger_index_.add(triggers_.count(), trigger.t);
      TriggerRow row;
      row.p = trigger.rising ? 1 : 0;
      row.t = trigger.t;
      row.id = static_cast<std::int16_t>(trigger.id);
      triggers_.put(row);
    }
    return true;
  }

  void flush(bool with_partial_chunks) override {
    if (with_partial_chunks) write_chunk();
    triggers_.flush();
    event_index_.flush();
    trigger_index_.flush();
  }

  void close() override {
    flush(true);
    event_index_.close();
    trigger_index_.close();
  }

 private:
  /// Memory layout of Metavision events.
  struct EventRow {
    std::uint16_t x, y;
    std::int16_t p;
    std::int64_t t;
  };
  struct TriggerRow {
    std::int16_t p = 0;
    std::int64_t t = 0;
    std::int16_t id = 0;
  };
  static_assert(sizeof(EventRow) == 16 && sizeof(TriggerRow) == 24);

  static Hdf5Handle make_event_type() {
    return make_compound(sizeof(EventRow), {{"x", offsetof(EventRow, x), H5T_NATIVE_UINT16},
                                            {"y", offsetof(EventRow, y), H5T_NATIVE_UINT16},
                                            {"p", offsetof(EventRow, p), H5T_NATIVE_INT16},
                                            {"t", offsetof(EventRow, t), H5T_NATIVE_INT64}});
  }

  static Hdf5Handle make_trigger_type() {
    return make_compound(sizeof(TriggerRow), {{"p", offsetof(TriggerRow, p), H5T_NATIVE_INT16},
                                              {"t", offsetof(TriggerRow, t), H5T_NATIVE_INT64},
                                              {"id", offsetof(TriggerRow, id), H5T_NATIVE_INT16}});
  }

  void write_chunk() {
    if (events_.empty()) return;
    encoded_.clear();
    encode_ecf(events_, encoded_);
    events_out_.write_chunk(encoded_, complete_, events_.size());
  }

  Hdf5Handle cd_, trigger_;
  Hdf5Handle event_type_, trigger_type_;
  GrowingDataset events_out_;
  BufferedDataset<TriggerRow> triggers_;
  MetavisionIndex event_index_, trigger_index_;
  hsize_t complete_ = 0;               ///< events in complete chunks
  std::vector<AbsoluteEvent> events_;  ///< of the last chunk
  std::vector<std::uint8_t> encoded_;
};

}  // namespace

Hdf5Writer::Hdf5Writer(const std::filesystem::path& path, const Settings& settings)
    : size_(settings.size), commit_interval_(settings.commit_interval) {
  const Hdf5Session session;
  check(settings);
  file_ = std::make_unique<File>(path);
  file_->handle = file_->output.create();
  require(static_cast<bool>(file_->handle));
  if (settings.format == Hdf5Format::dsec)
    layout_ = std::make_unique<DsecLayout>(file_->handle.get(), size_, settings.compression);
  else
    layout_ = std::make_unique<MetavisionLayout>(file_->handle.get(), size_);
}

Hdf5Writer::~Hdf5Writer() {
  const Hdf5Session session;
  try {
    close();
  } catch (const std::exception&) {
    // A destructor cannot report errors.
  }
  layout_.reset();
  file_.reset();
}

void Hdf5Writer::append(std::span<const AbsoluteEvent> events) {
  const Hdf5Session session;
  file_->output.check();
  for (const auto& event : events) {
    if (event.t < latest_) throw std::invalid_argument("events are not sorted by time");
    latest_ = event.t;
    if (event.x >= size_.width || event.y() >= size_.height)
      throw std::invalid_argument("event outside the sensor");
  }
  layout_->append(events);
  file_->output.check();
  events_ += events.size();
  if (commit_interval_.count() == 0) return;
  const auto complete = events_ / hdf5_chunk * hdf5_chunk;
  const auto max_new =
      std::clamp<std::size_t>(committed_events_ / new_share, hdf5_chunk, max_uncommitted);
  const bool is_due = !committed_ || Clock::now() - *committed_ >= commit_interval_;
  if (is_due && !file_->output.is_committing())
    start_commit(true);
  else if (complete >= committed_events_ + max_new)
    start_commit(false);
}

std::size_t Hdf5Writer::label(std::span<const Label> labels) {
  const Hdf5Session session;
  file_->output.check();
  return layout_->label(labels);
}

bool Hdf5Writer::append(std::span<const Trigger> triggers) {
  const Hdf5Session session;
  file_->output.check();
  const bool written = layout_->append(triggers);
  file_->output.check();
  return written;
}

void Hdf5Writer::commit() {
  const Hdf5Session session;
  start_commit(true);
  file_->output.finish_commit();
  file_->output.check();
}

void Hdf5Writer::start_commit(bool with_partial_chunks) {
  layout_->flush(with_partial_chunks);
  require(H5Fflush(file_->handle.get(), H5F_SCOPE_GLOBAL) >= 0);
  file_->output.start_commit();
  file_->output.check();
  if (with_partial_chunks) committed_ = Clock::now();
  committed_events_ = with_partial_chunks ? events_ : events_ / hdf5_chunk * hdf5_chunk;
}

void Hdf5Writer::close() {
  if (!layout_) return;
  const Hdf5Session session;
  file_->output.check();
  auto layout = std::move(layout_);
  layout->close();
  layout.reset();
  file_->handle = {};
  file_->output.finish();
  file_->output.check();
}

}  // namespace eventcamera
