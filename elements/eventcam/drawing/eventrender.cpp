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
 * Pictures continue without events: through GAP events and, from a live source, by the clock. Of a
 * pause of more than a minute there are pictures for a second only, with one warning. At framerate
 * 0/1 each buffer of events becomes one picture.
 *
 * Played slower, at a rate below 1, there are as many pictures a second as before, each of a
 * shorter interval. Events cannot be drawn backwards: a seek at a negative rate is refused.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc pattern=ball ! eventsim-dvs ! eventrender mode=decay !
 * video/x-raw,framerate=60/1 ! videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
#include "elements/eventcam/drawing/event_pictures.hpp"
#include "elements/eventcam/drawing/render_properties.hpp"
#include "gst/base/authors.hpp"
#include "gst/drawing/drawn_video.hpp"

GST_DEBUG_CATEGORY_STATIC(event_render_debug);
#define GST_CAT_DEFAULT event_render_debug

namespace {

class EventRender final : public EventPictures {
 public:
  explicit EventRender(GstAggregator* element) : EventPictures(element, GST_CAT_DEFAULT) {}

  Guarded<RenderProperties> settings;

 private:
  eventcamera::RenderSettings render_settings() const override {
    return settings.copy().of_renderer();
  }
  eventcamera::Microseconds window_start(const EventInterval& interval) const override {
    return settings.copy().window_start(interval);
  }
};

}  // namespace

DEFINE_EVENT_AGGREGATOR(GstEventRender, gst_event_render, EVENT_RENDER, EventRender, eventrender,
                        GST_RANK_PRIMARY, "events drawn as video")

static void gst_event_render_class_init(GstEventRenderClass* klass) {
  Properties<aggregator_settings<EventRender>> properties(G_OBJECT_CLASS(klass));
  add_render_properties(properties);
  init_pictures_class(GST_EVENT_AGGREGATOR_CLASS(klass), DRAWN_VIDEO_FORMATS);
  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), "Event renderer",
                                        "Codec/Decoder/Video", "Draws events as video",
                                        EVENTSIM_AUTHORS);
}
