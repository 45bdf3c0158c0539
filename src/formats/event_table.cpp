// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/event_table.hpp"

#include <cmath>
#include <string>

#include "src/formats/corruption.hpp"

namespace eventcamera {

namespace {

std::optional<EventColumn> column_with(std::string_view word) {
  struct Name {
    std::string_view name;
    EventColumn column;
  };
  static constexpr Name names[] = {
      {"t", EventColumn::t},          {"ts", EventColumn::t},
      {"time", EventColumn::t},       {"timestamp", EventColumn::t},
      {"timestamps", EventColumn::t}, {"time_stamp", EventColumn::t},
      {"times", EventColumn::t},      {"stamp", EventColumn::t},
      {"x", EventColumn::x},          {"xs", EventColumn::x},
      {"col", EventColumn::x},        {"cols", EventColumn::x},
      {"column", EventColumn::x},     {"y", EventColumn::y},
      {"ys", EventColumn::y},         {"row", EventColumn::y},
      {"rows", EventColumn::y},       {"p", EventColumn::p},
      {"ps", EventColumn::p},         {"pol", EventColumn::p},
      {"pols", EventColumn::p},       {"polarity", EventColumn::p},
      {"polarities", EventColumn::p}, {"on", EventColumn::p},
      {"cause", EventColumn::cause},  {"class", EventColumn::object_class},
  };
  word.remove_prefix(word.rfind('.') + 1);
  for (const std::string_view before : {"event_", "events_", "dataset_events_", "ev_", "coord_"})
    if (word.starts_with(before)) {
      word.remove_prefix(before.size());
      break;
    }
  for (const std::string_view after :
       {"_coords", "_coord", "_coordinates", "_coordinate", "_position", "_pos", "_px"})
    if (word.ends_with(after)) {
      word.remove_suffix(after.size());
      break;
    }
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
      {"s", TimeUnit::seconds},
      {"sec", TimeUnit::seconds},
      {"secs", TimeUnit::seconds},
      {"second", TimeUnit::seconds},
      {"seconds", TimeUnit::seconds},
      {"ms", TimeUnit::milliseconds},
      {"msec", TimeUnit::milliseconds},
      {"milliseconds", TimeUnit::milliseconds},
      {"us", TimeUnit::microseconds},
      {"\xc2\xb5s", TimeUnit::microseconds},  // micro sign
      {"\xce\xbcs", TimeUnit::microseconds},  // Greek mu
      {"usec", TimeUnit::microseconds},
      {"microseconds", TimeUnit::microseconds},
      {"ns", TimeUnit::nanoseconds},
      {"nsec", TimeUnit::nanoseconds},
      {"nanosec", TimeUnit::nanoseconds},
      {"nanoseconds", TimeUnit::nanoseconds},
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

void PolarityCode::count(double number) {
  constexpr std::size_t max_names = 40;
  ++rows_;
  if (number == 0 || number == 1 || number == 2) {
    ++counts_[static_cast<std::size_t>(number)];
  } else if (number == std::trunc(number) && std::abs(number) <= UINT32_MAX &&
             is_minus_one(static_cast<std::int64_t>(number))) {
    ++minus_ones_;
    if (number > 0) ++unsigned_;
  } else if (std::isfinite(number)) {
    ++other_rows_;
    std::string text = std::to_string(number);
    text.erase(text.find_last_not_of('0') + 1);
    if (text.ends_with('.')) text.pop_back();
    text = " " + text;
    if (others_.size() < max_names && (others_ + " ").find(text + " ") == std::string::npos)
      others_ += text;
  }
}

void PolarityCode::choose() {
  const auto [zeros, ones, twos] = counts_;
  const bool is_ambiguous = unsigned_ * 100 > rows_ && zeros * 100 > rows_;
  if (twos > 0 && zeros + minus_ones_ == 0) on_ = 2;
  const auto wrong = other_rows_ + (on_ == 2 ? 0 : twos);
  if (wrong * 100 <= rows_ && !is_ambiguous) return;
  std::string values;
  if (minus_ones_ > unsigned_) values += " -1";
  if (zeros > 0) values += " 0";
  if (ones > 0) values += " 1";
  if (twos > 0) values += " 2";
  if (unsigned_ > 0) values += " and the largest unsigned number";
  throw UnsupportedFormat("the polarities are" + values + others_ +
                          "; write 1 for ON and 0 or -1 for OFF");
}

void UnreadableRows::check(bool ended) const {
  constexpr std::uint64_t always_tolerated = 100;
  if (unreadable_ * 100 <= rows_ || (!ended && unreadable_ <= always_tolerated)) return;
  throw UnsupportedFormat("more than one in a hundred is not an event, first " + first_);
}

}  // namespace eventcamera
