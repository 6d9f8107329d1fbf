#include "understory/util/files/file_in_folder.h"

#include "understory/util/error.h"

namespace understory {

std::filesystem::path file_in_folder(const std::string& given, const std::string& name) {
  std::filesystem::path path(given);
  if (!std::filesystem::is_directory(path)) return path;
  path /= name;
  if (!std::filesystem::exists(path))
    throw InputError(given, "", "expected a folder that holds " + name);
  return path;
}

}  // namespace understory
