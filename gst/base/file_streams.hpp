// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <span>

#include "src/formats/decoder.hpp"

/// How the streams of a file begin and end, and what players that choose among them, as playbin3
/// does, have to be told.

/// The caps of events that are read from a file: they come in intervals of no frame.
#define FILE_EVENTS_CAPS                                                             \
  "application/x-event-camera, format = (string) XYTP, width = (int) [ 1, 65535 ], " \
  "height = (int) [ 1, 32768 ], framerate = (fraction) 0/1"

GstCaps* file_events_caps(eventcamera::SensorSize size);

/// The group that upstream's stream is of, or a new one. The event may be null.
guint group_of_streams(GstEvent* upstream);

/// Makes the event that starts a pad's stream. To players it is of video, whatever its caps: events
/// are drawn.
GstEvent* file_stream_start(GstElement* element, GstPad* pad, const char* name, guint group);

/// Pushes caps, and notes them with the pad's stream.
gboolean push_stream_caps(GstPad* pad, GstCaps* caps);

/// Tells of all streams that there are so far; each pad's has started.
void announce_streams(GstElement* element, std::span<GstPad* const> pads);

/// A segment as of a file whose first event is at 0, moved to where that is.
GstSegment segment_from(GstClockTime first, GstSegment segment);

/// Makes the event that ends a file's streams, or a segment of them where a seek asked for that: of
/// which the application is told.
GstEvent* end_of_streams(GstElement* element, const GstSegment& segment, guint32 seqnum);

/// Gives an event the number of the seek that it belongs to, if it does to any; takes and returns
/// it.
GstEvent* with_seqnum(GstEvent* event, guint32 seqnum);
