// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <sqlite3.h>

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "src/formats/byte_source.hpp"

namespace eventcamera {

/// Rows of a query, valid as long as the database.
class SqliteRows {
 public:
  SqliteRows() = default;

  /// Goes to the next row, the first at first. False at the end, and if the database is corrupt.
  bool next();

  /// True if the query ended early.
  bool failed() const { return failed_; }

  std::int64_t integer(int column) const;
  std::string text(int column) const;
  /// Valid until next().
  std::span<const std::uint8_t> blob(int column) const;

 private:
  friend class SqliteDatabase;
  struct Deleter {
    void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
  };

  std::unique_ptr<sqlite3_stmt, Deleter> statement_;
  std::int64_t* start_ = nullptr;  ///< of the database
  bool failed_ = false;
};

/// Reads an SQLite database from any source of bytes. The file may be hostile: its views, virtual
/// tables, triggers and functions are not run, and a query that takes too long to find a row fails.
class SqliteDatabase {
 public:
  /// `bytes` must outlive this object. Throws UnsupportedFormat if it is no database.
  explicit SqliteDatabase(ByteSource& bytes);
  SqliteDatabase(const SqliteDatabase&) = delete;
  SqliteDatabase& operator=(const SqliteDatabase&) = delete;

  /// True if there is a table of this name all of whose columns are stored in the file: generated
  /// columns run functions of the file, which nothing interrupts.
  bool has_table(const std::string& name);

  /// Rows of a query with one parameter. They fail at once if the columns are not there.
  SqliteRows query(const char* text, std::int64_t parameter = 0);

 private:
  struct Deleter {
    void operator()(sqlite3* database) const { sqlite3_close_v2(database); }
  };

  std::int64_t start_ = 0;  ///< CPU time at the last row of the query that is running
  std::unique_ptr<sqlite3, Deleter> database_;
};

}  // namespace eventcamera
