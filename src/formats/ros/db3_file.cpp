// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/ros/db3_file.hpp"

#include <limits>
#include <utility>

#include "src/formats/ros/sqlite_database.hpp"
#include "src/formats/unsupported_format.hpp"

namespace eventcamera {

namespace {

constexpr const char* all_messages =
    "SELECT id, topic_id, timestamp, data FROM messages WHERE id >= ? ORDER BY id";
constexpr const char* message_after =
    "SELECT id, timestamp FROM messages WHERE id >= ? ORDER BY id LIMIT 1";
constexpr const char* first_message_of =
    "SELECT id FROM messages WHERE topic_id = ? ORDER BY id LIMIT 1";
constexpr const char* last_message = "SELECT id, timestamp FROM messages ORDER BY id DESC LIMIT 1";
constexpr std::int64_t before_all = std::numeric_limits<std::int64_t>::min();

}  // namespace

Db3File::Db3File(AddTopic add_topic) : BagFile(std::move(add_topic)) {}
Db3File::~Db3File() = default;

void Db3File::finish() {
  if (database_) return;
  own_bytes_ = collected_.take();
  database_ = std::make_unique<SqliteDatabase>(*own_bytes_);
  read_topics();
}

bool Db3File::open(ByteSource& source) {
  database_ = std::make_unique<SqliteDatabase>(source);
  is_opened_ = true;
  read_topics();
  return true;
}

void Db3File::read_topics() {
  constexpr std::size_t max_topics = 4096;
  if (!database_->has_table("topics") || !database_->has_table("messages"))
    throw UnsupportedFormat(
        "this SQLite database is not a ROS 2 bag: it has no ordinary tables topics and messages");
  auto rows =
      database_->query("SELECT id, name, type, serialization_format FROM topics ORDER BY id");
  // Counts rows: a few pages could refer to each other for ever.
  for (std::size_t count = 0; count < max_topics && rows.next(); ++count) {
    BagTopic topic{rows.text(1), ros1_type(rows.text(2)), {}};
    if (rows.text(3) == "cdr") topic.serialization = RosSerialization::cdr;
    const auto id = rows.integer(0);
    topics_[id] = add(topic, 0);
  }
  auto first = database_->query(message_after, before_all);
  if (first.next()) first_id_ = first.integer(0);
  auto last = database_->query(last_message);
  if (last.next()) {
    last_id_ = last.integer(0);
    last_logged_ = last.integer(1) / 1000;
  }
  if (rows.failed() || first.failed() || last.failed())
    corruption_.note(0, "a database with a corrupt page");
  read_from(before_all);
}

void Db3File::read_from(std::int64_t id) {
  messages_ = std::make_unique<SqliteRows>(database_->query(all_messages, id));
  last_read_.reset();
}

std::optional<BagMessage> Db3File::next() {
  while (messages_ && messages_->next()) {
    const auto id = messages_->integer(0);
    if (last_read_ && id <= *last_read_) {  // a few pages could refer to each other for ever
      corruption_.note(0, "a database with a page in two places");
      messages_.reset();
      break;
    }
    last_read_ = id;
    const auto topic = topics_.find(messages_->integer(1));
    if (topic == topics_.end()) corruption_.note(0, "a message without a topic");
    if (topic == topics_.end() || !topic->second) continue;
    const auto logged = messages_->integer(2) / 1000;
    if (const auto content = content_of(messages_->blob(3)))
      return BagMessage{*topic->second, logged, *content, 0};
    corruption_.note(0, "a message that does not decompress");
  }
  if (messages_ && messages_->failed()) {
    corruption_.note(0, "a database with a corrupt page");
    messages_.reset();
  }
  return std::nullopt;
}

/// Recorders can compress each message with Zstandard, which its first bytes show.
std::optional<std::span<const std::uint8_t>> Db3File::content_of(
    std::span<const std::uint8_t> data) {
  constexpr std::size_t max_message = std::size_t{1} << 27;
  if (!begins_frame(FrameCodec::zstd, data)) return data;
  const auto content = decompressor_.decompress(FrameCodec::zstd, data, max_message);
  if (!content) return std::nullopt;
  return content->bytes;
}

/// Searches by halves: IDs rise with the times of recording.
std::optional<SeekPoint> Db3File::seek_point_before(Microseconds logged) const {
  if (!is_opened_) return std::nullopt;
  auto earlier = first_id_;
  auto later = last_id_;
  while (earlier < later) {
    const auto middle = earlier + static_cast<std::int64_t>((static_cast<std::uint64_t>(later) -
                                                             static_cast<std::uint64_t>(earlier)) /
                                                            2);
    auto rows = database_->query(message_after, middle);
    if (!rows.next() || rows.integer(1) / 1000 >= logged)
      later = middle;
    else
      earlier = middle + 1;
  }
  return SeekPoint{.t = logged, .position = static_cast<std::uint64_t>(earlier)};
}

std::optional<SeekPoint> Db3File::first_of(std::size_t topic) const {
  std::optional<SeekPoint> first;
  if (!is_opened_) return first;
  for (const auto& [id, known] : topics_) {
    if (known != topic) continue;
    auto rows = database_->query(first_message_of, id);
    if (!rows.next()) continue;
    const auto position = static_cast<std::uint64_t>(rows.integer(0));
    if (!first || position < first->position)
      first = SeekPoint{.t = before_all, .position = position};
  }
  return first;
}

void Db3File::restart(const SeekPoint& seek_point) {
  read_from(static_cast<std::int64_t>(seek_point.position));
}

}  // namespace eventcamera
