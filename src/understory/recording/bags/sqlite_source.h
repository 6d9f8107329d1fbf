#pragma once

#include <sqlite3.h>

#include <string>

#include "understory/recording/bags/byte_source.h"

namespace understory {

// Shows SQLite the bytes of a source as a database that nobody writes. SQLite itself follows no
// link, and so cannot open a file that has lost its name. Lives longer than the database; one
// thread.
class SqliteSource {
 public:
  explicit SqliteSource(ByteSource& source);
  ~SqliteSource();
  SqliteSource(const SqliteSource&) = delete;
  SqliteSource& operator=(const SqliteSource&) = delete;
  // For sqlite3_open_v2, with any name of a file.
  [[nodiscard]] const char* vfs() const { return name_.c_str(); }

 private:
  std::string name_;
  sqlite3_vfs vfs_{};
};

}  // namespace understory
