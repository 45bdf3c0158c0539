// SPDX-License-Identifier: LGPL-2.1-or-later
/// Pull mode: the reader asks for the bytes of a file.
#include <utility>

#include "gst/recording/reader/event_reader.hpp"

#define GST_CAT_DEFAULT event_reader_debug

gboolean EventReader::activate(GstPadMode mode, bool active) {
  shared_.lock()->is_pulling = mode == GST_PAD_MODE_PULL && active;
  if (mode != GST_PAD_MODE_PULL) return TRUE;
  return active ? gst_pad_start_task(sink_, loop, this, nullptr) : gst_pad_stop_task(sink_);
}

void EventReader::loop(gpointer data) {
  auto& self = *static_cast<EventReader*>(data);
  const GstFlowReturn result = self.guard([&] { return self.pull(); });
  if (result == GST_FLOW_OK) return;
  GST_DEBUG_OBJECT(self.element_, "pausing: %s", gst_flow_get_name(result));
  gst_pad_pause_task(self.sink_);
  if (result == GST_FLOW_FLUSHING) return;
  auto* const element = self.element_;
  const bool is_unbegun = result == GST_FLOW_EOS && !self.has_no_more_pads_;
  if (result != GST_FLOW_EOS || is_unbegun) wait_until_added(element);
  if (is_unbegun)
    post_message(element, GST_MESSAGE_ERROR,
                 {GST_STREAM_ERROR_FAILED, "Stopped before the recording began."},
                 "EOS while its start was read");
  if (result == GST_FLOW_NOT_LINKED)
    post_message(element, GST_MESSAGE_ERROR, not_linked(), "streaming stopped, reason not-linked");
  else if (result != GST_FLOW_EOS && result != GST_FLOW_ERROR)
    GST_ELEMENT_FLOW_ERROR(element, result);
  self.end_output(result != GST_FLOW_EOS);
}

/// Pushes the next output. Returns GST_FLOW_EOS at the end of the file or of the segment.
GstFlowReturn EventReader::pull() {
  if (!recording_) {
    OwnedCaps caps(gst_pad_peer_query_caps(sink_, nullptr));
    if (gst_caps_is_fixed(caps.get())) caps_ = std::move(caps);
    bytes_.emplace(sink_);
    open_recording();
    const auto segment = shared_.lock()->segment;
    recording_->seek(position_of(segment), stop_of(segment));
  }
  bytes_->retry();
  GstFlowReturn result = step();
  if (result != nothing_ready) return result;
  result = output_due_ ? begin_output() : GST_FLOW_OK;
  if (recording_->at_end()) {
    warn_if_empty();
    warn_of_dropped();
    update_duration();
  }
  return result == GST_FLOW_OK ? GST_FLOW_EOS : result;
}
