// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <functional>
#include <string>

#include "gst/base/properties.hpp"
#include "src/measure/event_statistics.hpp"
#include "src/render/map_picture.hpp"
#include "src/simulate/simulator.hpp"

/// The files that an element writes what it has measured to; none where a path is empty.
struct ReportFiles {
  std::string location{};  ///< of the figures, as JSON
  std::string map{};       ///< of the picture of events per pixel
};

/// For class_init: the properties location and map, of settings that have ReportFiles.
template <class Properties>
void add_report_properties(Properties& properties, const char* map_blurb) {
  constexpr auto flags = static_cast<GParamFlags>(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS |
                                                  GST_PARAM_MUTABLE_READY);
  properties.add(
      &ReportFiles::location,
      g_param_spec_string("location", "Location",
                          "JSON file of the figures, written at EOS or on stop", "", flags));
  properties.add(&ReportFiles::map, g_param_spec_string("map", "Map", map_blurb, "", flags));
}

/// The stream time of a time of a segment.
eventcamera::Nanoseconds stream_time(const GstSegment& segment, GstClockTime time);

/// Sets the fields of a message that describe one stream.
void put_figures(GstStructure* structure, const eventcamera::StreamFigures& figures);

/// Whether these files can be written, as far as their folders tell; where not, that is an error of
/// the element.
bool can_report(gpointer element, const ReportFiles& files);

/// Writes the figures, with the structures within them as objects and their arrays as arrays, and
/// the picture, and posts the figures, which it takes.
void report(gpointer element, const ReportFiles& files, GstStructure* figures,
            const std::function<eventcamera::RgbPicture()>& draw);
