// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <limits>
#include <string_view>

namespace eventcamera {

constexpr std::string_view npy_magic = "\x93NUMPY";

/// A claimed number of events that says that it was not known: the array goes to the file's end.
constexpr std::uint64_t npy_unknown_count = std::numeric_limits<std::int64_t>::max();

}  // namespace eventcamera
