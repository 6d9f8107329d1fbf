#include "understory/recording/bags/sqlite_source.h"

#include <cstring>
#include <sstream>

#include "understory/util/files/read_error.h"

namespace understory {
namespace {

struct SourceFile {
  sqlite3_file base;
  ByteSource* source;
};

ByteSource& source_of(sqlite3_file* file) {
  return *reinterpret_cast<SourceFile*>(file)->source;
}

int read_part(sqlite3_file* file, void* into, int count, sqlite3_int64 offset) {
  const auto wanted = static_cast<std::size_t>(count);
  auto* bytes = static_cast<std::uint8_t*>(into);
  std::size_t got = 0;
  try {
    got = source_of(file).read(static_cast<std::uint64_t>(offset), bytes, wanted);
  } catch (const ReadError&) {
    return SQLITE_IOERR_READ;
  }
  if (got == wanted) return SQLITE_OK;
  std::memset(bytes + got, 0, wanted - got);
  return SQLITE_IOERR_SHORT_READ;
}

int size_of(sqlite3_file* file, sqlite3_int64* size) {
  *size = static_cast<sqlite3_int64>(source_of(file).size());
  return SQLITE_OK;
}

const sqlite3_io_methods& methods() {
  static const sqlite3_io_methods kMethods = [] {
    sqlite3_io_methods made{};
    made.iVersion = 1;
    made.xClose = [](sqlite3_file*) { return SQLITE_OK; };
    made.xRead = read_part;
    made.xWrite = [](sqlite3_file*, const void*, int, sqlite3_int64) { return SQLITE_READONLY; };
    made.xTruncate = [](sqlite3_file*, sqlite3_int64) { return SQLITE_READONLY; };
    made.xSync = [](sqlite3_file*, int) { return SQLITE_OK; };
    made.xFileSize = size_of;
    made.xLock = [](sqlite3_file*, int) { return SQLITE_OK; };
    made.xUnlock = [](sqlite3_file*, int) { return SQLITE_OK; };
    made.xCheckReservedLock = [](sqlite3_file*, int* held) {
      *held = 0;
      return SQLITE_OK;
    };
    made.xFileControl = [](sqlite3_file*, int, void*) { return SQLITE_NOTFOUND; };
    made.xSectorSize = [](sqlite3_file*) { return 4096; };
    made.xDeviceCharacteristics = [](sqlite3_file*) { return SQLITE_IOCAP_IMMUTABLE; };
    return made;
  }();
  return kMethods;
}

// The database alone: a journal or a temporary file has no place here.
int open_source(sqlite3_vfs* vfs, const char* /*name*/, sqlite3_file* file, int flags,
                int* flags_out) {
  file->pMethods = nullptr;
  if ((flags & SQLITE_OPEN_MAIN_DB) == 0) return SQLITE_CANTOPEN;
  file->pMethods = &methods();
  reinterpret_cast<SourceFile*>(file)->source = static_cast<ByteSource*>(vfs->pAppData);
  if (flags_out != nullptr) *flags_out = SQLITE_OPEN_READONLY;
  return SQLITE_OK;
}

int same_path(sqlite3_vfs* /*vfs*/, const char* path, int size, char* out) {
  const std::size_t length = std::strlen(path) + 1;
  if (length > static_cast<std::size_t>(size)) return SQLITE_CANTOPEN;
  std::memcpy(out, path, length);
  return SQLITE_OK;
}

}  // namespace

SqliteSource::SqliteSource(ByteSource& source) : vfs_(*sqlite3_vfs_find(nullptr)) {
  std::ostringstream name;
  name << "understory_" << this;
  name_ = name.str();
  vfs_.zName = name_.c_str();
  vfs_.pNext = nullptr;
  vfs_.pAppData = &source;
  vfs_.szOsFile = sizeof(SourceFile);
  vfs_.xOpen = open_source;
  vfs_.xDelete = [](sqlite3_vfs*, const char*, int) { return SQLITE_READONLY; };
  vfs_.xAccess = [](sqlite3_vfs*, const char*, int, int* there) {
    *there = 0;
    return SQLITE_OK;
  };
  vfs_.xFullPathname = same_path;
  sqlite3_vfs_register(&vfs_, 0);
}

SqliteSource::~SqliteSource() {
  sqlite3_vfs_unregister(&vfs_);
}

}  // namespace understory
