// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstaggregator.h>

/// The sink pads of aggregators that take events.

/// Adds the pad of the template of this name, which is always there.
GstAggregatorPad* add_sink_pad(gpointer aggregator, const char* name);

/// Answers which caps a pad takes whose buffers go on as they come: what downstream takes.
void answer_caps_of_passed(GstAggregator* aggregator, GstAggregatorPad* pad, GstQuery* query);

/// Whether events can be taken in this segment, forwards in time; where not, that is an error of
/// the element. `taken` is what it does with events, as "drawn".
bool plays_forwards(gpointer aggregator, const GstSegment& segment, const char* taken);
