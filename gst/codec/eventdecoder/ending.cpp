// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/codec/eventdecoder/ending.hpp"

#include "gst/codec/eventdecoder/decoding.hpp"
#include "gst/codec/eventdecoder/event_file.hpp"
#include "gst/codec/eventdecoder/intervals.hpp"
#include "gst/codec/eventdecoder/output.hpp"
#include "gst/codec/eventdecoder/state.hpp"
#include "gst/codec/eventdecoder/statistics.hpp"

namespace eventdecoder {

GstFlowReturn take_end(GstEventDecoder* self) {
  auto* priv = self->priv;
  State& state = *priv->state;
  if (reads_files(self) && !state.file) {
    const GstFlowReturn read = read_collected(self);
    if (read != GST_FLOW_OK) return read;
  }
  finish_decoder(self);
  slice(self, nullptr);
  state.slicer.finish();
  GstFlowReturn result = hand_out(self);
  // A file without events is an event stream, too.
  if (result == GST_FLOW_OK) result = begin_output(self);
  warn_of_dropped(self);
  return result;
}

}  // namespace eventdecoder
