#include "understory/util/files/durable.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>
#include <vector>

#include "understory/util/error.h"

namespace understory {

namespace fs = std::filesystem;

fs::path folder_of(const fs::path& path) {
  return path.has_parent_path() ? path.parent_path() : fs::path(".");
}

void sync_folder(const fs::path& folder) {
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  // A folder that may be written but not read cannot be opened.
  if (descriptor < 0 && errno == EACCES) return;
  if (descriptor < 0) throw OutputError(folder.string(), std::strerror(errno));
  const bool synced = ::fsync(descriptor) == 0 || errno == EINVAL || errno == EROFS;
  const int code = errno;
  ::close(descriptor);
  if (!synced)
    throw OutputError(folder.string(), std::string("cannot be written: ") + std::strerror(code));
}

void make_durable_folder(const fs::path& folder) {
  std::vector<fs::path> missing;
  std::error_code error;
  for (fs::path at = folder; !fs::exists(at, error); at = folder_of(at)) {
    missing.push_back(at);
    if (folder_of(at) == at) break;
  }
  fs::create_directories(folder, error);
  if (error) throw OutputError(folder.string(), "cannot be created: " + error.message());
  for (const fs::path& made : missing)
    sync_folder(folder_of(made));
}

}  // namespace understory
