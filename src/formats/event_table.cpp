// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/event_table.hpp"

#include <algorithm>
#include <string>

namespace eventcamera {

std::optional<EventColumn> event_column_named(std::string_view name) {
  struct Name {
    std::string_view name;
    EventColumn column;
  };
  static constexpr Name names[] = {
      {"t", EventColumn::t},          {"ts", EventColumn::t},
      {"time", EventColumn::t},       {"timestamp", EventColumn::t},
      {"timestamps", EventColumn::t}, {"t_us", EventColumn::t},
      {"time_us", EventColumn::t},    {"timestamp_us", EventColumn::t},
      {"x", EventColumn::x},          {"xs", EventColumn::x},
      {"y", EventColumn::y},          {"ys", EventColumn::y},
      {"p", EventColumn::p},          {"ps", EventColumn::p},
      {"pol", EventColumn::p},        {"polarity", EventColumn::p},
      {"polarities", EventColumn::p}, {"on", EventColumn::p},
  };
  std::string word(name.substr(0, name.find_first_of(" @[(")));
  for (auto& letter : word)
    if (letter >= 'A' && letter <= 'Z') letter = static_cast<char>(letter - 'A' + 'a');
  const auto* const found = std::ranges::find(names, word, &Name::name);
  if (found == std::end(names)) return std::nullopt;
  return found->column;
}

std::optional<ColumnOrder> column_order(std::string_view letters) {
  ColumnOrder order{};
  if (letters.size() != order.size()) return std::nullopt;
  for (const auto column : {'t', 'x', 'y', 'p'}) {
    const auto at = letters.find(column);
    if (at == std::string_view::npos) return std::nullopt;
    order[at] = *event_column_named({&column, 1});
  }
  return order;
}

}  // namespace eventcamera
