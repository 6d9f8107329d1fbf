#include "understory/util/files/file_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <string>
#include <utility>

#include "understory/util/error.h"

namespace understory {
namespace {

// Whether the name still leads to the open file: it may have been removed before the lock came.
bool still_named(int descriptor, const std::filesystem::path& path) {
  struct stat open = {};
  struct stat named = {};
  return ::fstat(descriptor, &open) == 0 && ::stat(path.c_str(), &named) == 0 &&
         open.st_dev == named.st_dev && open.st_ino == named.st_ino;
}

// Only what the lock of another tells; a file system without locks has none to tell of.
bool held_elsewhere(int descriptor) {
  return ::flock(descriptor, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;
}

}  // namespace

std::optional<FileLock> FileLock::take(const std::filesystem::path& path) {
  constexpr int kTries = 100;
  for (int i = 0; i < kTries; ++i) {
    int descriptor = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0644);
    const bool folder = descriptor < 0 && errno == EISDIR;
    if (folder) descriptor = ::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC | O_NOFOLLOW);
    if (descriptor < 0)
      throw OutputError(path.string(), std::string("cannot be opened: ") + std::strerror(errno));
    FileLock lock(descriptor);
    if (held_elsewhere(descriptor)) return std::nullopt;
    if (!still_named(descriptor, path)) continue;
    if (folder) return lock;
    const std::string number = std::to_string(::getpid()) + "\n";
    // The number is for messages only: the lock holds without it, on a full disk for instance.
    if (::ftruncate(descriptor, 0) != 0 ||
        ::pwrite(descriptor, number.data(), number.size(), 0) < 0)
      errno = 0;
    return lock;
  }
  return std::nullopt;
}

std::optional<long> FileLock::holder(const std::filesystem::path& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
  if (descriptor < 0) return std::nullopt;
  const FileLock probe(descriptor);
  if (!held_elsewhere(descriptor)) return std::nullopt;
  char text[24] = {};
  if (::pread(descriptor, text, sizeof(text) - 1, 0) <= 0) return 0;
  return std::strtol(text, nullptr, 10);
}

FileLock::~FileLock() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

FileLock::FileLock(FileLock&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}

FileLock& FileLock::operator=(FileLock&& other) noexcept {
  std::swap(descriptor_, other.descriptor_);
  return *this;
}

}  // namespace understory
