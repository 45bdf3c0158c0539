// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventsim-frame
 * @title: eventsim-frame
 * @short_description: events from the difference frame
 *
 * Turns video into what an event camera would have seen: an ON event where a pixel became brighter
 * than in the last frame by more than #GstEventSimFrame:positive-threshold, an OFF event where it
 * became darker by more than #GstEventSimFrame:negative-threshold, all at the time of the frame
 * (Ziegler et al., Real-time event simulation with frame-based cameras, ICRA 2023, section III).
 *
 * The cheapest simulator, and the one without times between frames.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc pattern=ball ! eventsim-frame ! videoconvert ! autovideosink
 * ]|
 */
#include "gst/base/eventsimulator.hpp"
#include "src/simulate/frame.hpp"

namespace {

constexpr double default_threshold = 20;

struct GstEventSimFrame {
  GstEventSimulator parent;
};

struct GstEventSimFrameClass {
  GstEventSimulatorClass parent_class;
};

}  // namespace

G_DEFINE_TYPE(GstEventSimFrame, gst_event_sim_frame, GST_TYPE_EVENT_SIMULATOR)
GST_ELEMENT_REGISTER_DEFINE(eventsim_frame, "eventsim-frame", GST_RANK_NONE,
                            gst_event_sim_frame_get_type())

static std::unique_ptr<eventcamera::Simulator> create(GstEventSimulator*,
                                                      const eventcamera::LumaFormat& format) {
  return eventcamera::make_frame_simulator(format);
}

static void gst_event_sim_frame_init(GstEventSimFrame*) {}

static void gst_event_sim_frame_class_init(GstEventSimFrameClass* klass) {
  GstEventSimulatorClass* simulator_class = GST_EVENT_SIMULATOR_CLASS(klass);
  simulator_class->create = create;
  gst_event_simulator_class_install_thresholds(simulator_class, default_threshold);

  gst_element_class_set_static_metadata(
      GST_ELEMENT_CLASS(klass), "Event camera simulator: difference frame", "Converter/Video",
      "Turns video into events: where a frame differs from the one before", "gst-eventsim");
}
