// SPDX-License-Identifier: LGPL-2.1-or-later
#include <cstddef>
#include <initializer_list>
#include <optional>
#include <string>
#include <vector>

#include "src/formats/hdf5/ecf.hpp"
#include "src/formats/hdf5/hdf5_layout.hpp"

namespace eventcamera {

namespace {

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

std::unique_ptr<Hdf5Layout> make_metavision_layout(hid_t file, SensorSize size) {
  return std::make_unique<MetavisionLayout>(file, size);
}

}  // namespace eventcamera
