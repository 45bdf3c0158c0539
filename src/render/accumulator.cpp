// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/render/accumulator.hpp"

#define HWY_TARGET_INCLUDE "src/render/accumulator.cpp"
#include <hwy/foreach_target.h>
// Must come after foreach_target.h.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using Bytes = hn::ScalableTag<std::uint8_t>;
using Vector = hn::Vec<Bytes>;

/// Draws pixels of this many bytes.
template <int bytes>
class RowPainter {
 public:
  explicit RowPainter(const KindTables& kinds) : kinds_(kinds) {
    store(hn::Zero(Bytes()), silent_);
  }

  /// Draws a row and clears it.
  void draw(std::uint8_t* fired, int width, std::uint8_t* out) const {
    const int lanes = static_cast<int>(hn::Lanes(Bytes()));
    if (HWY_TARGET == HWY_SCALAR || width < lanes) {  // table lookups need a full vector
      draw_pixels(fired, width, out);
      return;
    }
    // The last vector overlaps the one before if the width is not a multiple of the vector length.
    const int end = width - lanes;
    const auto last = hn::LoadU(Bytes(), fired + end);
    for (int x = 0; x < end; x += lanes)
      draw_vector(hn::LoadU(Bytes(), fired + x), fired + x, out + std::ptrdiff_t{x} * bytes);
    draw_vector(last, fired + end, out + std::ptrdiff_t{end} * bytes);
  }

 private:
  void draw_vector(Vector which, std::uint8_t* fired, std::uint8_t* out) const {
    const Bytes pixels;
    const auto zero = hn::Zero(pixels);
    if (hn::AllTrue(pixels, which == zero)) {
      const auto lanes = hn::Lanes(pixels);
      for (std::size_t i = 0; i < bytes; ++i)
        hn::StoreU(hn::Load(pixels, silent_ + i * lanes), pixels, out + i * lanes);
      return;
    }
    store(which, out);
    hn::StoreU(zero, pixels, fired);
  }

  void store(Vector which, std::uint8_t* out) const {
    const Bytes pixels;
    const auto byte = [&](std::size_t i) {
      return hn::TableLookupBytes(hn::LoadDup128(pixels, kinds_[i].data()), which);
    };
    if constexpr (bytes == 1)
      hn::StoreU(byte(0), pixels, out);
    else if constexpr (bytes == 3)
      hn::StoreInterleaved3(byte(0), byte(1), byte(2), pixels, out);
    else
      hn::StoreInterleaved4(byte(0), byte(1), byte(2), byte(3), pixels, out);
  }

  void draw_pixels(std::uint8_t* fired, int width, std::uint8_t* out) const {
    for (int x = 0; x < width; ++x) {
      for (std::size_t i = 0; i < bytes; ++i) *out++ = kinds_[i][fired[x]];
      fired[x] = 0;
    }
  }

  const KindTables& kinds_;
  HWY_ALIGN std::uint8_t
      silent_[bytes * hn::MaxLanes(Bytes())];  ///< a vector of pixels without events
};

template <int bytes>
void draw_rows(Image<std::uint8_t>& fired, const BandRows& rows, const KindTables& kinds,
               std::uint8_t* out, std::ptrdiff_t stride) {
  const RowPainter<bytes> painter(kinds);
  for (int y = rows.first; y < rows.last; ++y)
    painter.draw(fired.row(y), fired.width(), out + y * stride);
}

void draw_band(Image<std::uint8_t>& fired, int band, const KindTables& kinds, int bytes,
               std::uint8_t* out, std::ptrdiff_t stride) {
  const BandRows rows(band, fired.height());
  if (bytes == 1)
    draw_rows<1>(fired, rows, kinds, out, stride);
  else if (bytes == 3)
    draw_rows<3>(fired, rows, kinds, out, stride);
  else
    draw_rows<4>(fired, rows, kinds, out, stride);
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(draw_band);

void Accumulator::add(std::span<const Event> events) {
  // In locals, because the bytes written might alias members.
  std::uint8_t* const fired = fired_.row(0);
  const auto stride = static_cast<std::size_t>(fired_.stride());
  for (const auto event : events)
    fired[static_cast<std::size_t>(event.y()) * stride + event.x] |=
        static_cast<std::uint8_t>(1 + static_cast<int>(event.polarity()));
}

void Accumulator::add(const EventBuckets& events, ThreadPool& threads) {
  // By bands, whose rows stay in the cache from step to step.
  threads.for_each(events.bands(), [&](int band, int) {
    events.visit_band(band, [this](std::span<const Event> part) { add(part); });
  });
}

void Accumulator::draw(const Palette& palette, const PixelLayout& layout, std::byte* out,
                       std::ptrdiff_t stride, ThreadPool& threads) {
  const auto pixels = pixels_by_kind(palette, layout);
  KindTables kinds{};
  for (std::size_t kind = 0; kind < pixels.size(); ++kind)
    for (std::size_t i = 0; i < kinds.size(); ++i) kinds[i][kind] = pixels[kind][i];
  threads.for_each(band_count(fired_.height()), [&](int band, int) {
    HWY_DYNAMIC_DISPATCH(draw_band)
    (fired_, band, kinds, layout.bytes, reinterpret_cast<std::uint8_t*>(out), stride);
  });
}

}  // namespace eventcamera
#endif  // HWY_ONCE
