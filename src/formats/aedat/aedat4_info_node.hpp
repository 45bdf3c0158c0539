// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "src/formats/aedat/aedat4.hpp"

namespace eventcamera {

/// What the XML of an AEDAT4 header says.
struct Aedat4InfoNode {
  std::vector<StreamInfo> streams;
  bool whole = true;  ///< false: the XML is corrupt, and the streams are what could be read of it
};

Aedat4InfoNode read_info_node(std::string_view xml);

std::string write_info_node(std::span<const StreamInfo> streams, Aedat4Compression compression);

/// The kind of a stream whose packets have this four-character identifier.
StreamKind aedat4_kind(std::string_view identifier);

}  // namespace eventcamera
