// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/recording_survey.hpp"

#include <algorithm>
#include <limits>

namespace eventcamera {

namespace {

/// Limit of the survey at the start of a file, in bytes.
constexpr std::uint64_t max_surveyed_bytes = std::uint64_t{1} << 24;
/// Limits of held items, in bytes of memory (4 million events) and in time.
constexpr std::size_t max_held = std::size_t{1} << 26;
constexpr Microseconds max_hold = 1'000'000;

}  // namespace

RecordingSurvey::Stream& RecordingSurvey::at(std::size_t index) {
  while (streams_.size() <= index) streams_.push_back({.chunker = Chunker(sample_length_)});
  return streams_[index];
}

bool RecordingSurvey::read(RecordingInput& input) {
  while (!is_enough(input)) {
    const auto item = next(input);
    if (!item && !input.is_finished()) return false;
    if (!item) break;
    input.hold(*item);
  }
  // The next items may be the first events.
  while (!has_events_ && !input.decoder().knows_all_streams() && next(input)) has_moved_ = true;
  const bool is_whole = input.is_finished();
  if (is_whole) finish(input.decoder());
  finish_short_streams(input.decoder());
  const auto last = input.decoder().last_time();
  has_moved_ |= find_first_items(input);
  if (input.source().failed()) return false;
  learn_duration(last, is_whole, input);
  return true;
}

std::optional<Item> RecordingSurvey::next(RecordingInput& input) {
  const auto item = input.next();
  if (item) take(*item);
  return item;
}

/// Reads the first items of streams that begin later, where the file states where. True if it did.
bool RecordingSurvey::find_first_items(RecordingInput& input) {
  bool has_moved = false;
  for (std::size_t i = 0; i < input.decoder().streams().size(); ++i) {
    const auto kind = input.decoder().streams()[i].kind;
    if (!is_shown(kind) || stream(i).first) continue;
    const auto start = input.decoder().first_of(i);
    if (!start) continue;
    input.restart(start);
    has_moved = true;
    while (!stream(i).first && input.position() - start->position < max_surveyed_bytes &&
           next(input))
      continue;
    if (kind == StreamKind::events) finish(i);
  }
  return has_moved;
}

/// True if there is no need to read more: too much was read, or sizes, origin and duration are
/// known.
bool RecordingSurvey::is_enough(RecordingInput& input) {
  if (input.held_size() >= max_held || input.position() >= max_surveyed_bytes) return true;
  const bool sizes_known =
      std::ranges::all_of(input.decoder().streams(), [](const StreamInfo& stream) {
        return stream.kind != StreamKind::events || stream.size.width > 0;
      });
  const auto last =
      sizes_known && is_origin_known(input) ? input.decoder().last_time() : std::nullopt;
  return last && *last < Chunker::max_time;
}

bool RecordingSurvey::is_origin_known(const RecordingInput& input) {
  if (input.held_size() >= max_held) return true;
  const auto& known = input.decoder().streams();
  bool awaited = false;
  auto first = std::numeric_limits<Microseconds>::max();
  auto last = std::numeric_limits<Microseconds>::min();
  for (std::size_t i = 0; i < known.size(); ++i) {
    const auto& surveyed = stream(i);
    if (!surveyed.first) {
      awaited |= is_shown(known[i].kind) && input.decoder().end_of(i, Chunker::max_time) != 0;
      continue;
    }
    const bool of_events = known[i].kind == StreamKind::events;
    if (of_events && known[i].size.width <= 0) {
      // All bytes are there: hold on, to guess from as many events as possible.
      if (input.is_finished()) return false;
      awaited |= !surveyed.is_sampled;
    }
    first = std::min(first, *surveyed.first);
    last = std::max(last, of_events ? *surveyed.latest : *surveyed.first);
  }
  return last >= first && (!awaited || last - first >= max_hold);
}

void RecordingSurvey::note(const EventItem& item) {
  auto& surveyed = at(item.stream);
  surveyed.used.include(item.events);
  surveyed.chunker.push(item.events);
  while (surveyed.chunker.next()) surveyed.is_sampled = true;
  surveyed.first = surveyed.chunker.first();
  if (surveyed.first) surveyed.latest = surveyed.chunker.latest();
  has_events_ |= surveyed.first.has_value();
}

void RecordingSurvey::note(const FrameItem& item) {
  auto& surveyed = at(item.stream);
  const auto t = item.frame.t;
  if (!Chunker::is_time(t)) return;
  surveyed.first = std::min(surveyed.first.value_or(t), t);
  surveyed.latest = std::max(surveyed.latest.value_or(t), t);
  if (!surveyed.first_frame) surveyed.first_frame = item.frame;
}

void RecordingSurvey::finish(const Decoder& decoder) {
  for (std::size_t i = 0; i < decoder.streams().size(); ++i)
    if (decoder.streams()[i].kind == StreamKind::events) finish(i);
}

/// Finishes streams of events with too few of them to tell the first.
void RecordingSurvey::finish_short_streams(const Decoder& decoder) {
  for (std::size_t i = 0; i < decoder.streams().size(); ++i)
    if (decoder.streams()[i].kind == StreamKind::events && !stream(i).first) finish(i);
}

void RecordingSurvey::finish(std::size_t index) {
  at(index).chunker.finish();
  note(EventItem{index, {}});
}

std::optional<Microseconds> RecordingSurvey::origin() const {
  std::optional<Microseconds> origin;
  for (const auto& surveyed : streams_)
    if (surveyed.first) origin = std::min(origin.value_or(*surveyed.first), *surveyed.first);
  return origin;
}

/// `stated` is the time of the last item if the file states it. Otherwise the duration follows from
/// the surveyed part, exactly if that `is_whole`.
void RecordingSurvey::learn_duration(std::optional<Microseconds> stated, bool is_whole,
                                     const RecordingInput& input) {
  const auto start = origin().value_or(0);
  auto last = start - 1;
  for (const auto& surveyed : streams_) last = std::max(last, surveyed.latest.value_or(last));
  const auto length = last + 1 - start;
  const bool is_stated = stated && *stated >= start && *stated < Chunker::max_time;
  duration_is_exact_ = is_stated || is_whole;
  if (is_stated) {
    duration_ = *stated + 1 - start;
  } else if (is_whole) {
    duration_ = length;
  } else if (!input.reads_itself()) {
    const auto position = input.position();
    const auto scale = static_cast<double>(std::max(input.source().size(), position)) /
                       static_cast<double>(std::max<std::uint64_t>(position, 1));
    duration_ = static_cast<Microseconds>(
        std::min(static_cast<double>(length) * scale, static_cast<double>(Chunker::max_time)));
  }
}

}  // namespace eventcamera
