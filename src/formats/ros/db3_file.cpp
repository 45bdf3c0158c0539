// SPDX-License-Identifier: LGPL-2.1-or-later
#include <sqlite3.h>

#include <algorithm>
#include <cstdint>
#include <ctime>
#include <limits>
#include <map>
#include <memory>
#include <new>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "src/formats/byte_source.hpp"
#include "src/formats/compression/compressed_frames.hpp"
#include "src/formats/corruption.hpp"
#include "src/formats/ros/bag_file.hpp"

namespace eventcamera {

namespace {

/// Limit of a value in the database, bytes.
constexpr int max_value = 1 << 27;
/// Steps of SQLite's virtual machine between two checks of the time.
constexpr int steps_between_looks = 1000;
/// CPU time after which a query that has found no further row is interrupted, nanoseconds.
constexpr std::int64_t max_time = 200'000'000;

/// CPU time of this thread, so that neither a busy machine nor a slow disk interrupts a query.
std::int64_t cpu_time() {
  timespec now = {};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

/// SQLite file object that reads from a ByteSource.
struct SourceFile {
  sqlite3_file base;  // must be first
  ByteSource* bytes;
};

/// Source of the database that this thread is opening.
thread_local ByteSource* opening = nullptr;

int read(sqlite3_file* file, void* to, int count, sqlite3_int64 position) {
  const std::span out(static_cast<std::uint8_t*>(to), static_cast<std::size_t>(count));
  const auto read =
      reinterpret_cast<SourceFile*>(file)->bytes->read(static_cast<std::uint64_t>(position), out);
  if (!read) return SQLITE_IOERR_READ;
  std::ranges::fill(out.subspan(*read), 0);
  return *read == out.size() ? SQLITE_OK : SQLITE_IOERR_SHORT_READ;
}

int size_of(sqlite3_file* file, sqlite3_int64* size) {
  *size = static_cast<sqlite3_int64>(reinterpret_cast<SourceFile*>(file)->bytes->size());
  return SQLITE_OK;
}

int is_unlocked(sqlite3_file*, int* result) {
  *result = 0;
  return SQLITE_OK;
}

const sqlite3_io_methods methods = {
    .iVersion = 1,
    .xClose = [](sqlite3_file*) { return SQLITE_OK; },
    .xRead = read,
    .xWrite = [](sqlite3_file*, const void*, int, sqlite3_int64) { return SQLITE_READONLY; },
    .xTruncate = [](sqlite3_file*, sqlite3_int64) { return SQLITE_READONLY; },
    .xSync = [](sqlite3_file*, int) { return SQLITE_OK; },
    .xFileSize = size_of,
    .xLock = [](sqlite3_file*, int) { return SQLITE_OK; },
    .xUnlock = [](sqlite3_file*, int) { return SQLITE_OK; },
    .xCheckReservedLock = is_unlocked,
    .xFileControl = [](sqlite3_file*, int, void*) { return SQLITE_NOTFOUND; },
    .xSectorSize = [](sqlite3_file*) { return 4096; },
    .xDeviceCharacteristics = [](sqlite3_file*) { return SQLITE_IOCAP_IMMUTABLE; },
    .xShmMap = nullptr,
    .xShmLock = nullptr,
    .xShmBarrier = nullptr,
    .xShmUnmap = nullptr,
    .xFetch = nullptr,
    .xUnfetch = nullptr,
};

int open_file(sqlite3_vfs*, const char*, sqlite3_file* file, int flags, int* out_flags) {
  file->pMethods = nullptr;
  if (opening == nullptr || (flags & SQLITE_OPEN_MAIN_DB) == 0) return SQLITE_CANTOPEN;
  auto& opened = *reinterpret_cast<SourceFile*>(file);
  opened.base.pMethods = &methods;
  opened.bytes = opening;
  if (out_flags != nullptr) *out_flags = flags;
  return SQLITE_OK;
}

/// Registers, once, an SQLite file system whose only file is `opening`, and returns its name.
const char* file_system() {
  static sqlite3_vfs system = [] {
    sqlite3_initialize();
    auto made = *sqlite3_vfs_find(nullptr);  // its clock and random numbers
    made.iVersion = 1;
    made.szOsFile = sizeof(SourceFile);
    made.pNext = nullptr;
    made.zName = "gst-eventsim-bytes";
    made.xOpen = open_file;
    made.xDelete = [](sqlite3_vfs*, const char*, int) { return SQLITE_READONLY; };
    made.xAccess = [](sqlite3_vfs*, const char*, int, int* result) {
      *result = 0;
      return SQLITE_OK;
    };
    made.xFullPathname = [](sqlite3_vfs*, const char* name, int size, char* out) {
      sqlite3_snprintf(size, out, "%s", name);
      return SQLITE_OK;
    };
    return made;
  }();
  static const int registered = sqlite3_vfs_register(&system, 0);
  return registered == SQLITE_OK ? system.zName : nullptr;
}

/// Lets queries read tables and list their columns, and nothing else.
int authorize(void*, int action, const char* name, const char*, const char*, const char*) {
  const bool lists = action == SQLITE_PRAGMA && name == std::string_view("table_xinfo");
  return lists || action == SQLITE_SELECT || action == SQLITE_READ ? SQLITE_OK : SQLITE_DENY;
}

/// Rows of a query, valid as long as the database.
class SqliteRows {
 public:
  /// `start` is set to the CPU time at the last row.
  SqliteRows(sqlite3* database, const char* text, std::int64_t parameter, std::int64_t& start)
      : start_(start) {
    start_ = cpu_time();
    sqlite3_stmt* statement = nullptr;
    failed_ = sqlite3_prepare_v2(database, text, -1, &statement, nullptr) != SQLITE_OK;
    statement_.reset(statement);
    if (!failed_ && sqlite3_bind_parameter_count(statement) > 0)
      sqlite3_bind_int64(statement, 1, parameter);
  }

  /// Goes to the next row, the first at first. False at the end, and if the database is corrupt.
  bool next() {
    if (failed_ || !statement_) return false;
    start_ = cpu_time();
    const auto result = sqlite3_step(statement_.get());
    failed_ = result != SQLITE_ROW && result != SQLITE_DONE;
    if (result != SQLITE_ROW) statement_.reset();
    return result == SQLITE_ROW;
  }

  /// True if the query ended early.
  bool failed() const { return failed_; }

  std::int64_t integer(int column) const { return sqlite3_column_int64(statement_.get(), column); }

  std::string text(int column) const {
    const auto bytes = blob(column);
    return {bytes.begin(), bytes.end()};
  }

  /// Valid until next().
  std::span<const std::uint8_t> blob(int column) const {
    const auto* const bytes =
        static_cast<const std::uint8_t*>(sqlite3_column_blob(statement_.get(), column));
    const auto count = sqlite3_column_bytes(statement_.get(), column);
    if (bytes == nullptr) return {};
    return {bytes, static_cast<std::size_t>(count)};
  }

 private:
  struct Deleter {
    void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
  };

  std::unique_ptr<sqlite3_stmt, Deleter> statement_;
  std::int64_t& start_;
  bool failed_ = false;
};

/// Reads an SQLite database from any source of bytes. The file may be hostile: its views, virtual
/// tables, triggers and functions are not run, and a query that takes too long to find a row fails.
class SqliteDatabase {
 public:
  /// `bytes` must outlive this object. Throws UnsupportedFormat if it is no database.
  explicit SqliteDatabase(ByteSource& bytes) {
    const auto* const system = file_system();
    sqlite3* opened = nullptr;
    opening = &bytes;
    // Immutable: no journal is looked for.
    const auto result = sqlite3_open_v2(
        "file:bag?immutable=1", &opened,
        SQLITE_OPEN_READONLY | SQLITE_OPEN_URI | SQLITE_OPEN_NOMUTEX | SQLITE_OPEN_PRIVATECACHE,
        system);
    database_.reset(opened);
    if (result == SQLITE_OK) {
      sqlite3_db_config(opened, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
      sqlite3_db_config(opened, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
      sqlite3_db_config(opened, SQLITE_DBCONFIG_ENABLE_VIEW, 0, nullptr);
      sqlite3_drop_modules(opened, nullptr);  // no virtual tables
      // No value is longer than the file, unless its pages refer to each other in circles.
      sqlite3_limit(opened, SQLITE_LIMIT_LENGTH,
                    static_cast<int>(std::clamp<std::uint64_t>(bytes.size(), 4096, max_value)));
      sqlite3_set_authorizer(opened, authorize, nullptr);
      sqlite3_progress_handler(
          opened, steps_between_looks,
          [](void* start) {
            return cpu_time() - *static_cast<const std::int64_t*>(start) > max_time ? 1 : 0;
          },
          &start_);
      start_ = cpu_time();
      sqlite3_table_column_metadata(opened, nullptr, "messages", nullptr, nullptr, nullptr, nullptr,
                                    nullptr, nullptr);  // opens the file
    }
    opening = nullptr;
    if (opened == nullptr) throw std::bad_alloc();
    if (result != SQLITE_OK || sqlite3_errcode(opened) == SQLITE_NOTADB)
      throw UnsupportedFormat("this SQLite database is corrupt or cut short");
  }

  SqliteDatabase(const SqliteDatabase&) = delete;
  SqliteDatabase& operator=(const SqliteDatabase&) = delete;

  /// True if there is a table of this name all of whose columns are stored in the file: generated
  /// columns run functions of the file, which nothing interrupts.
  bool has_table(const std::string& name) {
    constexpr int hidden = 6;
    if (query(("SELECT 1 FROM " + name).c_str()).failed()) return false;  // such as a view
    auto columns = query(("PRAGMA table_xinfo(" + name + ")").c_str());
    bool found = false;
    while (columns.next()) {
      if (columns.integer(hidden) != 0) return false;
      found = true;
    }
    return found && !columns.failed();
  }

  /// Rows of a query with one parameter. They fail at once if the columns are not there.
  SqliteRows query(const char* text, std::int64_t parameter = 0) {
    return {database_.get(), text, parameter, start_};
  }

 private:
  struct Deleter {
    void operator()(sqlite3* database) const { sqlite3_close_v2(database); }
  };

  std::int64_t start_ = 0;  ///< CPU time at the last row of the query that is running
  std::unique_ptr<sqlite3, Deleter> database_;
};

constexpr const char* all_messages =
    "SELECT id, topic_id, timestamp, data FROM messages WHERE id >= ? ORDER BY id";
constexpr const char* message_after =
    "SELECT id, timestamp FROM messages WHERE id >= ? ORDER BY id LIMIT 1";
constexpr const char* first_message_of =
    "SELECT id FROM messages WHERE topic_id = ? ORDER BY id LIMIT 1";
constexpr const char* last_message = "SELECT id, timestamp FROM messages ORDER BY id DESC LIMIT 1";
constexpr std::int64_t before_all = std::numeric_limits<std::int64_t>::min();

/// A pushed file is collected in memory, up to 256 MiB, and read at its end, because databases need
/// random access. The position of a seek point is the ID of a message.
class Db3File final : public BagFile {
 public:
  explicit Db3File(AddTopic add_topic) : BagFile(std::move(add_topic)) {}

  void push(std::span<const std::uint8_t> piece) override { collected_.push(piece); }

  void finish() override {
    if (database_) return;
    own_bytes_ = collected_.finish();
    database_ = std::make_unique<SqliteDatabase>(*own_bytes_);
    read_topics();
  }

  bool open(ByteSource& source) override {
    database_ = std::make_unique<SqliteDatabase>(source);
    is_opened_ = true;
    read_topics();
    return true;
  }

  std::optional<BagMessage> next() override {
    while (messages_ && messages_->next()) {
      const auto id = messages_->integer(0);
      if (last_read_ && id <= *last_read_) {  // pages may refer to each other in a cycle
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

  /// Binary search: IDs increase with the times of recording.
  std::optional<SeekPoint> seek_point_before(Microseconds logged) const override {
    if (!is_opened_) return std::nullopt;
    auto earlier = first_id_;
    auto later = last_id_;
    while (earlier < later) {
      const auto middle =
          earlier +
          static_cast<std::int64_t>(
              (static_cast<std::uint64_t>(later) - static_cast<std::uint64_t>(earlier)) / 2);
      auto rows = database_->query(message_after, middle);
      if (!rows.next() || rows.integer(1) / 1000 >= logged)
        later = middle;
      else
        earlier = middle + 1;
    }
    return SeekPoint{.t = logged, .position = static_cast<std::uint64_t>(earlier)};
  }

  void restart(const SeekPoint& seek_point) override {
    read_from(static_cast<std::int64_t>(seek_point.position));
  }

  std::optional<SeekPoint> first_of(std::size_t topic) const override {
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

  std::optional<Microseconds> last_logged() const override { return last_logged_; }

 private:
  void read_topics() {
    constexpr std::size_t max_topics = 4096;
    if (!database_->has_table("topics") || !database_->has_table("messages"))
      throw UnsupportedFormat(
          "this SQLite database is not a ROS 2 bag: it has no ordinary tables topics and messages");
    auto rows =
        database_->query("SELECT id, name, type, serialization_format FROM topics ORDER BY id");
    // Counts rows, because pages may refer to each other in a cycle.
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

  void read_from(std::int64_t id) {
    messages_ = std::make_unique<SqliteRows>(database_->query(all_messages, id));
    last_read_.reset();
  }

  /// Recorders may compress each message with Zstandard, recognised by its first bytes.
  std::optional<std::span<const std::uint8_t>> content_of(std::span<const std::uint8_t> data) {
    constexpr std::size_t max_message = std::size_t{1} << 27;
    if (!begins_frame(FrameCodec::zstd, data)) return data;
    const auto content = decompressor_.decompress(FrameCodec::zstd, data, max_message);
    if (!content) return std::nullopt;
    return content->bytes;
  }

  CollectedBytes collected_{"a .db3 file"};  ///< in push mode
  std::unique_ptr<ByteSource> own_bytes_;    ///< the same, at the end
  std::unique_ptr<SqliteDatabase> database_;
  std::unique_ptr<SqliteRows> messages_;  ///< those not yet read
  bool is_opened_ = false;                ///< with random access
  std::map<std::int64_t, std::optional<std::size_t>> topics_;
  std::optional<Microseconds> last_logged_;
  std::optional<std::int64_t> last_read_;  ///< ID of the last message: they rise
  std::int64_t first_id_ = 0;
  std::int64_t last_id_ = 0;
  FrameDecompressor decompressor_;
};

}  // namespace

std::unique_ptr<BagFile> make_db3_file(BagFile::AddTopic add_topic) {
  return std::make_unique<Db3File>(std::move(add_topic));
}

}  // namespace eventcamera
