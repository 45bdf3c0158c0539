// SPDX-License-Identifier: LGPL-2.1-or-later
// What most files of the event core include, parsed once for each of its larger libraries.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>
