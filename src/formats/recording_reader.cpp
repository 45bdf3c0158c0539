// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/recording_reader.hpp"

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <utility>

namespace eventcamera {

namespace {

/// Limit of the survey at the start of a file, in bytes.
constexpr std::uint64_t max_surveyed_bytes = std::uint64_t{1} << 24;
/// Limits of held items, in bytes of memory (4 million events) and in time.
constexpr std::size_t max_held = std::size_t{1} << 26;
constexpr Microseconds max_hold = 1'000'000;
/// A stream lagging by more than this is treated as silent.
constexpr Microseconds max_lag = 500'000;
/// Minimum length of a gap of such a stream. Queues of a second do not fill before.
constexpr Microseconds min_gap = 250'000;
/// Wrap period of the EVT3 clock, the shortest of all; those of the other formats are multiples of
/// it.
constexpr Microseconds clock_range = Microseconds{1} << 24;
constexpr Microseconds always = std::numeric_limits<Microseconds>::min();

bool is_shown(StreamKind kind) {
  return kind == StreamKind::events || kind == StreamKind::frames;
}

bool is_time(Microseconds t) {
  return t >= -Chunker::max_time && t <= Chunker::max_time;
}

}  // namespace

RecordingReader::RecordingReader(MakeDecoder make_decoder, Microseconds chunk_length, Clock clock)
    : make_decoder_(std::move(make_decoder)),
      chunk_length_(chunk_length),
      clock_(clock),
      decoder_(make_decoder_()) {
  learn_streams();
  if (clock_ == Clock::file) return;
  begun_ = true;
  for (auto& stream : streams_) show(stream);
}

/* input */

void RecordingReader::push(std::span<const std::uint8_t> bytes, std::optional<Interval> interval) {
  const auto lock = reading();
  decoder_->push(bytes);
  interval_ = interval;
  finished_ = finishing_ = drained_ = false;
}

void RecordingReader::finish() {
  const auto lock = reading();
  decoder_->finish();
  finished_ = true;
}

void RecordingReader::discard() {
  const auto lock = reading();
  while (decoder_->next()) continue;
}

void RecordingReader::interrupt() {
  finished_ = finishing_ = drained_ = false;
  shift_.reset();
  for (auto& stream : streams_) start_chunker(stream);
  next_stream_ = 0;
  newest_ = 0;
  triggers_.clear();
  imu_samples_.clear();
}

bool RecordingReader::reach(Microseconds t) {
  auto& chunker = streams_.front().chunker;
  if (shift_) chunker.reach(t - *shift_);
  next_stream_ = 0;
  return chunker.first().has_value();
}

/// Next item from the held items, else from the decoder.
std::optional<Item> RecordingReader::next_item() {
  if (begun_ && held_next_ < held_.size()) {
    const auto& held = held_[held_next_++];
    if (held.frame) return FrameItem{held.stream, *held.frame};
    if (!held.triggers.empty()) return TriggerItem{held.stream, held.triggers};
    if (!held.imu_samples.empty()) return ImuItem{held.stream, held.imu_samples};
    return EventItem{held.stream, held.events};
  }
  if (begun_) held_.clear();
  held_next_ = 0;
  while (true) {
    if (const auto item = read_item()) return item;
    if (source_ == nullptr || finished_) return std::nullopt;
    if (reads_itself_) {
      finished_ = !source_->failed();
      return std::nullopt;
    }
    const auto piece = source_->piece(position_);
    if (!piece) return std::nullopt;
    position_ += piece->size();
    if (piece->empty())
      finish();
    else
      push(*piece);
  }
}

std::optional<Item> RecordingReader::read_item() {
  const auto lock = reading();
  const auto item = decoder_->next();
  learn_streams();
  return item;
}

void RecordingReader::learn_streams() {
  const auto& known = decoder_->streams();
  for (std::size_t i = 0; i < std::min(known.size(), streams_.size()); ++i) {
    if (known[i].kind != streams_[i].info.kind)
      throw std::runtime_error("the file changed while it was read: its streams are different now");
    // Some formats state the size only after their first bytes.
    streams_[i].info.mirrored = known[i].mirrored;
    streams_[i].info.labelled = known[i].labelled;
    if (streams_[i].size_from == SizeFrom::file && known[i].size != SensorSize{})
      streams_[i].info.size = known[i].size;
  }
  for (auto i = streams_.size(); i < known.size(); ++i) {
    const auto kind = known[i].kind;
    const auto number = std::ranges::count_if(
        streams_, [kind](const Stream& other) { return other.info.kind == kind; });
    streams_.push_back({.info = known[i],
                        .number = static_cast<unsigned>(number),
                        .position = start_,
                        .first = {},
                        .latest = {},
                        .first_frame = {},
                        .chunker = Chunker(chunk_length_)});
  }
}

/* the start of a file */

/// Reads ahead to find the origin, the duration and sizes not stated in the file. What is read is
/// held, unless output starts elsewhere. False if bytes cannot be read.
bool RecordingReader::survey() {
  {
    const auto lock = reading();
    decoder_ = make_decoder_();
    reads_itself_ = decoder_->open(*source_);
  }
  streams_.clear();
  position_ = 0;
  start_due_ = finished_ = false;
  held_.clear();
  held_size_ = 0;
  while (!is_surveyed()) {
    const auto item = survey_item();
    if (!item && !finished_) return false;
    if (!item) break;
    hold(*item);
  }
  const bool has_read_on = find_events();
  if (finished_) finish_chunkers();
  const bool is_whole = finished_;
  const auto last = decoder_->last_time();
  const bool has_moved = find_first_items();
  if (source_->failed()) return false;
  begin();
  learn_duration(last, is_whole);
  if (start_ > 0 || has_read_on || has_moved)
    restart(seek_point_before(start_), start_, stop_);
  else
    begin_segment(start_, stop_);
  return true;
}

std::optional<Item> RecordingReader::survey_item() {
  const auto item = next_item();
  if (item) std::visit([this](const auto& some) { note(some); }, *item);
  return item;
}

/// Reads on to the first events if the file may have some. True if it read anything.
bool RecordingReader::find_events() {
  const auto has_events = [](const Stream& stream) {
    return stream.info.kind == StreamKind::events && stream.first;
  };
  bool has_read = false;
  while (!decoder_->knows_all_streams() && std::ranges::none_of(streams_, has_events) &&
         survey_item())
    has_read = true;
  return has_read;
}

/// Reads the first items of streams that begin later, where the file states where. True if it did.
bool RecordingReader::find_first_items() {
  bool has_moved = false;
  for (std::size_t i = 0; i < streams_.size(); ++i) {
    if (!is_shown(streams_[i].info.kind) || streams_[i].first) continue;
    const auto start = decoder_->first_of(i);
    if (!start) continue;
    {
      const auto lock = reading();
      decoder_->restart(*start);
    }
    has_moved = true;
    finished_ = false;
    position_ = start->position;
    while (!streams_[i].first && position_ - start->position < max_surveyed_bytes && survey_item())
      continue;
    if (streams_[i].info.kind != StreamKind::events) continue;
    streams_[i].chunker.finish();
    note(EventItem{i, {}});
  }
  return has_moved;
}

bool RecordingReader::is_surveyed() const {
  if (held_size_ >= max_held || position_ >= max_surveyed_bytes) return true;
  const bool sizes_known = std::ranges::all_of(streams_, [](const Stream& stream) {
    return stream.info.kind != StreamKind::events || stream.info.size.width > 0;
  });
  const auto last = sizes_known && is_origin_known() ? decoder_->last_time() : std::nullopt;
  return last && *last < Chunker::max_time;
}

void RecordingReader::note(const EventItem& item) {
  auto& stream = streams_[item.stream];
  stream.used.include(item.events);
  // The chunker rejects erroneous times.
  stream.chunker.push(item.events);
  while (stream.chunker.next()) stream.is_sampled = true;
  stream.first = stream.chunker.first();
  if (stream.first) stream.latest = stream.chunker.latest();
}

void RecordingReader::note(const FrameItem& item) {
  auto& stream = streams_[item.stream];
  const auto t = item.frame.t;
  if (!is_time(t)) return;
  stream.first = std::min(stream.first.value_or(t), t);
  stream.latest = std::max(stream.latest.value_or(t), t);
  if (!stream.first_frame) stream.first_frame = item.frame;
}

void RecordingReader::hold(const Item& item) {
  if (const auto* const events = std::get_if<EventItem>(&item)) {
    held_.push_back({events->stream, {events->events.begin(), events->events.end()}, {}, {}});
    held_size_ += sizeof(HeldItem) + events->events.size_bytes();
  } else if (const auto* const some = std::get_if<FrameItem>(&item)) {
    const auto& frame = some->frame;
    auto& held = held_.emplace_back(HeldItem{
        some->stream, {}, frame, {frame.pixels, frame.pixels + frame.height * frame.stride}});
    held.frame->pixels = held.pixels.data();
    held_size_ += sizeof(HeldItem) + held.pixels.size();
  } else if (const auto* const triggers = std::get_if<TriggerItem>(&item)) {
    const auto all = triggers->triggers;
    held_.push_back({triggers->stream, {}, {}, {}, {all.begin(), all.end()}});
    held_size_ += sizeof(HeldItem) + all.size_bytes();
  } else if (const auto* const imu = std::get_if<ImuItem>(&item)) {
    const auto all = imu->samples;
    held_.push_back({imu->stream, {}, {}, {}, {}, {all.begin(), all.end()}});
    held_size_ += sizeof(HeldItem) + all.size_bytes();
  }
}

/// True if enough is known to begin: the first time of every stream, and enough events to guess
/// unknown sensor sizes.
bool RecordingReader::is_origin_known() const {
  if (held_size_ >= max_held) return true;
  bool awaited = false;
  auto first = std::numeric_limits<Microseconds>::max();
  auto last = always;
  for (std::size_t i = 0; i < streams_.size(); ++i) {
    const auto& stream = streams_[i];
    if (!stream.first) {
      awaited |= is_shown(stream.info.kind) && !decoder_->is_empty(i);
      continue;
    }
    const bool of_events = stream.info.kind == StreamKind::events;
    if (of_events && stream.info.size.width <= 0) {
      // All bytes are there: hold on, to guess from as many events as possible.
      if (finished_) return false;
      awaited |= !stream.is_sampled;
    }
    first = std::min(first, *stream.first);
    last = std::max(last, of_events ? *stream.latest : *stream.first);
  }
  return last >= first && (!awaited || last - first >= max_hold);
}

/// Makes the earliest time of all streams the origin, and shows the streams.
void RecordingReader::begin() {
  std::optional<Microseconds> origin;
  for (const auto& stream : streams_)
    if (stream.first) origin = std::min(origin.value_or(*stream.first), *stream.first);
  {
    const auto lock = reading();
    origin_ = origin.value_or(0);
  }
  begun_ = true;
  for (auto& stream : streams_) {
    const bool is_stream_of_events = stream.info.kind == StreamKind::events &&
                                     (stream.info.size != SensorSize{} || streams_.size() == 1);
    if ((is_shown(stream.info.kind) && stream.first) || is_stream_of_events) show(stream);
  }
  if (!start_due_) throw UnsupportedFormat("the file has neither events nor frames");
}

/// `told` is the time of the last item if the file states it. Otherwise the duration follows from
/// the surveyed part, exactly if that `is_whole`.
void RecordingReader::learn_duration(std::optional<Microseconds> told, bool is_whole) {
  auto last = origin_ - 1;
  for (const auto& stream : streams_) last = std::max(last, stream.latest.value_or(last));
  const auto surveyed = last + 1 - origin_;
  const bool is_told = told && *told >= origin_ && *told < Chunker::max_time;
  duration_is_exact_ = is_told || is_whole;
  if (is_told) {
    duration_ = *told + 1 - origin_;
  } else if (is_whole) {
    duration_ = surveyed;
  } else if (!reads_itself_) {
    const auto scale = static_cast<double>(std::max(source_->size(), position_)) /
                       static_cast<double>(std::max<std::uint64_t>(position_, 1));
    duration_ = static_cast<Microseconds>(
        std::min(static_cast<double>(surveyed) * scale, static_cast<double>(Chunker::max_time)));
  }
}

/* seeking */

std::optional<SeekPoint> RecordingReader::seek_point_before(Microseconds start) const {
  const auto lock = reading();
  return decoder_->seek_point_before(start > 0 ? origin_ + start : always);
}

void RecordingReader::seek(Microseconds start, std::optional<Microseconds> stop) {
  start_ = start;
  stop_ = stop;
  if (begun_) restart(seek_point_before(start), start, stop);
}

void RecordingReader::restart(const std::optional<SeekPoint>& seek_point, Microseconds start,
                              std::optional<Microseconds> stop) {
  {
    const auto lock = reading();
    if (seek_point) {
      decoder_->restart(*seek_point);
      before_ = decoder_->corruption();
    } else {
      decoder_ = make_decoder_();
      if (source_ != nullptr) reads_itself_ = decoder_->open(*source_);
      before_ = {};
    }
  }
  position_ = seek_point ? seek_point->position : 0;
  finished_ = false;
  held_.clear();
  held_size_ = 0;
  begin_segment(start, stop);
}

/// Prepares for items at `start` or later: those held, and those that the decoder reads next.
void RecordingReader::begin_segment(Microseconds start, std::optional<Microseconds> stop) {
  start_ = newest_ = start;
  stop_ = stop;
  finishing_ = drained_ = false;
  held_next_ = next_stream_ = 0;
  output_due_.reset();
  triggers_.clear();
  imu_samples_.clear();
  counts_ = {};
  for (auto& stream : streams_) {
    stream.position = start;
    stream.outside = 0;
    stream.chunker =
        begun_ ? Chunker(chunk_length_, origin_ + start, origin_) : Chunker(chunk_length_);
  }
}

/* output */

void RecordingReader::show(Stream& stream) {
  stream.shown = true;
  start_due_ = true;
  if (stream.info.kind != StreamKind::events) return;
  if (stream.info.size.width <= 0 || stream.info.size.height <= 0) {
    stream.extent = stream.used.extent(stream.used.within() / 1000);
    stream.info.size = sensor_with(stream.extent, stream.info.mirrored);
    stream.size_from = SizeFrom::assumption;
    stream.is_implausible = stream.used.are_implausible(decoder_->corruption().outside);
  }
  start_chunker(stream);
}

/// Chunks begin at the start of the segment, except that those of words, and of the stream that
/// defines the origin, begin at the first event.
void RecordingReader::start_chunker(Stream& stream) {
  const bool from_first_event =
      clock_ == Clock::stream || (start_ == 0 && (!begun_ || stream.first == origin_));
  stream.chunker =
      from_first_event ? Chunker(chunk_length_) : Chunker(chunk_length_, origin_ + start_, origin_);
}

std::optional<RecordingReader::Output> RecordingReader::next() {
  if (source_ != nullptr && !begun_ && !survey()) return std::nullopt;
  while (true) {
    if (const auto output = next_output()) return output;
    if (drained_ || is_past_stop()) return std::nullopt;
    if (const auto item = next_item()) {
      if (begun_) {
        std::visit([this](const auto& some) { take(some); }, *item);
      } else {
        std::visit([this](const auto& some) { note(some); }, *item);
        hold(*item);
        if (is_origin_known()) begin();
      }
    } else if (!finished_) {
      return std::nullopt;
    } else if (!begun_) {
      finish_chunkers();
      begin();
    } else if (!std::exchange(finishing_, true)) {
      finish_chunkers();
    } else if (const auto output = next_accompanying(Chunker::max_time)) {
      return output;
    } else {
      drained_ = true;
      if (!stop_ && newest_ > start_ && !std::exchange(duration_is_exact_, true))
        duration_ = newest_;
    }
  }
}

/// Next output that needs no further items.
std::optional<RecordingReader::Output> RecordingReader::next_output() {
  if (std::exchange(start_due_, false)) return Start{};
  if (!begun_) return std::nullopt;
  if (!output_due_)
    if (const auto chunk = next_chunk()) output_due_ = *chunk;
  if (const auto* const chunk = output_due_ ? std::get_if<Chunk>(&*output_due_) : nullptr)
    if (const auto before = next_accompanying(chunk->start + chunk->duration)) return before;
  return std::exchange(output_due_, std::nullopt);
}

/// Triggers or IMU samples before `end`, in time since the origin.
std::optional<RecordingReader::Output> RecordingReader::next_accompanying(Microseconds end) {
  if (const auto triggers = taken_before(end, triggers_); !triggers.empty()) {
    counts_.triggers += triggers.size();
    return TriggerItem{0, triggers};
  }
  if (const auto samples = taken_before(end, imu_samples_); !samples.empty()) {
    counts_.imu_samples += samples.size();
    return ImuItem{0, samples};
  }
  return std::nullopt;
}

/// Items before `end` and within the segment, with times since the origin.
template <class Sample>
std::span<const Sample> RecordingReader::taken_before(Microseconds end,
                                                      WaitingItems<Sample>& waiting) {
  const auto shift = shift_.value_or(0) - origin_;
  const auto items = waiting.take_before(end - shift);
  for (auto& item : items) item.t += shift;
  const auto first =
      start_ > 0 ? std::ranges::lower_bound(items, start_, {}, &Sample::t) : items.begin();
  const auto last = stop_ ? std::ranges::lower_bound(items, *stop_, {}, &Sample::t) : items.end();
  return first < last ? std::span<const Sample>(first, last) : std::span<const Sample>();
}

void RecordingReader::take(const EventItem& item) {
  if (item.events.empty()) return;
  auto& stream = streams_[item.stream];
  if (!stream.shown) {
    stream.used.include(item.events);
    show(stream);
  }
  auto events = item.events;
  if (stream.size_from != SizeFrom::file &&
      std::ranges::any_of(events, is_outside(stream.info.size))) {
    if (stream.size_from == SizeFrom::assumption) grow(stream, events);
    within_.assign(events.begin(), events.end());
    stream.outside += std::erase_if(within_, is_outside(stream.info.size));
    events = within_;
  }
  if (stream.info.mirrored) {
    const auto size = stream.info.size;
    if (events.data() != within_.data()) within_.assign(events.begin(), events.end());
    for (auto& event : within_) {
      const auto turned =
          Event::at(size.width - 1 - event.x, size.height - 1 - event.y(), 0, event.polarity());
      event.x = turned.x;
      event.y_p = turned.y_p;
    }
    events = within_;
  }
  if (clock_ == Clock::stream && !shift_ && interval_) set_shift(item.events.front().t);
  stream.chunker.keep_labels(stream.info.labelled);
  stream.chunker.push(events);
  next_stream_ = 0;
}

/// Lets an assumed size grow with the events, other than a few far out.
void RecordingReader::grow(Stream& stream, std::span<const AbsoluteEvent> events) {
  UsedPixels used;
  used.include(events);
  stream.extent = used.extent(std::max<std::size_t>(1, events.size() / 100), stream.extent);
  stream.info.size = sensor_with(stream.extent, stream.info.mirrored);
}

void RecordingReader::take(const FrameItem& item) {
  auto& stream = streams_[item.stream];
  const auto t = item.frame.t;
  if (!is_time(t)) {
    ++counts_.stray;
    return;
  }
  if (!stream.shown) {
    stream.first_frame = item.frame;
    show(stream);
  }
  if (t < origin_) {
    ++counts_.late;
    return;
  }
  const auto time = t - origin_;
  if (time < start_ || !advance(stream, time, time)) return;
  ++counts_.frames;
  output_due_ = TimedFrame{item.stream, time, item.frame};
}

void RecordingReader::take(const TriggerItem& item) {
  counts_.stray += triggers_.push(item.triggers);
}

void RecordingReader::take(const ImuItem& item) {
  counts_.stray += imu_samples_.push(item.samples);
}

/// Shifts the clock of words to that of their interval. If the two differ only by wraps of the
/// words' clock, event times are preserved exactly.
void RecordingReader::set_shift(Microseconds first) {
  first = std::clamp(first, -Chunker::max_time, Chunker::max_time);
  const auto start = interval_->start;
  const auto into = ((first - start) % clock_range + clock_range) % clock_range;
  shift_ = start + (into <= interval_->duration ? into : 0) - first;
}

std::optional<RecordingReader::Chunk> RecordingReader::next_chunk() {
  if (const auto gap = next_gap()) return gap;
  for (; next_stream_ < streams_.size(); ++next_stream_)
    if (const auto chunk = next_chunk(next_stream_)) return chunk;
  return std::nullopt;
}

std::optional<RecordingReader::Chunk> RecordingReader::next_chunk(std::size_t index) {
  auto& stream = streams_[index];
  if (!stream.shown) return std::nullopt;
  while (const auto interval = stream.chunker.next()) {
    Chunk chunk{index, interval->start - origin_ + shift_.value_or(0), interval->duration,
                interval->events, interval->labels};
    cut_at_stop(chunk);
    const auto end = chunk.start + chunk.duration;
    if (chunk.events.empty()) {
      // Part of it may have been returned as a gap.
      chunk.start = std::max(chunk.start, stream.position);
      chunk.duration = end - chunk.start;
      if (chunk.duration <= 0) continue;
    }
    if (!advance(stream, chunk.start, end)) continue;
    counts_.events += chunk.events.size();
    return chunk;
  }
  return std::nullopt;
}

/// A gap in a stream that lags far behind the newest item, so that others need not wait for it
/// long; before it, the events that wait. Its later items are still returned: the streams of some
/// files are written one after the other.
std::optional<RecordingReader::Chunk> RecordingReader::next_gap() {
  const auto silent_until = newest_ - std::max(max_lag, chunk_length_);
  for (std::size_t i = 0; i < streams_.size(); ++i) {
    auto& stream = streams_[i];
    if (!stream.shown || silent_until - stream.position < min_gap) continue;
    stream.chunker.pause(origin_ + silent_until);
    if (const auto chunk = next_chunk(i)) return chunk;
    const auto start = stream.position;
    if (silent_until > start && advance(stream, start, silent_until))
      return Chunk{i, start, silent_until - start, {}};
  }
  return std::nullopt;
}

/// Clips a chunk at the end of the segment.
void RecordingReader::cut_at_stop(Chunk& chunk) const {
  if (!stop_ || chunk.start + chunk.duration <= *stop_) return;
  chunk.duration = std::max<Microseconds>(*stop_ - chunk.start, 0);
  const auto end = std::ranges::partition_point(
      chunk.events, [&](const Event& event) { return event.t < chunk.duration; });
  chunk.events = {chunk.events.begin(), end};
  if (!chunk.labels.empty()) chunk.labels = chunk.labels.first(chunk.events.size());
}

/// Records that a stream was returned up to `end`. False if `start` is past the segment.
bool RecordingReader::advance(Stream& stream, Microseconds start, Microseconds end) {
  stream.position = std::max(stream.position, end);
  newest_ = std::max(newest_, std::min(end, stop_.value_or(end)));
  return !stop_ || start < *stop_;
}

bool RecordingReader::is_past_stop() const {
  if (!stop_ || !begun_) return false;
  for (std::size_t i = 0; i < streams_.size(); ++i)
    if (streams_[i].shown && streams_[i].position < *stop_ && !decoder_->is_empty(i)) return false;
  return true;
}

void RecordingReader::finish_chunkers() {
  for (auto& stream : streams_) {
    if (stream.info.kind != StreamKind::events || (begun_ && !stream.shown)) continue;
    stream.chunker.finish();
    if (!begun_) note(EventItem{static_cast<std::size_t>(&stream - streams_.data()), {}});
  }
  next_stream_ = 0;
}

RecordingReader::Counts RecordingReader::counts() const {
  Counts counts = counts_;
  const auto& corruption = decoder_->corruption();
  counts.corrupt_places = corruption.places - before_.places;
  counts.outside = corruption.outside - before_.outside;
  counts.skipped = corruption.skipped - before_.skipped;
  for (const auto& stream : streams_) {
    counts.outside += stream.outside;
    if (!begun_) continue;
    const auto& dropped = stream.chunker.dropped();
    counts.late += dropped.late;
    counts.stray += dropped.stray;
  }
  return counts;
}

}  // namespace eventcamera
