// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/wire/datagram_packer.hpp"

#include "src/wire/datagram_layouts.hpp"

namespace eventcamera {
namespace {

template <class Layout>
class PackerOf final : public DatagramPacker {
 public:
  explicit PackerOf(const Layout& layout) : layout_(layout) {}

  void pack(std::span<const AbsoluteEvent> events, const Send& send) override {
    for (const auto& event : events) {
      if (count_ > 0 && !is_next(event)) flush(send);
      if (count_ == 0) {
        first_ = event.t;
        layout_.begin(event.t, bytes_);
      }
      layout_.write(event, bytes_);
      last_ = event.t;
      ++count_;
      if (bytes_.size() + Layout::min_event_size > Layout::max_size) flush(send);
    }
  }

  void flush(const Send& send) override {
    if (count_ == 0) return;
    send({bytes_.bytes(), count_, first_, last_});
    drop();
  }

  void drop() noexcept override {
    bytes_.clear();
    count_ = 0;
  }

  std::optional<Microseconds> waiting_since() const override {
    if (count_ == 0) return std::nullopt;
    return first_;
  }

 private:
  /// True if the event may join the incomplete datagram.
  bool is_next(const AbsoluteEvent& event) const {
    return event.t >= last_ && event.t - first_ <= max_span_ &&
           bytes_.size() + layout_.size_of(event) <= Layout::max_size;
  }

  Layout layout_;
  datagram_layouts::Writer bytes_;
  std::size_t count_ = 0;
  Microseconds first_ = 0;
  Microseconds last_ = 0;
};

}  // namespace

std::unique_ptr<DatagramPacker> make_datagram_packer(const DatagramSettings& settings) {
  return datagram_layouts::with_layout(
      settings, []<class Layout>(const Layout& layout) -> std::unique_ptr<DatagramPacker> {
        return std::make_unique<PackerOf<Layout>>(layout);
      });
}

}  // namespace eventcamera
