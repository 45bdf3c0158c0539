// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <limits>
#include <optional>
#include <vector>

#include "src/formats/hdf5/hdf5_layout.hpp"

namespace eventcamera {

namespace {

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

}  // namespace

std::unique_ptr<Hdf5Layout> make_dsec_layout(hid_t file, SensorSize size,
                                             Hdf5Compression compression) {
  return std::make_unique<DsecLayout>(file, size, compression);
}

}  // namespace eventcamera
