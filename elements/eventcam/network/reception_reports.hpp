// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>

#include "elements/eventcam/network/flush_timer.hpp"
#include "gst/base/errors.hpp"

/// Tells the application, once each, that a receiver hears nothing, and that it loses packets.
class ReceptionReports {
 public:
  /// After a change of the state of the element, whose packets `sink` receives. While playing, a
  /// warning is posted if no packet comes within 3 seconds.
  void follow(GstStateChange transition, GstPad* sink) {
    switch (transition) {
      case GST_STATE_CHANGE_PAUSED_TO_PLAYING:
        if (!is_heard_) timer_.set(3 * GST_SECOND, sink, warn_of_silence);
        break;
      case GST_STATE_CHANGE_PLAYING_TO_PAUSED:
        timer_.cancel();
        break;
      case GST_STATE_CHANGE_PAUSED_TO_READY:
        timer_.stop();
        is_heard_ = is_loss_told_ = false;
        break;
      default:
        break;
    }
  }

  void packet_arrived() {
    if (!is_heard_.exchange(true)) timer_.cancel();
  }

  /// Posts an element message, the first time.
  void packets_lost(GstElement* element, guint64 count) {
    if (is_loss_told_.exchange(true)) return;
    GST_WARNING_OBJECT(element, "lost %" G_GUINT64_FORMAT " packets; see the property stats",
                       count);
    gst_element_post_message(
        element, gst_message_new_element(GST_OBJECT(element),
                                         gst_structure_new("event-packets-lost", "lost-packets",
                                                           G_TYPE_UINT64, count, nullptr)));
  }

 private:
  static void warn_of_silence(GstObject* element) {
    post_message(element, GST_MESSAGE_WARNING,
                 {GST_RESOURCE_ERROR_READ,
                  "No packets for 3 seconds. Check that the sender sends to this host and port; "
                  "\"localhost\" may be IPv6, and udpsrc listens on IPv4 unless address=::, so "
                  "send to 127.0.0.1."},
                 "no packet since the state PLAYING");
  }

  FlushTimer timer_;
  std::atomic<bool> is_heard_ = false;
  std::atomic<bool> is_loss_told_ = false;
};
