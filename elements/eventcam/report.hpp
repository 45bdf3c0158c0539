// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <functional>
#include <string>

#include "src/measure/event_statistics.hpp"
#include "src/measure/map_picture.hpp"

/// Where an element writes what it has measured; nothing where a path is empty.
struct ReportPlaces {
  std::string location{};  ///< of the figures, as JSON
  std::string map{};       ///< of the picture of events per pixel
};

/// Sets the fields of a message that tell of one stream.
void put_figures(GstStructure* structure, const eventcamera::StreamFigures& figures);

/// Whether these files can be written, as far as their folders tell; where not, that is an error of
/// the element.
bool can_report(gpointer element, const ReportPlaces& places);

/// Writes the figures, with the structures within them as objects and their arrays as arrays, and
/// the picture, and posts the figures, which it takes.
void report(gpointer element, const ReportPlaces& places, GstStructure* figures,
            const std::function<eventcamera::RgbPicture()>& draw);
