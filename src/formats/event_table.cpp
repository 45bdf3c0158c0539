// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/event_table.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "src/formats/corruption.hpp"

namespace eventcamera {

namespace {

/// Words with the same meaning, each between blanks.
template <class Meaning>
struct Synonyms {
  std::string_view words;
  Meaning meaning;
};

template <class Meaning, std::size_t count>
std::optional<Meaning> meaning_of(std::string_view word, const Synonyms<Meaning> (&known)[count]) {
  const auto wanted = " " + std::string(word) + " ";
  for (const auto& [words, meaning] : known)
    if (words.find(wanted) != std::string_view::npos) return meaning;
  return std::nullopt;
}

std::optional<EventColumn> column_with(std::string_view word) {
  static constexpr Synonyms<EventColumn> columns[] = {
      {" t ts time timestamp timestamps time_stamp times stamp ", EventColumn::t},
      {" x xs col cols column ", EventColumn::x},
      {" y ys row rows ", EventColumn::y},
      {" p ps pol pols polarity polarities on ", EventColumn::p},
      {" cause ", EventColumn::cause},
      {" class ", EventColumn::object_class},
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
  return meaning_of(word, columns);
}

std::optional<TimeUnit> unit_with(std::string_view word) {
  // Of the microseconds, the second word has a micro sign, and the third a Greek mu.
  static constexpr Synonyms<TimeUnit> units[] = {
      {" s sec secs second seconds ", TimeUnit::seconds},
      {" ms msec milliseconds ", TimeUnit::milliseconds},
      {" us \xc2\xb5s \xce\xbcs usec microseconds ", TimeUnit::microseconds},
      {" ns nsec nanosec nanoseconds ", TimeUnit::nanoseconds},
  };
  return meaning_of(word, units);
}

using Form = TableNumber::Form;

bool is_whole(double value) {
  return std::trunc(value) == value;
}

bool is_within(double value, double first, double end) {
  return is_whole(value) && value >= first && value < end;
}

/// True if the number is valid in this column.
bool fits(double value, EventColumn column) {
  switch (column) {
    case EventColumn::t:
      return std::isfinite(value);
    case EventColumn::x:
      return is_within(value, 0, 0x10000);
    case EventColumn::y:
      return is_within(value, 0, 0x8000);
    case EventColumn::p:
      return is_within(value, -1, 0x100000000);
    case EventColumn::cause:
    case EventColumn::object_class:
      return true;  // an event without a label is an event
  }
  return false;
}

/// Number of a column that exists.
std::size_t index_of(EventColumn column, const Columns& columns) {
  return static_cast<std::size_t>(std::ranges::find(columns, std::optional(column)) -
                                  columns.begin());
}

/// Distinguishes microseconds from nanoseconds by the gaps between integer times. Multiples of 1000
/// throughout are nanoseconds converted from microseconds; frequent gaps below 10 are too short for
/// nanoseconds.
std::optional<TimeUnit> unit_by_gaps(const std::vector<TableNumber>& times) {
  constexpr std::size_t many = 16;
  constexpr double short_gap = 10;
  std::vector<double> gaps;
  for (std::size_t i = 1; i < times.size(); ++i)
    if (times[i].value > times[i - 1].value) gaps.push_back(times[i].value - times[i - 1].value);
  if (std::ranges::all_of(times, [](auto t) { return std::fmod(t.value, 1000) == 0; }))
    return gaps.size() >= many ? std::optional(TimeUnit::nanoseconds) : std::nullopt;
  std::ranges::sort(gaps);
  const bool is_dense = !gaps.empty() && gaps[gaps.size() / 4] < short_gap;
  return is_dense ? std::optional(TimeUnit::microseconds) : std::nullopt;
}

/// True if the times are integers from 0 or 1 on without gaps, each of many events: most probably
/// numbers of frames.
bool are_frame_numbers(const std::vector<TableNumber>& times) {
  constexpr std::size_t min_events = 8;
  if (times.front().value < 0 || times.front().value > 1) return false;
  std::size_t events = 1;
  for (std::size_t i = 1; i < times.size(); ++i, ++events) {
    const auto gap = times[i].value - times[i - 1].value;
    if (gap == 0) continue;
    if (gap != 1 || events < min_events) return false;
    events = 0;
  }
  return times.back().value > times.front().value;
}

/// False if events are further apart in this unit than event cameras and simulators write them,
/// unless the table is our own, or if integer microseconds start at weeks without being a date.
bool is_plausible(std::vector<TableNumber> times, TimeUnit unit, bool is_own) {
  constexpr std::size_t min_rows = 4;
  constexpr std::size_t many_rows = 64;
  constexpr double max_uptime = 1e12;
  constexpr double min_date = 1e14;
  if (times.size() < min_rows) return true;
  const bool is_whole_microsecond = unit == TimeUnit::microseconds;
  if (is_whole_microsecond && are_frame_numbers(times)) return false;
  if (is_whole_microsecond && times.front().value >= max_uptime && times.front().value < min_date)
    return false;
  if (is_own) return true;
  std::size_t falls = 0;
  for (std::size_t i = 1; i < times.size(); ++i) falls += times[i].value < times[i - 1].value;
  // In a shuffled table, the next event is rarely among the first rows.
  const bool is_shuffled = falls * 4 > times.size();
  if (is_shuffled) std::ranges::sort(times, {}, &TableNumber::value);
  std::vector<double> gaps;
  for (std::size_t i = 1; i < times.size(); ++i)
    gaps.push_back(std::abs(times[i].value - times[i - 1].value));
  const auto median = gaps.begin() + static_cast<std::ptrdiff_t>(gaps.size() / 2);
  std::ranges::nth_element(gaps, median);
  const double microseconds = *median * std::pow(10, power_of(unit));
  const bool is_dense = times.size() >= many_rows && !is_shuffled;
  const double max_gap = !is_dense ? 1e6 : is_whole_microsecond ? 1e3 : 1e4;
  return microseconds <= max_gap;
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

bool TableSample::has_columns(std::size_t count) const {
  return !rows_.empty() &&
         std::ranges::all_of(rows_, [count](const Row& row) { return row.size() == count; });
}

bool TableSample::counts_rows(std::size_t columns) const {
  if (!has_columns(columns)) return false;
  for (std::size_t i = 1; i < rows_.size(); ++i)
    if (rows_[i].front().value != rows_[i - 1].front().value + 1) return false;
  return true;
}

/// Times of the rows that are events.
std::vector<TableNumber> TableSample::times_of(const Columns& columns) const {
  std::vector<TableNumber> times;
  for (const auto& row : rows_) {
    if (row.size() != columns.size()) continue;
    bool is_event = true;
    for (std::size_t i = 0; i < row.size(); ++i)
      is_event = is_event && (!columns[i] || fits(row[i].value, *columns[i]));
    if (!is_event) continue;
    times.push_back(row[index_of(EventColumn::t, columns)]);
  }
  return times;
}

std::optional<Columns> TableSample::find_columns(bool is_xypt) const {
  const std::size_t skipped = counts_rows(event_columns + 1) ? 1 : 0;
  // Returns the column with a number for which `holds` is true, if there is exactly one.
  const auto only_column = [&](const auto& holds) {
    std::optional<std::size_t> only;
    std::size_t count = 0;
    for (auto i = skipped; i < skipped + 4; ++i) {
      const bool is_one = std::ranges::any_of(
          rows_, [&](const Row& row) { return row.size() == skipped + 4 && holds(row[i]); });
      if (!is_one) continue;
      only = i;
      ++count;
    }
    return count == 1 ? only : std::nullopt;
  };
  auto time = only_column(
      [](TableNumber number) { return std::isfinite(number.value) && !is_whole(number.value); });
  if (!time) time = only_column([](TableNumber number) { return number.form != Form::integer; });

  for (const auto* const letters : {is_xypt ? "xypt" : "txyp", "txyp", "xypt", "xytp"}) {
    auto columns = *columns_of(letters);
    columns.insert(columns.begin(), skipped, std::nullopt);
    if (rows_.empty()) return columns;
    const auto times = times_of(columns);
    if (times.size() * 2 < rows_.size()) continue;
    const auto p = index_of(EventColumn::p, columns);
    const auto polarities = std::ranges::count_if(rows_, [&](const Row& row) {
      return row.size() == columns.size() && is_within(row[p].value, -1, 3);
    });
    if (static_cast<std::size_t>(polarities) * 2 < rows_.size()) continue;
    const bool is_it = time ? columns[*time] == EventColumn::t
                            : std::ranges::is_sorted(times, {}, &TableNumber::value);
    if (is_it) return columns;
  }
  return std::nullopt;
}

std::optional<TimeUnit> TableSample::find_unit(const Columns& columns, bool is_either,
                                               bool may_be_own) const {
  const auto times = times_of(columns);
  const auto unit = guessed_unit(columns, is_either, times);
  const auto p = index_of(EventColumn::p, columns);
  const bool is_own = may_be_own && unit == TimeUnit::microseconds &&
                      std::ranges::all_of(rows_, [&](const Row& row) {
                        return row.size() != columns.size() || is_within(row[p].value, 0, 2);
                      });
  return unit && is_plausible(times, *unit, is_own) ? unit : std::nullopt;
}

PolarityCode TableSample::find_polarities(const Columns& columns) const {
  PolarityCode code;
  const auto p = index_of(EventColumn::p, columns);
  for (const auto& row : rows_)
    if (row.size() == columns.size()) code.count(row[p].value);
  code.choose();
  return code;
}

std::optional<TimeUnit> TableSample::guessed_unit(const Columns& columns, bool is_either,
                                                  const std::vector<TableNumber>& times) const {
  // Dates from 1973 on; no recording that starts at 0 is that long.
  constexpr double min_date_in_microseconds = 1e14;
  constexpr double min_date_in_nanoseconds = 1e17;
  if (times.empty()) return TimeUnit::microseconds;
  if (!std::ranges::all_of(times, is_whole, &TableNumber::value)) return TimeUnit::seconds;
  const auto last = std::ranges::max(times, {}, &TableNumber::value).value;
  if (last >= min_date_in_nanoseconds) return TimeUnit::nanoseconds;
  if (last >= min_date_in_microseconds) return TimeUnit::microseconds;
  const auto form = std::ranges::max(times, {}, &TableNumber::form).form;
  if (form == Form::integer) return is_either ? unit_by_gaps(times) : TimeUnit::microseconds;

  // Integer values in floating-point form are either microseconds converted to floating point, like
  // the coordinates, or full seconds in a file that writes all decimals.
  const bool are_all_floating = std::ranges::any_of(rows_, [&](const Row& row) {
    if (row.size() != columns.size()) return false;
    for (std::size_t i = 0; i < row.size(); ++i)
      if (columns[i] == EventColumn::x && row[i].form != Form::integer) return true;
    return false;
  });
  if (form == Form::decimals && !are_all_floating) return TimeUnit::seconds;
  const bool differ = times.front().value != times.back().value;
  return differ ? std::optional(TimeUnit::microseconds) : std::nullopt;
}

}  // namespace eventcamera
