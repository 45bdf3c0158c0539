// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/ros/sqlite_database.hpp"

#include <algorithm>
#include <ctime>
#include <new>
#include <string_view>

#include "src/formats/unsupported_format.hpp"

namespace eventcamera {

namespace {

/// Limit of a value in the database, bytes.
constexpr int max_value = 1 << 27;
/// Steps of SQLite's virtual machine between two looks at the time.
constexpr int steps_between_looks = 1000;
/// CPU time after which a query that has found no further row is interrupted, nanoseconds.
constexpr std::int64_t max_time = 200'000'000;

/// CPU time of this thread: neither a busy machine nor a slow disk interrupts a query.
std::int64_t cpu_time() {
  timespec now = {};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

/// A file of SQLite's, read from a source of bytes.
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

/// Name of SQLite's file system whose only file is `opening`.
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

}  // namespace

SqliteDatabase::SqliteDatabase(ByteSource& bytes) {
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

bool SqliteDatabase::has_table(const std::string& name) {
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

SqliteRows SqliteDatabase::query(const char* text, std::int64_t parameter) {
  SqliteRows rows;
  rows.start_ = &start_;
  start_ = cpu_time();
  sqlite3_stmt* statement = nullptr;
  rows.failed_ = sqlite3_prepare_v2(database_.get(), text, -1, &statement, nullptr) != SQLITE_OK;
  rows.statement_.reset(statement);
  if (!rows.failed_ && sqlite3_bind_parameter_count(statement) > 0)
    sqlite3_bind_int64(statement, 1, parameter);
  return rows;
}

bool SqliteRows::next() {
  if (failed_ || !statement_) return false;
  *start_ = cpu_time();
  const auto result = sqlite3_step(statement_.get());
  failed_ = result != SQLITE_ROW && result != SQLITE_DONE;
  if (result != SQLITE_ROW) statement_.reset();
  return result == SQLITE_ROW;
}

std::int64_t SqliteRows::integer(int column) const {
  return sqlite3_column_int64(statement_.get(), column);
}

std::string SqliteRows::text(int column) const {
  const auto bytes = blob(column);
  return {bytes.begin(), bytes.end()};
}

std::span<const std::uint8_t> SqliteRows::blob(int column) const {
  const auto* const bytes =
      static_cast<const std::uint8_t*>(sqlite3_column_blob(statement_.get(), column));
  const auto count = sqlite3_column_bytes(statement_.get(), column);
  if (bytes == nullptr) return {};
  return {bytes, static_cast<std::size_t>(count)};
}

}  // namespace eventcamera
