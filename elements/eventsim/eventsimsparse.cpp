// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventsim-sparse
 * @title: eventsim-sparse
 * @short_description: events from frames interpolated where pixels changed
 *
 * Turns video into what an event camera would have seen. Only the pixels that changed between two
 * frames by more than the smaller threshold are followed, with Lucas-Kanade; in each interpolated
 * frame they stand on their way, and what changed from one interpolated frame to the next by more
 * than the thresholds fires (Ziegler et al., Real-time event simulation with frame-based cameras,
 * ICRA 2023, section III-B).
 *
 * For small things that move before a background that stands still; where the whole picture moves
 * it is the slowest simulator.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc pattern=ball num-buffers=300 ! eventsim-sparse !
 * application/x-event-camera ! filesink location=ball.xytp
 * ]|
 */
#include "gst/base/eventsimulator.hpp"
#include "src/simulate/sparse.hpp"

namespace {

constexpr double default_threshold = 10;

struct GstEventSimSparse {
  GstEventSimulator parent;
};

struct GstEventSimSparseClass {
  GstEventSimulatorClass parent_class;
};

}  // namespace

G_DEFINE_TYPE(GstEventSimSparse, gst_event_sim_sparse, GST_TYPE_EVENT_SIMULATOR)
GST_ELEMENT_REGISTER_DEFINE(eventsim_sparse, "eventsim-sparse", GST_RANK_NONE,
                            gst_event_sim_sparse_get_type())

static std::unique_ptr<eventcamera::Simulator> create(GstEventSimulator*,
                                                      const eventcamera::LumaFormat& format) {
  return eventcamera::make_sparse_simulator(format);
}

static void gst_event_sim_sparse_init(GstEventSimSparse*) {}

static void gst_event_sim_sparse_class_init(GstEventSimSparseClass* klass) {
  GstEventSimulatorClass* simulator_class = GST_EVENT_SIMULATOR_CLASS(klass);
  simulator_class->create = create;
  gst_event_simulator_class_install_thresholds(simulator_class, default_threshold);
  gst_event_simulator_class_install_interpolated_frames(simulator_class);
  gst_element_class_set_static_metadata(
      GST_ELEMENT_CLASS(klass), "Event camera simulator: sparse interpolation", "Converter/Video",
      "Turns video into events: follows only the pixels that changed to interpolate frames",
      "gst-eventsim");
}
