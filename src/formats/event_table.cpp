// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/event_table.hpp"

#include <string>

namespace eventcamera {

namespace {

std::optional<EventColumn> column_with(std::string_view word) {
  struct Name {
    std::string_view name;
    EventColumn column;
  };
  static constexpr Name names[] = {
      {"t", EventColumn::t},
      {"ts", EventColumn::t},
      {"time", EventColumn::t},
      {"timestamp", EventColumn::t},
      {"timestamps", EventColumn::t},
      {"x", EventColumn::x},
      {"xs", EventColumn::x},
      {"y", EventColumn::y},
      {"ys", EventColumn::y},
      {"p", EventColumn::p},
      {"ps", EventColumn::p},
      {"pol", EventColumn::p},
      {"polarity", EventColumn::p},
      {"polarities", EventColumn::p},
      {"on", EventColumn::p},
      {"cause", EventColumn::cause},
      {"class", EventColumn::object_class},
  };
  const auto* const found = std::ranges::find(names, word, &Name::name);
  if (found == std::end(names)) return std::nullopt;
  return found->column;
}

std::optional<TimeUnit> unit_with(std::string_view word) {
  struct Name {
    std::string_view name;
    TimeUnit unit;
  };
  static constexpr Name names[] = {
      {"s", TimeUnit::seconds},       {"sec", TimeUnit::seconds},
      {"ms", TimeUnit::milliseconds}, {"us", TimeUnit::microseconds},
      {"µs", TimeUnit::microseconds}, {"usec", TimeUnit::microseconds},
      {"ns", TimeUnit::nanoseconds},  {"nsec", TimeUnit::nanoseconds},
  };
  const auto* const found = std::ranges::find(names, word, &Name::name);
  if (found == std::end(names)) return std::nullopt;
  return found->unit;
}

}  // namespace

std::optional<ColumnName> column_named(std::string_view name) {
  std::string lower(name);
  for (auto& letter : lower)
    if (letter >= 'A' && letter <= 'Z') letter = static_cast<char>(letter - 'A' + 'a');
  const std::string_view text = lower;
  const auto end = std::min(text.find_first_of(" @[("), text.size());
  const auto word = text.substr(0, end);
  if (const auto column = column_with(word)) {
    if (*column != EventColumn::t) return ColumnName{*column};
    const auto begin = text.find_first_not_of(" [(", end);
    if (begin == std::string_view::npos) return ColumnName{*column};
    return ColumnName{*column,
                      unit_with(text.substr(begin, text.find_first_of(" ])", begin) - begin))};
  }
  const auto mark = word.rfind('_');
  if (mark == std::string_view::npos || column_with(word.substr(0, mark)) != EventColumn::t)
    return std::nullopt;
  const auto unit = unit_with(word.substr(mark + 1));
  if (!unit) return std::nullopt;
  return ColumnName{EventColumn::t, unit};
}

std::optional<Columns> columns_of(std::string_view letters) {
  constexpr std::string_view known = "txyp";
  Columns columns;
  for (const auto letter : letters) {
    const auto at = known.find(letter);
    if (at == std::string_view::npos && letter != '-') return std::nullopt;
    columns.push_back(at == std::string_view::npos ? std::nullopt
                                                   : std::optional(static_cast<EventColumn>(at)));
  }
  for (std::size_t i = 0; i < known.size(); ++i)
    if (std::ranges::count(columns, std::optional(static_cast<EventColumn>(i))) != 1)
      return std::nullopt;
  return columns;
}

}  // namespace eventcamera
