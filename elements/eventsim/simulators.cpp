// SPDX-License-Identifier: LGPL-2.1-or-later
/// Simulators without properties of their own: a table of methods.
#include "src/simulate/simulators.hpp"
#include "gst/simulator/eventsimulator.hpp"
#include "gst/simulator/luma_video_simulator.hpp"

/**
 * SECTION:element-eventsim-frame
 * @title: eventsim-frame
 * @short_description: events from the difference of two frames
 *
 * Turns video into the events that an event camera would have reported: an ON event if a pixel
 * became brighter than in the last frame by more than #GstEventSimFrame:positive-threshold, an OFF
 * event if it became darker by more than #GstEventSimFrame:negative-threshold, all at the time of
 * the frame (Ziegler et al., Real-time event simulation with frame-based cameras, ICRA 2023,
 * section III).
 *
 * The cheapest simulator, and the only one without event times between frames.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc pattern=ball ! eventsim-frame ! videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
static const EventSimulatorMethod frame = {
    .type_name = "GstEventSimFrame",
    .long_name = "Event camera simulator: difference frame",
    .description = "Turns video into events: thresholds the difference of successive frames",
    .threshold = 20,
    .denoises = true,
    .create = in_system_memory<eventcamera::make_frame_simulator>,
};
GST_ELEMENT_REGISTER_DEFINE(eventsim_frame, "eventsim-frame", GST_RANK_NONE,
                            event_simulator_type(frame))

/**
 * SECTION:element-eventsim-sparse
 * @title: eventsim-sparse
 * @short_description: events from frames interpolated where pixels changed
 *
 * Turns video into the events that an event camera would have reported. Only pixels that changed
 * between two frames by more than the smaller threshold are tracked, with Lucas-Kanade, and drawn
 * into each interpolated frame; pixels that change between successive interpolated frames by more
 * than the contrast thresholds fire (Ziegler et al., Real-time event simulation with frame-based
 * cameras, ICRA 2023, section III-B).
 *
 * For small objects that move in front of a static background. If everything moves, it is slow.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc pattern=ball num-buffers=300 ! eventsim-sparse !
 * eventnpyenc ! filesink location=ball.npy
 * ]|
 *
 * Since: 0.1
 */
static const EventSimulatorMethod sparse = {
    .type_name = "GstEventSimSparse",
    .long_name = "Event camera simulator: sparse interpolation",
    .description =
        "Turns video into events: tracks only the pixels that changed to interpolate "
        "frames",
    .threshold = 10,
    .denoises = true,
    .interpolates = true,
    .create = in_system_memory<eventcamera::make_sparse_simulator>,
};
GST_ELEMENT_REGISTER_DEFINE(eventsim_sparse, "eventsim-sparse", GST_RANK_NONE,
                            event_simulator_type(sparse))

/**
 * SECTION:element-eventsim-diff
 * @title: eventsim-diff
 * @short_description: events from interpolated difference frames
 *
 * Turns video into the events that an event camera would have reported. Pixels whose difference
 * between two frames exceeds the contrast thresholds are tracked into the next difference frame
 * with Lucas-Kanade, and fire along the track (Ziegler et al., Real-time event simulation with
 * frame-based cameras, ICRA 2023, section III-C).
 *
 * For objects with steady motion and appearance in front of a static background. The second frame
 * of a stream has no earlier difference frame, so it gives the same events as eventsim-frame.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 v4l2src ! eventsim-diff ! videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
static const EventSimulatorMethod diff = {
    .type_name = "GstEventSimDiff",
    .long_name = "Event camera simulator: difference interpolation",
    .description =
        "Turns video into events: tracks what changed from one difference frame to the "
        "next",
    .threshold = 20,
    .denoises = true,
    .interpolates = true,
    .create = in_system_memory<eventcamera::make_diff_simulator>,
};
GST_ELEMENT_REGISTER_DEFINE(eventsim_diff, "eventsim-diff", GST_RANK_NONE,
                            event_simulator_type(diff))
