// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstaggregator.h>

#include <memory>
#include <vector>

struct UnrefPad {
  void operator()(GstAggregatorPad* pad) const { gst_object_unref(pad); }
};
using OwnedAggregatorPad = std::unique_ptr<GstAggregatorPad, UnrefPad>;

/// The sink pads of an element in the order in which they were added. They may be released
/// meanwhile.
inline std::vector<OwnedAggregatorPad> sink_pads(gpointer element) {
  std::vector<OwnedAggregatorPad> pads;
  GST_OBJECT_LOCK(element);
  for (const GList* list = GST_ELEMENT(element)->sinkpads; list != nullptr; list = list->next)
    pads.emplace_back(GST_AGGREGATOR_PAD(gst_object_ref(list->data)));
  GST_OBJECT_UNLOCK(element);
  return pads;
}

/// Calls `work`, which must not throw, with each sink pad of an element.
template <class Work>
void for_each_sink_pad(gpointer element, Work work) noexcept {
  const auto call = [](GstElement*, GstPad* pad, gpointer to) -> gboolean {
    (*static_cast<Work*>(to))(GST_AGGREGATOR_PAD(pad));
    return TRUE;
  };
  gst_element_foreach_sink_pad(GST_ELEMENT(element), call, &work);
}
