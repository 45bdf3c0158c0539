// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/recording_reader.hpp"

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <type_traits>
#include <utility>

#include "src/formats/corruption.hpp"

namespace eventcamera {

namespace {

/// A stream lagging by more than this is treated as silent.
constexpr Microseconds max_lag = 500'000;
/// Minimum length of a gap in such a stream; shorter than the second that queues hold.
constexpr Microseconds min_gap = 250'000;
/// Wrap period of the EVT3 clock, the shortest of all; other formats have multiples of it.
constexpr Microseconds clock_range = Microseconds{1} << 24;
constexpr Microseconds always = std::numeric_limits<Microseconds>::min();

/// Limit of the survey at the start of a file, in bytes.
constexpr std::uint64_t max_surveyed_bytes = std::uint64_t{1} << 24;
/// Limits of held items, in bytes of memory (4 million events) and in time.
constexpr std::size_t max_held = std::size_t{1} << 26;
constexpr Microseconds max_hold = 1'000'000;
/// Minimum surveyed and maximum sorted size of a table's held items, in bytes (16 million events).
constexpr std::size_t min_surveyed_rows = std::size_t{1} << 20;
constexpr std::size_t max_sorted = std::size_t{1} << 28;
/// Sorted events returned at once.
constexpr std::size_t sorted_block = std::size_t{1} << 12;

/// True for kinds of streams with a pad of their own; other items accompany events.
constexpr bool is_shown(StreamKind kind) {
  return kind == StreamKind::events || kind == StreamKind::frames;
}

/// Copies the content of an item to `memory`, and lets the item refer to it.
template <class Some>
void copy_content(Some& item, std::vector<std::byte>& memory) {
  auto& [stream, content] = item;
  const auto bytes = std::as_bytes(content);
  memory.assign(bytes.begin(), bytes.end());
  using Element = typename std::remove_reference_t<decltype(content)>::element_type;
  content = {reinterpret_cast<Element*>(memory.data()), content.size()};
}

void copy_content(FrameItem& item, std::vector<std::byte>& memory) {
  auto& frame = item.frame;
  const auto* const pixels = reinterpret_cast<const std::byte*>(frame.pixels);
  memory.assign(pixels, pixels + frame.height * frame.stride);
  frame.pixels = reinterpret_cast<const std::uint8_t*>(memory.data());
}

UnsupportedFormat not_sorted(const Chunker::Disorder& disorder) {
  return UnsupportedFormat(
      "its events are not sorted by time: " + std::to_string(disorder.dropped) + " of " +
      std::to_string(disorder.rows) + " are more than 10 ms out of order, the first near row " +
      std::to_string(disorder.row) +
      ". Sort its rows by time; a file of up to 16 million events that filesrc reads is sorted "
      "without that");
}

}  // namespace

/* bytes and items */

void RecordingReader::Input::push(std::span<const std::uint8_t> bytes) {
  const auto guard = lock();
  decoder_->push(bytes);
  position_ += bytes.size();
  is_finished_ = false;
}

void RecordingReader::Input::finish() {
  const auto guard = lock();
  decoder_->drain();
  is_finished_ = true;
}

std::optional<Item> RecordingReader::Input::decode() {
  const auto guard = lock();
  return decoder_->next();
}

std::optional<Item> RecordingReader::Input::next() {
  if (replayed_) {
    if (*replayed_ < held_.size()) return held_[(*replayed_)++].item;
    if (!sorted_) clear_held();
  }
  if (sorted_) {
    const auto block = std::span(*sorted_).subspan(returned_).first(
        std::min(sorted_->size() - returned_, sorted_block));
    returned_ += block.size();
    is_finished_ = block.empty();
    if (is_finished_) return std::nullopt;
    return EventItem{0, block};
  }
  while (true) {
    if (const auto item = decode()) return item;
    if (source_ == nullptr || is_finished_) return std::nullopt;
    if (reads_itself_) {
      is_finished_ = !source_->failed();
      return std::nullopt;
    }
    const auto piece = source_->piece(position_);
    if (!piece) return std::nullopt;
    if (piece->empty())
      finish();
    else
      push(*piece);
  }
}

void RecordingReader::Input::discard() {
  while (decode()) continue;
}

void RecordingReader::Input::hold(Item item) {
  std::vector<std::byte> memory;
  std::visit([&](auto& some) { copy_content(some, memory); }, item);
  held_size_ += sizeof(Held) + memory.size();
  held_.push_back({item, std::move(memory)});
}

void RecordingReader::Input::sort_held() {
  sorted_.emplace();
  for (auto& [item, memory] : held_) {
    const auto* const some = std::get_if<EventItem>(&item);
    if (some == nullptr) continue;
    sorted_->insert(sorted_->end(), some->events.begin(), some->events.end());
    memory = {};
  }
  std::erase_if(held_,
                [](const Held& held) { return std::holds_alternative<EventItem>(held.item); });
  std::ranges::stable_sort(*sorted_, {}, &AbsoluteEvent::t);
}

void RecordingReader::Input::clear_held() {
  held_.clear();
  held_size_ = 0;
  replayed_.reset();
}

void RecordingReader::Input::restart(const std::optional<SeekPoint>& seek_point) {
  const auto guard = lock();
  is_finished_ = false;
  if (sorted_) {
    replayed_ = returned_ = 0;
    return;
  }
  if (seek_point) {
    decoder_->restart(*seek_point);
  } else {
    decoder_ = make_decoder_();
    if (source_ != nullptr) reads_itself_ = decoder_->open(*source_);
  }
  position_ = seek_point ? seek_point->position : 0;
  clear_held();
}

std::optional<SeekPoint> RecordingReader::Input::seek_point_before(Microseconds t) const {
  const auto guard = lock();
  return decoder_->seek_point_before(t);
}

RecordingReader::RecordingReader(MakeDecoder make_decoder, Microseconds chunk_length, Clock clock)
    : input_(std::move(make_decoder)), chunk_length_(chunk_length), clock_(clock) {
  learn_streams();
  if (clock_ == Clock::file) return;
  begun_ = true;
  for (std::size_t i = 0; i < streams_.size(); ++i) show(i);
}

void RecordingReader::push(std::span<const std::uint8_t> bytes, std::optional<Interval> interval) {
  input_.push(bytes);
  interval_ = interval;
  finishing_ = drained_ = false;
}

void RecordingReader::interrupt() {
  input_.restart(SeekPoint{.t = always, .position = input_.position()});
  begin_times();
}

void RecordingReader::begin_times() {
  input_.expect_more();
  shift_.reset();
  for (auto& stream : streams_) start_chunker(stream);
  forget_output(0);
}

/// Continues with output from `start` on.
void RecordingReader::forget_output(Microseconds start) {
  finishing_ = drained_ = false;
  next_stream_ = 0;
  newest_ = start;
  output_due_.reset();
  triggers_.clear();
  imu_samples_.clear();
}

void RecordingReader::advance_to(Microseconds t) {
  auto& chunker = streams_.front().chunker;
  if (shift_) chunker.advance_to(t - *shift_);
  next_stream_ = 0;
}

std::optional<Item> RecordingReader::next_item() {
  const auto item = input_.next();
  learn_streams();
  return item;
}

void RecordingReader::learn_streams() {
  const auto& known = input_.decoder().streams();
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
                        .chunker = Chunker(chunk_length_)});
  }
}

/* the start of a file */

/// Pull mode: reads the start of the file, up to 16 MiB or 4 million events, and holds its items.
/// Finds streams that begin later by the file's index or, without one, by reading on until there
/// are events. False if bytes cannot be read.
bool RecordingReader::survey() {
  input_.restart(std::nullopt);
  streams_.clear();
  start_due_ = false;
  learn_streams();
  while (!is_surveyed()) {
    const auto item = survey_next();
    if (!item && !input_.is_finished()) return false;
    if (!item) break;
    input_.hold(*item);
  }
  const auto has_begun = [](const Stream& stream) {
    return stream.info.kind == StreamKind::events && stream.first;
  };
  // The next items may be the first events.
  bool has_moved = false;
  while (!input_.decoder().knows_all_streams() && std::ranges::none_of(streams_, has_begun) &&
         survey_next())
    has_moved = true;
  const bool is_whole = input_.is_finished();
  for (auto& stream : streams_)
    if (is_whole || !stream.first) finish_survey(stream);
  if (const auto found = disorder()) {
    if (!is_whole) throw not_sorted(*found);
    sort_events();
  }
  const auto last = is_sorted() ? std::nullopt : input_.decoder().last_time();
  has_moved |= find_first_items();
  if (input_.source().failed()) return false;
  learn_duration(last, is_whole);
  begin();
  if (start_ > 0 || has_moved)
    restart(seek_point_before(start_), start_, stop_);
  else
    begin_segment(start_, stop_);
  return true;
}

/// Disorder of a table that was not sorted yet.
std::optional<Chunker::Disorder> RecordingReader::disorder() const {
  const bool may_be = input_.decoder().is_table() && !input_.is_sorted() && !streams_.empty();
  return may_be ? streams_.front().chunker.disorder() : std::nullopt;
}

/// Sorts the events of a table that was surveyed as a whole, and surveys them again.
void RecordingReader::sort_events() {
  input_.sort_held();
  auto& stream = streams_.front();
  stream.used = {};
  stream.chunker = Chunker(chunk_length_);
  input_.restart(std::nullopt);
  while (survey_next()) continue;
  finish_survey(stream);
  input_.restart(std::nullopt);
}

/// True if there is no need to read more: too much was read, or sizes, origin and duration are
/// known.
bool RecordingReader::is_surveyed() {
  if (disorder()) return input_.held_size() >= max_sorted;
  if (input_.decoder().is_table() && input_.held_size() < min_surveyed_rows) return false;
  if (input_.held_size() >= max_held || input_.position() >= max_surveyed_bytes) return true;
  const bool sizes_known = std::ranges::all_of(streams_, [](const Stream& stream) {
    return stream.info.kind != StreamKind::events || stream.info.size.width > 0;
  });
  const auto last = sizes_known && is_origin_known() ? input_.decoder().last_time() : std::nullopt;
  return last && *last < Chunker::max_time;
}

/// True if enough is known to begin: the first time of every stream, and enough events to guess
/// unknown sensor sizes.
bool RecordingReader::is_origin_known() const {
  if (input_.held_size() >= max_held) return true;
  bool awaited = false;
  auto first = std::numeric_limits<Microseconds>::max();
  auto last = std::numeric_limits<Microseconds>::min();
  for (std::size_t i = 0; i < streams_.size(); ++i) {
    const auto& stream = streams_[i];
    if (!stream.first) {
      awaited |= is_shown(stream.info.kind) && input_.decoder().end_of(i, Chunker::max_time) != 0;
      continue;
    }
    const bool of_events = stream.info.kind == StreamKind::events;
    if (of_events && stream.info.size.width <= 0) {
      // The file was read to its end: guess from as many events as possible.
      if (input_.is_finished()) return false;
      awaited |= !stream.is_sampled;
    }
    first = std::min(first, *stream.first);
    last = std::max(last, of_events ? *stream.latest : *stream.first);
  }
  return last >= first && (!awaited || last - first >= max_hold);
}

/// Earliest time of all streams.
std::optional<Microseconds> RecordingReader::earliest() const {
  std::optional<Microseconds> earliest;
  for (const auto& stream : streams_)
    if (stream.first) earliest = std::min(earliest.value_or(*stream.first), *stream.first);
  return earliest;
}

std::optional<Item> RecordingReader::survey_next() {
  const auto item = next_item();
  if (item) std::visit([this](const auto& some) { survey(some); }, *item);
  return item;
}

void RecordingReader::survey(const EventItem& item) {
  auto& stream = streams_[item.stream];
  stream.used.include(item.events);
  stream.chunker.push(item.events);
  while (stream.chunker.next()) stream.is_sampled = true;
  stream.first = stream.chunker.first();
  if (stream.first) stream.latest = stream.chunker.latest();
}

void RecordingReader::survey(const FrameItem& item) {
  auto& stream = streams_[item.stream];
  const auto t = item.frame.t;
  if (!Chunker::is_time(t)) return;
  stream.first = std::min(stream.first.value_or(t), t);
  stream.latest = std::max(stream.latest.value_or(t), t);
  if (!stream.first_frame) stream.first_frame = item.frame;
}

/// Declares the end of a stream's events.
void RecordingReader::finish_survey(Stream& stream) {
  if (stream.info.kind != StreamKind::events) return;
  stream.chunker.finish();
  survey(EventItem{static_cast<std::size_t>(&stream - streams_.data()), {}});
}

/// Reads the first items of streams that begin later, where the file states where. True if it did.
bool RecordingReader::find_first_items() {
  bool has_moved = false;
  for (std::size_t i = 0; i < streams_.size(); ++i) {
    if (!is_shown(streams_[i].info.kind) || streams_[i].first) continue;
    const auto start = input_.decoder().first_of(i);
    if (!start) continue;
    input_.restart(start);
    has_moved = true;
    while (!streams_[i].first && input_.position() - start->position < max_surveyed_bytes &&
           survey_next())
      continue;
    finish_survey(streams_[i]);
  }
  return has_moved;
}

/// `stated` is the time of the last item if the file states it. Otherwise the duration follows from
/// the surveyed part, exactly if that `is_whole`.
void RecordingReader::learn_duration(std::optional<Microseconds> stated, bool is_whole) {
  const auto start = earliest().value_or(0);
  auto last = start - 1;
  for (const auto& stream : streams_) last = std::max(last, stream.latest.value_or(last));
  const auto length = last + 1 - start;
  const bool is_stated = stated && *stated >= start && *stated < Chunker::max_time;
  duration_is_exact_ = is_stated || is_whole;
  duration_.reset();
  if (is_stated) {
    duration_ = *stated + 1 - start;
  } else if (is_whole) {
    duration_ = length;
  } else if (!input_.reads_itself()) {
    const auto position = input_.position();
    const auto scale = static_cast<double>(std::max(input_.source().size(), position)) /
                       static_cast<double>(std::max<std::uint64_t>(position, 1));
    duration_ = static_cast<Microseconds>(
        std::min(static_cast<double>(length) * scale, static_cast<double>(Chunker::max_time)));
  }
}

/// Makes the earliest time of all streams the origin, and shows the streams.
void RecordingReader::begin() {
  origin_ = earliest().value_or(0);
  begun_ = true;
  input_.replay();
  for (std::size_t i = 0; i < streams_.size(); ++i) {
    const auto& info = streams_[i].info;
    const bool is_stream_of_events =
        info.kind == StreamKind::events && (info.size != SensorSize{} || streams_.size() == 1);
    streams_[i].chunker = Chunker(chunk_length_);
    if ((is_shown(info.kind) && streams_[i].first) || is_stream_of_events) show(i);
  }
  if (!start_due_) throw UnsupportedFormat("the file has neither events nor frames");
}

/* seeking */

std::optional<SeekPoint> RecordingReader::seek_point_before(Microseconds start) const {
  return input_.seek_point_before(start > 0 ? origin_ + start : always);
}

void RecordingReader::seek(Microseconds start, std::optional<Microseconds> stop) {
  start_ = start;
  stop_ = stop;
  if (begun_) restart(seek_point_before(start), start, stop);
}

void RecordingReader::restart(const std::optional<SeekPoint>& seek_point, Microseconds start,
                              std::optional<Microseconds> stop) {
  input_.restart(seek_point);
  before_ = seek_point ? input_.decoder().corruption() : Corruption{};
  begin_segment(start, stop);
}

/// Prepares for items at `start` or later.
void RecordingReader::begin_segment(Microseconds start, std::optional<Microseconds> stop) {
  start_ = start;
  stop_ = stop;
  forget_output(start);
  counts_ = {};
  for (std::size_t i = 0; i < streams_.size(); ++i) {
    auto& stream = streams_[i];
    stream.position = start;
    stream.end = begun_ && stop ? input_.decoder().end_of(i, origin_ + *stop) : std::nullopt;
    stream.outside = 0;
    stream.chunker =
        begun_ ? Chunker(chunk_length_, origin_ + start, origin_) : Chunker(chunk_length_);
    if (begun_) continue;
    stream.first = stream.latest = std::nullopt;
    stream.first_frame.reset();
    stream.used = {};
    stream.is_sampled = false;
  }
}

/* output */

void RecordingReader::show(std::size_t index) {
  auto& stream = streams_[index];
  stream.shown = true;
  start_due_ = true;
  if (stream.info.kind != StreamKind::events) return;
  if (stream.info.size.width <= 0 || stream.info.size.height <= 0) {
    stream.extent = stream.used.extent(stream.used.within() / 1000);
    stream.info.size = sensor_with(stream.extent, stream.info.mirrored);
    stream.size_from = SizeFrom::assumption;
    stream.is_implausible = stream.used.are_implausible(corruption().outside);
  }
  start_chunker(stream);
}

/// Chunks begin at the start of the segment, except that chunks of words, and of the stream that
/// defines the origin, begin at the first event.
void RecordingReader::start_chunker(Stream& stream) {
  const bool from_first_event =
      clock_ == Clock::stream || (start_ == 0 && (!begun_ || stream.first == origin()));
  stream.chunker =
      from_first_event ? Chunker(chunk_length_) : Chunker(chunk_length_, origin_ + start_, origin_);
}

std::optional<RecordingReader::Output> RecordingReader::next() {
  if (input_.is_pulling() && !begun_ && !survey()) return std::nullopt;
  while (true) {
    if (const auto output = next_output()) return output;
    if (drained_ || is_past_stop()) return std::nullopt;
    if (const auto item = begun_ ? next_item() : survey_next()) {
      if (begun_) {
        std::visit([this](const auto& some) { add(some); }, *item);
        if (const auto found = disorder()) throw not_sorted(*found);
      } else {
        input_.hold(*item);
        if (is_origin_known()) begin();
      }
    } else if (!input_.is_finished()) {
      return std::nullopt;
    } else if (!begun_) {
      for (auto& stream : streams_) finish_survey(stream);
      if (const auto found = disorder()) throw not_sorted(*found);
      begin();
    } else if (!std::exchange(finishing_, true)) {
      finish_chunkers();
      if (const auto found = disorder()) throw not_sorted(*found);
    } else if (const auto output = next_accompanying(after_all_items)) {
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
  if (const auto* const chunk = output_due_ ? std::get_if<Chunk>(&*output_due_) : nullptr) {
    if (const auto before = next_accompanying(chunk->start + chunk->duration)) return before;
  } else if (triggers_.is_full() || imu_samples_.is_full()) {
    if (const auto early = next_accompanying(after_all_items)) return early;
  }
  return std::exchange(output_due_, std::nullopt);
}

/// Triggers or IMU samples before `end`, in time since the origin.
std::optional<RecordingReader::Output> RecordingReader::next_accompanying(Microseconds end) {
  if (const auto triggers = samples_before(end, triggers_); !triggers.empty()) {
    counts_.triggers += triggers.size();
    return TriggerItem{0, triggers};
  }
  if (const auto samples = samples_before(end, imu_samples_); !samples.empty()) {
    counts_.imu_samples += samples.size();
    return ImuItem{0, samples};
  }
  return std::nullopt;
}

/// Items before `end` and within the segment, with times since the origin.
template <class Sample>
std::span<const Sample> RecordingReader::samples_before(Microseconds end,
                                                        WaitingItems<Sample>& waiting) {
  const auto shift = shift_.value_or(0) - origin_;
  const auto items = waiting.pop_before(end - shift);
  for (auto& item : items) item.t += shift;
  const auto first =
      start_ > 0 ? std::ranges::lower_bound(items, start_, {}, &Sample::t) : items.begin();
  const auto last = stop_ ? std::ranges::lower_bound(items, *stop_, {}, &Sample::t) : items.end();
  return first < last ? std::span<const Sample>(first, last) : std::span<const Sample>();
}

void RecordingReader::add(const EventItem& item) {
  if (item.events.empty()) return;
  auto& stream = streams_[item.stream];
  if (!stream.shown) {
    stream.used.include(item.events);
    show(item.stream);
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

/// Enlarges an assumed size for the events, except a few far out.
void RecordingReader::grow(Stream& stream, std::span<const AbsoluteEvent> events) {
  UsedPixels used;
  used.include(events);
  stream.extent = used.extent(std::max<std::size_t>(1, events.size() / 100), stream.extent);
  stream.info.size = sensor_with(stream.extent, stream.info.mirrored);
}

void RecordingReader::add(const FrameItem& item) {
  auto& stream = streams_[item.stream];
  const auto t = item.frame.t;
  if (!Chunker::is_time(t)) {
    ++counts_.stray;
    return;
  }
  if (!stream.shown) {
    stream.first_frame = item.frame;
    show(item.stream);
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

void RecordingReader::add(const TriggerItem& item) {
  counts_.stray += triggers_.push(item.triggers);
}

void RecordingReader::add(const ImuItem& item) {
  counts_.stray += imu_samples_.push(item.samples);
}

/// Shifts the clock of words to the clock of their interval. If the two differ only by wraps of the
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

/// Returns a gap in a stream that has ended, or that lags far behind the newest item, so that
/// others do not wait long for it; its waiting events precede the gap. Later items of a lagging
/// stream are still returned: some files store their streams one after the other.
std::optional<RecordingReader::Chunk> RecordingReader::next_gap() {
  for (std::size_t i = 0; i < streams_.size(); ++i) {
    auto& stream = streams_[i];
    if (!stream.shown) continue;
    const bool has_ended = stream.end && input_.has_passed(*stream.end);
    const auto until = has_ended ? *stop_ : newest_ - std::max(max_lag, chunk_length_);
    if (until - stream.position < (has_ended ? 1 : min_gap)) continue;
    stream.chunker.pause(origin_ + until);
    if (const auto chunk = next_chunk(i)) return chunk;
    const auto start = stream.position;
    if (until <= start || (!has_ended && !advance(stream, start, until))) continue;
    stream.position = until;
    return Chunk{i, start, until - start, {}};
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
  return std::ranges::all_of(streams_, [this](const Stream& stream) {
    return !stream.shown || stream.position >= *stop_;
  });
}

void RecordingReader::finish_chunkers() {
  for (auto& stream : streams_)
    if (stream.shown && stream.info.kind == StreamKind::events) stream.chunker.finish();
  next_stream_ = 0;
}

RecordingReader::Counts RecordingReader::counts() const {
  Counts counts = counts_;
  counts.corrupt_places = corruption().places - before_.places;
  counts.outside = corruption().outside - before_.outside;
  counts.skipped = corruption().skipped - before_.skipped;
  for (const auto& stream : streams_) {
    counts.outside += stream.outside;
    if (!begun_) continue;
    const auto dropped = stream.chunker.dropped();
    counts.late += dropped.late;
    counts.stray += dropped.stray;
  }
  return counts;
}

}  // namespace eventcamera
