// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventsim-dvs
 * @title: eventsim-dvs
 * @short_description: events from a physical pixel model
 *
 * Turns video into the events that an event camera would have reported, by simulating its pixels:
 * response to light, photoreceptor bandwidth, a reference level stored across frames, threshold
 * mismatch, leak, shot noise, hot and dead pixels, refractory period, latency, and the limits of
 * the readout. An event has the time of its pixel's threshold crossing, to the microsecond.
 *
 * A preset sets all of these. A profile overrides some: a small file that event-calibrate fits to a
 * camera. Properties that are set explicitly, before or after, override both. Times are
 * nanoseconds. Properties that gst-inspect-1.0 marks as controllable are read at the time of each
 * frame. Contrast thresholds are in units of the response: with log and lin-log, a threshold of 0.2
 * is a change of light by 22 %; linear has the same range from black to white as lin-log, ln(255)
 * = 5.54, so 0.2 is 9.2 grey levels of 8-bit video.
 *
 * Noise of the frame camera is found and removed by default; see #GstEventSimDvs:denoise.
 *
 * The same video, settings and seed give the same events for any number of threads.
 *
 * With #GstEventSimDvs:label, events carry their cause. `eventlabel` adds the class of the object
 * that a pixel saw.
 *
 * With upsampling=motion, where a frame has a #GstEventCameraFlowMeta, its optical flow up to the
 * next frame is used instead of estimating it, unless frames were skipped in between.
 * gst_buffer_add_event_camera_flow_meta() adds it, and `flowjoin` joins video and a stream of
 * flow, such as a renderer's. Flow that is not finite counts as 0. With #GstEventSimDvs:write-flow,
 * each buffer of events has the flow that was used, from its timestamp to its end; estimated flow
 * is 0 far from changed pixels.
 *
 * ## Example launch lines
 * |[
 * gst-launch-1.0 v4l2src ! eventsim-dvs preset=davis346 ! videoconvert ! autovideosink
 * ]|
 * |[
 * gst-launch-1.0 videotestsrc pattern=ball num-buffers=100 ! eventsim-dvs preset=v2e-noisy
 * threshold-sigma=0.03 seed=7 ! evtenc format=EVT3 ! filesink location=ball.raw
 * ]|
 *
 * Since: 0.1
 */
#include "gst/base/properties.hpp"
#include "gst/simulator/dvs_properties.hpp"
#include "gst/simulator/eventsimulator.hpp"
#include "gst/simulator/luma_video_simulator.hpp"
#include "src/dvs/dvs_simulator.hpp"

static void configure(eventcamera::IntervalSimulator& simulator, GObject* object) {
  static_cast<eventcamera::DvsSimulator&>(simulator).set(dvs_settings_of(object));
}

static const EventSimulatorMethod dvs = {
    .type_name = "GstEventSimDvs",
    .long_name = "Event camera simulator: physical pixel",
    .description =
        "Turns video into events: simulates the pixels of an event camera and their "
        "noise",
    .threshold = std::nullopt,
    .labels = true,
    .has_flow = true,
    .create = in_system_memory<eventcamera::make_dvs_simulator>,
    .make_settings = make_dvs_settings,
    .install_properties = install_dvs_properties,
    .configure = configure,
    .fault = fault_of_profile,
};
GST_ELEMENT_REGISTER_DEFINE(eventsim_dvs, "eventsim-dvs", GST_RANK_NONE, event_simulator_type(dvs))
