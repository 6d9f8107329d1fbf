// Preloaded into the program by failing_disks.py: reads of one file fail from a byte on, as those
// of a failing disk do. UNDERSTORY_FAILING_FILE is its absolute path, UNDERSTORY_FAILING_BYTE the
// place.
#include <dlfcn.h>
#include <sys/types.h>
#include <unistd.h>

#include <cerrno>
#include <climits>
#include <cstdlib>
#include <cstring>

namespace {

template <typename Function>
Function next(const char* name) {
  return reinterpret_cast<Function>(::dlsym(RTLD_NEXT, name));
}

bool is_failing(int descriptor) {
  const char* wanted = std::getenv("UNDERSTORY_FAILING_FILE");
  if (wanted == nullptr) return false;
  char link[64] = "/proc/self/fd/";
  char digits[16];
  int count = 0;
  do {
    digits[count++] = static_cast<char>('0' + descriptor % 10);
    descriptor /= 10;
  } while (descriptor > 0);
  std::size_t at = std::strlen(link);
  while (count > 0)
    link[at++] = digits[--count];
  char path[PATH_MAX + 1];
  const ssize_t length = ::readlink(link, path, PATH_MAX);
  if (length < 0) return false;
  path[length] = '\0';
  return std::strcmp(path, wanted) == 0;
}

// How much can be read there; -1 where nothing can.
ssize_t readable(int descriptor, off64_t offset, std::size_t count) {
  const int error = errno;
  const bool failing = is_failing(descriptor);
  errno = error;
  if (!failing) return static_cast<ssize_t>(count);
  const char* place = std::getenv("UNDERSTORY_FAILING_BYTE");
  const off64_t bad = place == nullptr ? 0 : std::atoll(place);
  if (offset >= bad) {
    errno = EIO;
    return -1;
  }
  return static_cast<ssize_t>(
      offset + static_cast<off64_t>(count) > bad ? static_cast<std::size_t>(bad - offset) : count);
}

}  // namespace

extern "C" {

ssize_t read(int descriptor, void* into, std::size_t count) {
  static const auto real = next<ssize_t (*)(int, void*, std::size_t)>("read");
  const off64_t at = ::lseek64(descriptor, 0, SEEK_CUR);
  const ssize_t most = at < 0 ? static_cast<ssize_t>(count) : readable(descriptor, at, count);
  return most < 0 ? -1 : real(descriptor, into, static_cast<std::size_t>(most));
}

ssize_t pread64(int descriptor, void* into, std::size_t count, off64_t offset) {
  static const auto real = next<ssize_t (*)(int, void*, std::size_t, off64_t)>("pread64");
  const ssize_t most = readable(descriptor, offset, count);
  return most < 0 ? -1 : real(descriptor, into, static_cast<std::size_t>(most), offset);
}

ssize_t pread(int descriptor, void* into, std::size_t count, off_t offset) {
  return pread64(descriptor, into, count, offset);
}
}
