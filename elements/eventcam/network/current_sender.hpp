// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/net/gstnetaddressmeta.h>

#include "gst/base/owned.hpp"

/// Keeps the first of several senders until it has been silent for a second. Datagrams without an
/// address, which udpsrc adds, count as one sender's.
class CurrentSender {
 public:
  /// Whether a datagram that arrived at this running time may be from the current sender.
  bool may_have_sent(GstBuffer* datagram, GstClockTime arrival) const {
    const GstNetAddressMeta* meta = gst_buffer_get_net_address_meta(datagram);
    return meta == nullptr || !GST_CLOCK_TIME_IS_VALID(arrival) || !address_ || is_of(meta->addr) ||
           arrival >= last_ + max_silence;
  }

  /// Makes the sender of a valid datagram the current one.
  void follow(GstBuffer* datagram, GstClockTime arrival) {
    const GstNetAddressMeta* meta = gst_buffer_get_net_address_meta(datagram);
    if (meta == nullptr || !GST_CLOCK_TIME_IS_VALID(arrival)) return;
    if (!is_of(meta->addr)) address_.reset(G_SOCKET_ADDRESS(g_object_ref(meta->addr)));
    last_ = arrival;
  }

 private:
  static constexpr GstClockTime max_silence = GST_SECOND;

  bool is_of(GSocketAddress* address) const {
    if (!address_ || !G_IS_INET_SOCKET_ADDRESS(address)) return address_.get() == address;
    auto* const ours = G_INET_SOCKET_ADDRESS(address_.get());
    auto* const theirs = G_INET_SOCKET_ADDRESS(address);
    return g_inet_socket_address_get_port(ours) == g_inet_socket_address_get_port(theirs) &&
           g_inet_address_equal(g_inet_socket_address_get_address(ours),
                                g_inet_socket_address_get_address(theirs)) != FALSE;
  }

  std::unique_ptr<GSocketAddress, UnrefObject> address_;
  GstClockTime last_ = 0;  ///< arrival of its last datagram
};
