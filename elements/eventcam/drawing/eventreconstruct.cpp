// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventreconstruct
 * @title: eventreconstruct
 * @short_description: reconstructs grey video from events
 *
 * Turns an event stream into grey video that looks like a frame camera's, with the logarithm of the
 * brightness, at the framerate that downstream requests (default 30/1). No network and no frames
 * are needed. Static areas are grey, because they have no events.
 *
 * The events of each pixel pass a temporal high pass that counts events instead of time, as in
 * FIBAR (arXiv 2510.20071), and each event pulls its pixel towards the neighbours. The picture is
 * smoothed by a Gaussian, and its contrast is adjusted. docs/reconstruction.md has the equations.
 *
 * Pictures start, continue and end as in #GstEventRender. Players show this element's video instead
 * where its rank is higher: GST_PLUGIN_FEATURE_RANK=eventreconstruct:MAX.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc pattern=ball ! eventsim-dvs ! eventreconstruct ! videoconvert !
 * autovideosink
 * ]|
 *
 * Since: 0.1
 */
#include "elements/eventcam/drawing/event_pictures.hpp"
#include "gst/base/element_type.hpp"
#include "gst/base/guarded.hpp"
#include "gst/base/properties.hpp"
#include "gst/drawing/drawn_video.hpp"

GST_DEBUG_CATEGORY_STATIC(event_reconstruct_debug);
#define GST_CAT_DEFAULT event_reconstruct_debug

namespace {

using namespace eventcamera;

class EventReconstruct final : public EventPictures {
 public:
  explicit EventReconstruct(GstAggregator* element) : EventPictures(element, GST_CAT_DEFAULT) {}

  Guarded<Reconstruction::Settings> settings;

 private:
  RenderSettings render_settings() const override {
    RenderSettings render;
    render.mode = RenderMode::reconstruct;
    render.palette = PaletteName::grey;
    render.reconstruction = settings.copy();
    return render;
  }
};

}  // namespace

DEFINE_EVENT_AGGREGATOR(GstEventReconstruct, gst_event_reconstruct, EVENT_RECONSTRUCT,
                        EventReconstruct, eventreconstruct, GST_RANK_NONE, "grey video from events")

static void gst_event_reconstruct_class_init(GstEventReconstructClass* klass) {
  Properties<aggregator_settings<EventReconstruct>> properties(G_OBJECT_CLASS(klass));
  properties.add(&Reconstruction::Settings::cutoff, "cutoff",
                 "Period of the temporal high pass; higher values show larger and slower "
                 "structures, and longer traces (events of a pixel)",
                 Reconstruction::min_cutoff, 1e6);
  properties.add(&Reconstruction::Settings::smoothing, "smoothing",
                 "Standard deviation of the Gaussian that smooths the picture (pixels; 0 = none)",
                 0, Reconstruction::max_smoothing);
  init_pictures_class(GST_EVENT_AGGREGATOR_CLASS(klass),
                      "{ GRAY8, BGRx, RGBx, xRGB, xBGR, BGRA, RGBA, ARGB, ABGR, RGB, BGR }");
  set_metadata(klass, "Event reconstruction", "Codec/Decoder/Video",
               "Reconstructs grey video from events");
}
