// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/eventdecoder/ending.hpp"

#include "gst/base/eventdecoder/decoding.hpp"
#include "gst/base/eventdecoder/event_file.hpp"
#include "gst/base/eventdecoder/intervals.hpp"
#include "gst/base/eventdecoder/output.hpp"
#include "gst/base/eventdecoder/state.hpp"
#include "gst/base/eventdecoder/statistics.hpp"

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
  state.chunker.finish();
  GstFlowReturn result = hand_out(self);
  // A file without events is an event stream, too.
  if (result == GST_FLOW_OK) result = begin_output(self);
  warn_of_dropped(self);
  return result;
}

}  // namespace eventdecoder
