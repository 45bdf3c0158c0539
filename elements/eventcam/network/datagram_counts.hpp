// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

/// Counts of datagrams. Losses are known only if datagrams have a sequence number.
struct DatagramCounts {
  guint64 packets = 0;
  guint64 events = 0;
  guint64 bytes = 0;
  guint64 lost = 0;
  guint64 late = 0;
  guint64 rejected = 0;
};
