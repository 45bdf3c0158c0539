// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

namespace eventcamera {

/// A column of a table of events.
enum class EventColumn : std::uint8_t { t, x, y, p };

/// What a column's name, as any tool writes it, says that it holds; large and small letters alike.
/// What follows a space, '@', '[' or '(' (a unit, a size) is not looked at.
std::optional<EventColumn> event_column_named(std::string_view name);

using ColumnOrder = std::array<EventColumn, 4>;

/// The order that a word such as "txyp" says; nothing where a letter is missing or not one of
/// these.
std::optional<ColumnOrder> column_order(std::string_view letters);

}  // namespace eventcamera
