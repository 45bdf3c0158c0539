// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "src/formats/aedat/aedat4.hpp"

namespace eventcamera {

/// Content of the XML in an AEDAT4 header.
struct Aedat4InfoNode {
  std::vector<StreamInfo> streams;
  bool whole = true;  ///< false: the XML is corrupt, and `streams` is incomplete
};

Aedat4InfoNode read_info_node(std::string_view xml);

std::string write_info_node(std::span<const StreamInfo> streams, Aedat4Compression compression);

/// Kind of streams whose packets have this four-character identifier.
StreamKind aedat4_kind(std::string_view identifier);

}  // namespace eventcamera
