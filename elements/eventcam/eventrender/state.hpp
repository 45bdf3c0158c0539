// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstaggregator.h>
#include <gst/video/video.h>

#include <mutex>
#include <optional>

#include "elements/eventcam/broken_events.hpp"
#include "elements/eventcam/eventrender/frame_times.hpp"
#include "elements/eventcam/eventrender/settings.hpp"
#include "gst/eventcamera/eventcamera.h"
#include "src/render/renderer.hpp"

GST_DEBUG_CATEGORY_EXTERN(event_render_debug);
#define GST_CAT_DEFAULT event_render_debug

namespace eventrender {

/// What exists between caps and stop.
struct State {
  GstEventCameraInfo events;          ///< what comes in
  std::optional<GstVideoInfo> video;  ///< what goes out, once that is negotiated
  eventcamera::Renderer renderer;
};

}  // namespace eventrender

struct GstEventRenderPrivate {
  std::mutex mutex;  // guards what follows; nothing is called under it
  eventrender::Settings settings;
  GstClockTime earliest = 0;  // running time before which pictures would come too late

  // The source pad's thread's, or nobody's while there is none.
  std::optional<eventrender::State> state;
  // Of the next picture, once the first event is near.
  std::optional<eventrender::FrameTimes> times;
  std::optional<gsize> taken;  // events of the buffer that is queued first, once looked at
  GstClockTime known = 0;      // events are in up to here
  std::optional<GstClockTime> waiting_since;  // for the first event, in running time
  bool discontinuous = false;                 // the next picture does not follow on the last one
  bool warned_of_times = false;
  BrokenEvents broken{"left out"};

  /// What comes next does not follow on what was drawn. May throw.
  void begin_anew();
};

struct GstEventRender {
  GstAggregator parent;
  GstEventRenderPrivate* priv;
};

struct GstEventRenderClass {
  GstAggregatorClass parent_class;
};

namespace eventrender {

inline GstEventRender* event_render(gpointer object) {
  return static_cast<GstEventRender*>(object);
}

Settings settings_of(GstEventRender* self);

GstAggregatorPad* sink_pad(GstEventRender* self);

/// That of the sink pad.
GstSegment segment_of(GstEventRender* self);

/// Lets go of what takes the memory, and tells the user.
void report_no_memory(GstEventRender* self);

}  // namespace eventrender
