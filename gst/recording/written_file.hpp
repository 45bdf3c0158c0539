// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "gst/base/owned.hpp"
#include "gst/eventcamera/eventcamera.h"
#include "gst/recording/writable_events.hpp"
#include "src/core/event.hpp"
#include "src/formats/encoder.hpp"
#include "src/formats/waiting_items.hpp"

/// A file that an element writes: encodes events and triggers, and pushes the bytes. All functions
/// but the accessors may throw.
class WrittenFile {
 public:
  /// Begins a file of a sensor, with these output caps, to which the header is added.
  WrittenFile(WritableEvents& writable, GstPad* src, const GstEventCameraInfo& info,
              std::unique_ptr<eventcamera::Encoder> encoder, OwnedCaps caps);

  const GstEventCameraInfo& info() const { return info_; }
  GstCaps* caps() const { return caps_.get(); }
  /// True once bytes were pushed.
  bool has_begun() const { return has_begun_; }

  /// Writes a buffer of events, in buffers of at most `mtu` bytes.
  GstFlowReturn write(GstBuffer* buffer, guint mtu);

  /// Queues triggers for the events of their interval. Writes them if too many are queued, since
  /// the stream then has no events.
  GstFlowReturn write(std::span<const eventcamera::Trigger> triggers, guint mtu);

  /// Completes the file.
  GstFlowReturn end(guint mtu);

  /// Warns of events that are lost because the stream was stopped before its end.
  void warn_of_pending() const;

 private:
  GstFlowReturn push_header(GstClockTime pts);
  GstFlowReturn push_bytes(GstClockTime pts, GstClockTime duration);
  GstFlowReturn push_patch(eventcamera::FilePatch patch);
  GstFlowReturn encode(std::span<const eventcamera::AbsoluteEvent> events, GstClockTime& start);
  GstFlowReturn encode_all(std::span<const eventcamera::AbsoluteEvent> events, GstClockTime& start);
  void encode(std::span<const eventcamera::Trigger> triggers);
  void encode_triggers();
  void warn_of_pauses(bool at_end);
  GstElement* element() const { return GST_PAD_PARENT(src_); }

  WritableEvents& writable_;
  GstPad* src_;
  GstEventCameraInfo info_;
  OwnedCaps caps_;      ///< output caps
  OwnedBuffer header_;  ///< pending header; null once pushed, or if the format has none
  std::unique_ptr<eventcamera::Encoder> encoder_;
  std::vector<guint8> bytes_;  ///< encoded but not yet pushed
  guint mtu_ = G_MAXUINT;
  bool has_begun_ = false;
  eventcamera::WaitingItems<eventcamera::Trigger> triggers_;
  eventcamera::Microseconds last_ = 0;  ///< time of the last encoded item
  std::uint64_t pauses_reported_ = 0;   ///< removed microseconds that a warning reported
};
