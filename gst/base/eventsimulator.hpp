// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstbasetransform.h>

#include <memory>

#include "src/simulate/simulator.hpp"

/// The abstract base class of the simulator elements: video in, events or accumulated-event video
/// out. It does all that GStreamer asks for; a subclass brings a Simulator and its properties.
///
/// N frames give N - 1 intervals; the first frame after start, flush or a discontinuity is the one
/// that the next is compared to. An interval has the PTS of its first frame and comes out with its
/// last, so the latency is one frame. In the event stream an interval without events is a GAP.
#define GST_TYPE_EVENT_SIMULATOR (gst_event_simulator_get_type())
G_DECLARE_DERIVABLE_TYPE(GstEventSimulator, gst_event_simulator, GST, EVENT_SIMULATOR,
                         GstBaseTransform)

using SimulatorMaker =
    std::unique_ptr<eventcamera::Simulator> (*)(const eventcamera::LumaFormat& format);

struct _GstEventSimulatorClass {
  GstBaseTransformClass parent_class;

  /// Makes the simulator for frames of this format. May throw.
  SimulatorMaker create;
  /// Gives the simulator, which create() made, the settings of the subclass. Called before each
  /// frame. May be null.
  void (*configure)(GstEventSimulator* self, eventcamera::Simulator& simulator);
};

/// For class_init: the properties positive-threshold and negative-threshold, both with this
/// default.
void gst_event_simulator_class_install_thresholds(GstEventSimulatorClass* klass,
                                                  double grey_levels);

/// For class_init: the property interpolated-frames.
void gst_event_simulator_class_install_interpolated_frames(GstEventSimulatorClass* klass);

/// For class_init: what applications and users read about the element.
void gst_event_simulator_class_describe(GstEventSimulatorClass* klass, const char* long_name,
                                        const char* description);

/// A simulator without properties of its own.
struct EventSimulatorMethod {
  const char* type_name;
  const char* long_name;
  const char* description;
  double threshold;  ///< default of both, grey levels
  bool interpolates;
  SimulatorMaker create;
};

/// The type of the elements of a method, which lives as long as the process.
GType event_simulator_type(const EventSimulatorMethod& method);
