// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstaggregator.h>

/// Answers a query for what can be sought as what comes to a pad would; GstAggregator says that
/// nothing can.
gboolean answer_seeking(GstAggregatorPad* pad, GstQuery* query);

/// Whether what comes to a pad would take a seek. GstAggregator flushes before it asks, and never
/// plays on where the answer is no.
bool would_seek(GstAggregatorPad* pad, GstEvent* seek);
