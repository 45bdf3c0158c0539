// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstbasetransform.h>

#include "gst/base/owned.hpp"
#include "src/core/event_buckets.hpp"
#include "src/simulate/simulator.hpp"

/// For class_init: installs the virtual functions for input and output buffers.
void event_simulator_class_install_buffers(GstBaseTransformClass* klass);

/// Writes the events of an interval of `simulator`, at least one, and their labels to a new buffer.
/// `in` is the frame that ends the interval. Throws std::bad_alloc.
GstFlowReturn event_simulator_write_events(GstBaseTransform* transform,
                                           const eventcamera::EventBuckets& events,
                                           eventcamera::IntervalSimulator& simulator, GstBuffer* in,
                                           OwnedBuffer& out);

/// Makes a buffer to draw the events of an interval in, with the metas of `in` that remain valid.
GstFlowReturn event_simulator_make_picture(GstBaseTransform* transform, GstBuffer* in,
                                           OwnedBuffer& picture);
