// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventrender
 * @title: eventrender
 * @short_description: draws events as video
 *
 * Turns an event stream into video, at the framerate that downstream requests (default 30/1). A
 * picture shows the state at the end of its interval, PTS + duration.
 *
 * - `accumulate`: pixels with ON, OFF or both within a window;
 * - `decay`: the exponentially decaying sum of ON minus OFF;
 * - `time-surface`: age and polarity of the last event of each pixel;
 * - `count`: ON minus OFF within a window.
 *
 * The window is as long as a picture's interval, or #GstEventRender:accumulation-time; windows may
 * then overlap. #GstEventRender:event-count and #GstEventRender:area-event-count limit the window
 * by the number of events instead of by time.
 *
 * Pictures have the size of the sensor. A sensor of more than 8 million pixels is drawn at half its
 * size, or a third, and so on.
 *
 * Pictures continue without events: through GAP events and, from a live source, by the clock. A
 * pause of more than a minute has pictures for one second only, with a warning. At framerate 0/1
 * each buffer of events becomes one picture.
 *
 * Slow motion, at a rate below 1, has the same framerate, with pictures of shorter intervals.
 * Events cannot be drawn backwards: a seek at a negative rate is refused.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc pattern=ball ! eventsim-dvs ! eventrender mode=decay !
 * video/x-raw,framerate=60/1 ! videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
#include <limits>

#include "elements/eventcam/drawing/event_pictures.hpp"
#include "gst/base/element_type.hpp"
#include "gst/base/guarded.hpp"
#include "gst/base/properties.hpp"
#include "gst/drawing/drawn_video.hpp"
#include "src/render/renderer.hpp"

GST_DEBUG_CATEGORY_STATIC(event_render_debug);
#define GST_CAT_DEFAULT event_render_debug

using namespace eventcamera;

namespace {

/// User-settable values, copied once per picture.
struct Settings {
  RenderMode mode = RenderMode::accumulate;
  PaletteName palette = PaletteName::dark;
  GstClockTime accumulation_time = 0;
  guint event_count = 0;
  guint area_event_count = 0;
  guint area_size = 16;
  gdouble full_scale = 2;

  /// Settings of the renderer. Those that a mode does not use keep their defaults, so that changing
  /// them does not reset the picture.
  RenderSettings of_renderer() const {
    /// Default time constant of decay and maximum age of time-surface.
    constexpr GstClockTime default_memory = 100 * GST_MSECOND;
    RenderSettings settings;
    settings.mode = mode;
    settings.palette = palette;
    const auto time = accumulation_time > 0 ? accumulation_time : default_memory;
    if (mode == RenderMode::decay || mode == RenderMode::time_surface)
      settings.time_constant = static_cast<Microseconds>(std::max(time / 1000, GstClockTime{1}));
    else
      settings.limits = {event_count, area_event_count, static_cast<int>(area_size)};
    if (mode == RenderMode::decay || mode == RenderMode::count)
      settings.full_scale = static_cast<float>(full_scale);
    return settings;
  }

  /// Start of the window for the picture of an interval.
  Microseconds window_start(const EventInterval& interval) const {
    if (accumulation_time > 0)
      return interval.end > accumulation_time ? microseconds(interval.end - accumulation_time) : -1;
    if (event_count > 0 || area_event_count > 0) return -1;
    return microseconds(interval.start);
  }
};

class EventRender final : public EventPictures {
 public:
  explicit EventRender(GstAggregator* element) : EventPictures(element, GST_CAT_DEFAULT) {}

  Guarded<Settings> settings;

 private:
  RenderSettings render_settings() const override { return settings.copy().of_renderer(); }
  Microseconds window_start(const EventInterval& interval) const override {
    return settings.copy().window_start(interval);
  }
};

}  // namespace

DEFINE_EVENT_AGGREGATOR(GstEventRender, gst_event_render, EVENT_RENDER, EventRender, eventrender,
                        GST_RANK_PRIMARY, "events drawn as video")

static void gst_event_render_class_init(GstEventRenderClass* klass) {
  Properties<aggregator_settings<EventRender>> properties(G_OBJECT_CLASS(klass));
  properties.add(
      &Settings::mode, "mode", "What a picture shows",
      enum_type<RenderMode>(
          "GstEventRenderMode",
          {{RenderMode::accumulate, "Polarities that fired within a window", "accumulate"},
           {RenderMode::decay, "Exponentially decaying sum of ON minus OFF", "decay"},
           {RenderMode::time_surface, "Age and polarity of the last event", "time-surface"},
           {RenderMode::count, "ON minus OFF within a window", "count"}}));
  properties.add(&Settings::palette, "palette",
                 "Colours of the picture; viridis and magma show magnitude, not polarity",
                 palette_type());
  properties.add(&Settings::accumulation_time, "accumulation-time",
                 "Length of the window of accumulate and count, time constant of decay, maximum "
                 "age of time-surface (ns; 0 = for accumulate and count, one frame, or as long as "
                 "event-count and area-event-count allow; for the others, 100 ms)",
                 0, std::numeric_limits<gint64>::max());
  properties.add(
      &Settings::event_count, "event-count",
      "Maximum number of events in the window of accumulate and count (events; 0 = no limit)", 0,
      RecentEvents::max_size);
  properties.add(&Settings::area_event_count, "area-event-count",
                 "Maximum number of events per area in the window of accumulate and count: the "
                 "busiest area determines its length (events; 0 = no limit)",
                 0, RecentEvents::max_size);
  properties.add(&Settings::area_size, "area-size",
                 "Side of the squares that area-event-count counts in (pixels)", 1, max_side);
  properties.add(&Settings::full_scale, "full-scale",
                 "Number of events of a pixel shown in full colour by decay and count (events)",
                 0.1, 1e6);
  init_pictures_class(GST_EVENT_AGGREGATOR_CLASS(klass), DRAWN_VIDEO_FORMATS);
  set_metadata(klass, "Event renderer", "Codec/Decoder/Video", "Draws events as video");
}
