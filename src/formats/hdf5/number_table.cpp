// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/hdf5/number_table.hpp"

#include <algorithm>
#include <iterator>

#include "src/formats/hdf5/hdf5_rows.hpp"
#include "src/formats/unsupported_format.hpp"

namespace eventcamera {

std::uint64_t NumberTable::read(std::uint64_t row, RowValidator& validator,
                                std::vector<AbsoluteEvent>& out, Corruption& corruption) {
  auto end = block_end(row, rows_);
  const auto* unread = read_numbers(row, end - row);
  if (unread != nullptr) {
    end = std::min(end, chunk_end(row));
    unread = read_numbers(row, end - row);
  }
  if (unread != nullptr) {
    note(corruption, *unread, row, "unreadable part of an HDF5 dataset");
    return end;
  }
  if (wraps_ && row != next_row_) clock_.restore(unwrapped(row, t_.front()));
  next_row_ = end;
  for (std::size_t i = 0; i < t_.size(); ++i) {
    Microseconds t = wraps_ ? clock_.follow(static_cast<std::uint32_t>(t_[i])) : t_[i];
    if (__builtin_add_overflow(t, offset_, &t)) {
      note(corruption, t_dataset(), row, "timestamp out of range");
      continue;
    }
    const auto on = polarities_.is_on(p_[i]);
    if (!on) {
      note(corruption, t_dataset(), row, "polarity other than 0, 1 and -1");
      continue;
    }
    const auto label = has_labels_ ? label_from(cause_[i], object_class_[i]) : Label{};
    validator.take(t, x_[i], y_[i], *on, label, out, corruption);
  }
  return end;
}

TimeUnit NumberTable::detect(const TableSample& sample, const Columns& columns,
                             std::optional<TimeUnit> unit, bool are_floating,
                             const std::string& path) {
  if (!sample.empty()) polarities_ = sample.find_polarities(columns);
  if (unit) return *unit;
  if (sample.empty()) return are_floating ? TimeUnit::seconds : TimeUnit::microseconds;
  unit = sample.find_unit(columns, false);
  if (!unit)
    throw UnsupportedFormat("the time unit of the HDF5 dataset " + path +
                            " is ambiguous; set time-unit, or name the times t_s, t_us or t_ns");
  return *unit;
}

std::uint64_t NumberTable::row_before(Microseconds t) {
  // Treats unreadable rows as late, so that no event is skipped.
  return first_row(rows_, [&](std::uint64_t row) {
    const auto time = time_at(row);
    return time && *time < t;
  });
}

std::optional<Microseconds> NumberTable::time_at(std::uint64_t row) {
  Microseconds t = 0;
  const auto number = row < rows_ ? time_number(row) : std::nullopt;
  if (!number || __builtin_add_overflow(unwrapped(row, *number), offset_, &t)) return std::nullopt;
  return t;
}

Microseconds NumberTable::unwrapped(std::uint64_t row, std::int64_t number) {
  if (!wraps_) return number;
  if (samples_.empty()) read_samples();
  auto clock = std::prev(std::ranges::upper_bound(samples_, row, {}, &Sample::row))->clock;
  return clock.follow(static_cast<std::uint32_t>(number));
}

/// Time of a row as stored in the file.
std::optional<std::int64_t> NumberTable::time_number(std::uint64_t row) {
  std::vector<std::int64_t> numbers;
  if (!t_dataset().read(row, 1, numbers)) return std::nullopt;
  return numbers[t_column()];
}

/// Samples the clock along the file. Samples must be less than half a wrap, 35 minutes, apart.
void NumberTable::read_samples() {
  constexpr std::uint64_t max_samples = 256;
  const auto steps = std::clamp<std::uint64_t>(rows_, 2, max_samples) - 1;
  Clock clock;
  samples_.push_back({0, clock});
  for (std::uint64_t i = 0; i <= steps; ++i) {
    const auto row = i < steps ? i * (rows_ / steps) : rows_ - 1;
    const auto number = time_number(row);
    if (!number) continue;
    clock.follow(static_cast<std::uint32_t>(*number));
    samples_.push_back({row, clock});
  }
}

}  // namespace eventcamera
