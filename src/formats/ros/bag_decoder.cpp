// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/ros/bag_decoder.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "src/formats/chunker.hpp"
#include "src/formats/magic.hpp"
#include "src/formats/ros/bag_file.hpp"
#include "src/formats/ros/topic_decoder.hpp"

namespace eventcamera {

namespace {

constexpr std::size_t max_listed = 8;

/// A file format, and the first bytes of its files.
struct Format {
  std::string_view magic;
  const char* name;
  std::unique_ptr<BagFile> (*make)(BagFile::AddTopic add_topic);
};

constexpr Format formats[] = {
    {mcap_magic, "MCAP", make_mcap_file},
    {rosbag_magic, "ROS bag 2.0", make_rosbag_file},
    {sqlite_magic, "ROS 2 bag with SQLite", make_db3_file},
};

constexpr std::size_t magic_bytes = 16;

/// Maximum change of the difference between a time and the recording of its message, relative to
/// the first message: from recording delays, and hours of drift of the sensor's clock.
constexpr Microseconds max_jitter = 1'000'000;

std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t i = 0; i < std::min(names.size(), max_listed); ++i)
    text += (i == 0 ? "" : ", ") + names[i];
  return names.size() > max_listed
             ? text + " and " + std::to_string(names.size() - max_listed) + " more"
             : text;
}

class BagDecoder final : public Decoder {
 public:
  explicit BagDecoder(std::string topics) {
    std::erase(topics, ' ');
    if (!topics.empty()) wanted_ = "," + topics + ",";
  }

  void push(std::span<const std::uint8_t> piece) override {
    if (file_) {
      file_->push(piece);
      return;
    }
    start_.insert(start_.end(), piece.begin(), piece.end());
    if (start_.size() < magic_bytes) return;
    choose_format(start_);
    file_->push(start_);
  }

  void drain() override {
    finished_ = true;
    if (!file_) choose_format(start_);
    file_->finish();
  }

  bool open(ByteSource& source) override {
    source_ = &source;
    std::array<std::uint8_t, magic_bytes> start = {};
    const auto count = source.read(0, start);
    if (!count) return false;
    choose_format(std::span(start).first(*count));
    return file_->open(source);
  }

  std::optional<Item> next() override {
    if (!file_) return std::nullopt;
    while (true) {
      if (decoding_) {
        if (auto item = next_part()) return item;
        decoding_.reset();
      }
      const auto message = file_->next();
      if (!message) break;
      decoding_ = message->topic;
      logged_ = message->logged;
      topics_[*decoding_]->begin(*message);
      streams_[*decoding_].size = topics_[*decoding_]->size();
    }
    if (finished_) require_topics();
    return std::nullopt;
  }

  const std::vector<StreamInfo>& streams() const override { return streams_; }

  const Corruption& corruption() const override {
    static const Corruption none;
    return file_ ? file_->corruption() : none;
  }

  std::optional<SeekPoint> seek_point_before(Microseconds t) const override {
    constexpr auto always = std::numeric_limits<Microseconds>::min();
    if (!file_) return std::nullopt;
    if (t == always || !delay_) return file_->seek_point_before(always);
    return file_->seek_point_before(std::clamp(t, -Chunker::max_time, Chunker::max_time) + *delay_ -
                                    max_jitter);
  }

  void restart(const SeekPoint& seek_point) override {
    file_->restart(seek_point);
    for (auto& topic : topics_) topic->restart();
    decoding_.reset();
    events_due_ = false;
  }

  std::optional<Microseconds> last_time() override {
    if (delay_ && std::exchange(last_time_due_, false)) last_time_ = decoded_last_time();
    return last_time_;
  }

  bool knows_all_streams() const override {
    if (!file_) return false;
    if (file_->last_logged()) return true;
    const auto commas = static_cast<std::size_t>(std::ranges::count(wanted_, ','));
    return !wanted_.empty() && streams_.size() + 1 >= commas;
  }

  std::optional<SeekPoint> first_of(std::size_t stream) const override {
    return file_ ? file_->first_of(stream) : std::nullopt;
  }

  std::string format_name() const override { return format_name_; }

  UnreadStreams unread_streams() const override {
    if (unread_.empty()) return {};
    return {.names = "topics " + listed(unread_), .property = "topics"};
  }

 private:
  /// Throws UnsupportedFormat if no known format starts with `start`.
  void choose_format(std::span<const std::uint8_t> start) {
    const auto* const found = std::ranges::find_if(
        formats, [&](const Format& format) { return has_at(0, format.magic, start); });
    if (found == std::end(formats)) throw UnsupportedFormat("this is not a ROS bag");
    format_name_ = found->name;
    file_ = found->make([this](const BagTopic& topic) { return add_topic(topic); });
  }

  std::optional<std::size_t> add_topic(const BagTopic& topic) {
    const auto kind = kind_of_messages(topic);
    if (kind == StreamKind::other || !is_wanted(topic, kind)) {
      auto& names = kind == StreamKind::other ? others_ : unread_;
      constexpr std::size_t max_names = 1000;
      if (names.size() < max_names && std::ranges::find(names, topic.name) == names.end())
        names.push_back(topic.name);
      return std::nullopt;
    }
    // Several publishers of a topic share its stream.
    const auto known = std::ranges::find_if(streams_, [&](const StreamInfo& stream) {
      return stream.source == topic.name && stream.kind == kind;
    });
    if (known != streams_.end()) return static_cast<std::size_t>(known - streams_.begin());
    constexpr std::size_t max_streams = 64;
    if (streams_.size() == max_streams) return std::nullopt;
    streams_.push_back(
        {.id = static_cast<int>(streams_.size()), .kind = kind, .size = {}, .source = topic.name});
    topics_.push_back(make_topic_decoder(topic, file_->corruption()));
    const auto offset = clock_offsets_.find(topic.name);
    if (offset != clock_offsets_.end()) topics_.back()->set_clock_offset(offset->second);
    return streams_.size() - 1;
  }

  bool is_wanted(const BagTopic& topic, StreamKind kind) const {
    if (!wanted_.empty()) return wanted_.find("," + topic.name + ",") != std::string::npos;
    return kind == StreamKind::frames ||
           std::ranges::all_of(streams_, [&](const StreamInfo& stream) {
             return stream.kind != StreamKind::events || stream.source == topic.name;
           });
  }

  /// The next part of the message being decoded that has something in it.
  std::optional<Item> next_part() {
    auto& decoder = *topics_[*decoding_];
    const auto& [events, triggers] = decoder.decoded();
    while (true) {
      if (std::exchange(events_due_, false)) {
        learn_delay(events.front().t);
        return EventItem{*decoding_, events};
      }
      if (!decoder.next()) return std::nullopt;
      if (const auto& frame = decoder.frame()) {
        learn_delay(frame->t);
        return FrameItem{*decoding_, *frame};
      }
      events_due_ = !events.empty();
      if (!triggers.empty()) return TriggerItem{*decoding_, triggers};
    }
  }

  void learn_delay(Microseconds t) {
    if (!delay_) delay_ = logged_ - std::clamp(t, -Chunker::max_time, Chunker::max_time);
  }

  /// Throws UnsupportedFormat if the file ended without a topic to read.
  void require_topics() const {
    if (!streams_.empty()) return;
    std::string found = "the bag has no topic ";
    found += wanted_.empty()
                 ? "with events or images"
                 : "\"" + wanted_.substr(1, wanted_.size() - 2) + "\" with events or images";
    auto names = unread_;
    names.insert(names.end(), others_.begin(), others_.end());
    throw UnsupportedFormat(names.empty() ? found : found + "; it has " + listed(names));
  }

  /// Decodes the end of the file, because a bag states only when its messages were recorded.
  std::optional<Microseconds> decoded_last_time() {
    const auto logged = file_->last_logged();
    if (source_ == nullptr || !logged) return std::nullopt;
    std::string names;
    for (const auto& stream : streams_) names += stream.source + ",";
    BagDecoder tail(names);
    for (std::size_t i = 0; i < streams_.size(); ++i)
      if (const auto offset = topics_[i]->clock_offset())
        tail.clock_offsets_[streams_[i].source] = *offset;
    const bool reads_itself = tail.open(*source_);
    if (tail.file_ == nullptr) return std::nullopt;  // reading was stopped
    const auto start = tail.file_->seek_point_before(*logged);
    if (!start) return std::nullopt;
    tail.file_->restart(*start);

    std::vector<Chunker> times;  // reject erroneous times
    std::optional<Microseconds> last;
    const auto read_items = [&] {
      while (const auto item = tail.next()) {
        const auto* const some = std::get_if<EventItem>(&*item);
        const auto* const frame = std::get_if<FrameItem>(&*item);
        times.resize(tail.streams_.size(), Chunker(1));
        if (some != nullptr) {
          times[some->stream].push(some->events);
          while (times[some->stream].next()) continue;
        }
        if (frame != nullptr && frame->frame.t < Chunker::max_time)
          last = std::max(last.value_or(frame->frame.t), frame->frame.t);
      }
    };
    constexpr std::uint64_t max_read = std::uint64_t{1} << 26;
    constexpr std::uint64_t max_piece = std::uint64_t{1} << 18;
    std::vector<std::uint8_t> bytes(reads_itself ? 0 : std::min(max_piece, source_->size()));
    const auto end = start->position + max_read;
    for (auto position = start->position; !reads_itself && position < end;) {
      const auto count = source_->read(position, bytes);
      if (!count || *count == 0) break;
      position += *count;
      tail.push(std::span(bytes).first(*count));
      read_items();
    }
    if (reads_itself) read_items();
    for (auto& stream : times) {
      stream.finish();
      if (stream.first()) last = std::max(last.value_or(stream.latest()), stream.latest());
    }
    return last;
  }

  std::string wanted_;  ///< with a comma before and after each name; empty: not chosen
  std::string format_name_;
  std::vector<std::uint8_t> start_;  ///< first bytes, until the format is known
  std::unique_ptr<BagFile> file_;    ///< null until then
  ByteSource* source_ = nullptr;     ///< set by open()
  std::vector<StreamInfo> streams_;
  std::vector<std::unique_ptr<TopicDecoder>> topics_;   ///< one a stream
  std::map<std::string, std::uint64_t> clock_offsets_;  ///< that topics begin with, by name
  std::vector<std::string> unread_;                     ///< names of topics with events or images
  std::vector<std::string> others_;                     ///< names of all other topics

  std::optional<std::size_t> decoding_;  ///< topic of the message being decoded
  bool events_due_ = false;              ///< its decoder has events to be returned
  Microseconds logged_ = 0;              ///< time of its recording
  std::optional<Microseconds> delay_;    ///< from the time of a message to its recording
  bool finished_ = false;
  bool last_time_due_ = true;  ///< last_time_ was not determined yet
  std::optional<Microseconds> last_time_;
};

}  // namespace

std::unique_ptr<Decoder> make_bag_decoder(std::string topics) {
  return std::make_unique<BagDecoder>(std::move(topics));
}

}  // namespace eventcamera
