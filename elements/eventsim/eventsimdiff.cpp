// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventsim-diff
 * @title: eventsim-diff
 * @short_description: events from interpolated difference frames
 *
 * Turns video into what an event camera would have seen. The difference of two frames, where it
 * exceeds the thresholds, is followed into the difference of the next two with Lucas-Kanade; its
 * pixels fire on their way (Ziegler et al., Real-time event simulation with frame-based cameras,
 * ICRA 2023, section III-C).
 *
 * For things that move evenly and keep their look before a background that stands still. The
 * second frame of a stream has no earlier difference: its events are those of eventsim-frame.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 v4l2src ! eventsim-diff ! videoconvert ! autovideosink
 * ]|
 */
#include "gst/base/eventsimulator.hpp"
#include "src/simulate/diff.hpp"

namespace {

constexpr double default_threshold = 20;

struct GstEventSimDiff {
  GstEventSimulator parent;
};

struct GstEventSimDiffClass {
  GstEventSimulatorClass parent_class;
};

}  // namespace

G_DEFINE_TYPE(GstEventSimDiff, gst_event_sim_diff, GST_TYPE_EVENT_SIMULATOR)
GST_ELEMENT_REGISTER_DEFINE(eventsim_diff, "eventsim-diff", GST_RANK_NONE,
                            gst_event_sim_diff_get_type())

static std::unique_ptr<eventcamera::Simulator> create(GstEventSimulator*,
                                                      const eventcamera::LumaFormat& format) {
  return eventcamera::make_diff_simulator(format);
}

static void gst_event_sim_diff_init(GstEventSimDiff*) {}

static void gst_event_sim_diff_class_init(GstEventSimDiffClass* klass) {
  GstEventSimulatorClass* simulator_class = GST_EVENT_SIMULATOR_CLASS(klass);
  simulator_class->create = create;
  gst_event_simulator_class_install_thresholds(simulator_class, default_threshold);
  gst_event_simulator_class_install_interpolated_frames(simulator_class);
  gst_element_class_set_static_metadata(
      GST_ELEMENT_CLASS(klass), "Event camera simulator: difference interpolation",
      "Converter/Video",
      "Turns video into events: follows what changed from one difference frame to the next",
      "gst-eventsim");
}
