// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/video/video.h>

#include <algorithm>
#include <span>
#include <utility>
#include <vector>

#include "src/formats/chunker.hpp"
#include "src/formats/evt/word_scanner.hpp"

/// Reads the transfers of a camera from its buffers: padded ones of a V4L2 driver, or loose bytes.
class CameraBuffers {
 public:
  struct Transfer {
    eventcamera::WordScanner::Transfer words;
    GstClockTime arrival;  ///< running time, if the buffer has a time
    guint64 lost;          ///< buffers that the driver dropped before this one
  };

  explicit CameraBuffers(eventcamera::Framing framing) : framing_(framing) {}

  /// Returns the transfer of a buffer of a segment, which holds `bytes`. Valid as long as these,
  /// and until the next call. May throw.
  Transfer transfer_of(GstBuffer* buffer, std::span<const guint8> bytes,
                       const GstSegment& segment) {
    const auto arrival = arrival_of(buffer, segment);
    const auto last = std::exchange(last_arrival_, arrival);
    const auto lost = lost_before(buffer, segment);
    Transfer transfer{.words = {.bytes = without_padding(buffer, bytes),
                                .is_discontinuous = GST_BUFFER_IS_DISCONT(buffer) || lost > 0,
                                .elapsed = {}},
                      .arrival = arrival,
                      .lost = lost};
    if (GST_CLOCK_TIME_IS_VALID(arrival) && GST_CLOCK_TIME_IS_VALID(last) && arrival >= last &&
        arrival - last <= max_gap)
      transfer.words.elapsed =
          static_cast<eventcamera::Microseconds>((arrival - last) / GST_USECOND);
    return transfer;
  }

 private:
  /// A camera that was silent for longer may have started over.
  static constexpr GstClockTime max_gap = GST_SECOND * 3600 * 24;

  static GstClockTime arrival_of(GstBuffer* buffer, const GstSegment& segment) {
    const auto pts = GST_BUFFER_PTS(buffer);
    // Sources of bytes stamp with running time.
    const auto arrival = segment.format == GST_FORMAT_TIME
                             ? gst_segment_to_running_time(&segment, GST_FORMAT_TIME, pts)
                             : pts;
    constexpr auto max = static_cast<GstClockTime>(eventcamera::Chunker::max_time) * GST_USECOND;
    return arrival <= max ? arrival : GST_CLOCK_TIME_NONE;
  }

  /// Offsets of camera buffers are numbers; offsets of file buffers are in bytes.
  guint64 lost_before(GstBuffer* buffer, const GstSegment& segment) {
    if (framing_ != eventcamera::Framing::padded || segment.format != GST_FORMAT_TIME) return 0;
    const auto offset = GST_BUFFER_OFFSET(buffer);
    const auto last = std::exchange(last_offset_, offset);
    if (offset == GST_BUFFER_OFFSET_NONE || last == GST_BUFFER_OFFSET_NONE || offset <= last)
      return 0;
    return offset - last - 1;
  }

  /// The bytes of a buffer, without the padding of its rows.
  std::span<const guint8> without_padding(GstBuffer* buffer, std::span<const guint8> bytes) {
    const GstVideoMeta* const meta = gst_buffer_get_video_meta(buffer);
    if (meta == nullptr || meta->n_planes != 1 || meta->stride[0] <= static_cast<gint>(meta->width))
      return bytes;
    const auto stride = static_cast<gsize>(meta->stride[0]);
    rows_.clear();
    gsize at = meta->offset[0];
    for (guint y = 0; y < meta->height && at < bytes.size(); ++y, at += stride) {
      const auto row = bytes.subspan(at, std::min<gsize>(meta->width, bytes.size() - at));
      rows_.insert(rows_.end(), row.begin(), row.end());
    }
    return rows_;
  }

  eventcamera::Framing framing_;
  std::vector<guint8> rows_;
  GstClockTime last_arrival_ = GST_CLOCK_TIME_NONE;
  guint64 last_offset_ = GST_BUFFER_OFFSET_NONE;
};
