// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "src/formats/hdf5/hdf5_handle.hpp"

namespace eventcamera {

/// A text that is attached to a group or dataset.
std::optional<std::string> read_text_attribute(hid_t object, const char* name);

/// A whole number that is attached to a group or dataset.
std::optional<std::int64_t> read_number_attribute(hid_t object, const char* name);

/// Attaches a text, of variable length as Metavision's readers expect. False where that fails.
bool write_text_attribute(hid_t object, const char* name, const std::string& text);

}  // namespace eventcamera
