// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <utility>
#include <vector>

/// Properties and their values, as text.
using ProfileEntries = std::vector<std::pair<std::string, std::string>>;

/// Reads the properties of `element` from a camera profile, which event-calibrate writes: a
/// GKeyFile of at most 64 KiB with a group of the element's name. Throws std::runtime_error, which
/// names the file and the reason.
ProfileEntries read_camera_profile(const std::string& path, const char* element);

/// Does the same with the text of a profile. The error gives the reason only.
ProfileEntries parse_camera_profile(const std::string& text, const char* element);
