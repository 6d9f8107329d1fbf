#include "understory/util/files/staged_output.h"

#include <system_error>

#include "understory/util/files/atomic_file.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

FileLock lock_or_refuse(const fs::path& part, const fs::path& path) {
  std::optional<FileLock> lock = FileLock::take(part);
  if (!lock) throw RefusedOutput(path.string(), "is being written by another understory");
  return std::move(*lock);
}

void remove_files(const fs::path& folder) {
  std::error_code ignored;
  fs::remove_all(folder, ignored);
}

}  // namespace

StagedFile::StagedFile(const fs::path& path, bool overwrite)
    : path_(place_of_file(path, overwrite)), part_(part_path(path_)) {
  std::error_code error;
  replaces_ = fs::exists(path_, error);
  lock_ = lock_or_refuse(part_, path);
}

StagedFile::~StagedFile() {
  std::error_code ignored;
  if (lock_) fs::remove(part_, ignored);
}

void StagedFile::commit() {
  sync_and_rename(part_, path_);
  lock_.reset();
}

StagedFolder::StagedFolder(const fs::path& path, const NameTest& may_replace) : path_(path) {
  if (path.empty()) throw ConfigError({"the name of the output folder is empty"});
  if (!path_.has_filename()) path_ = path_.parent_path();
  check(may_replace);
  part_ = part_path(path_);
  made_.emplace(part_);
  lock_ = lock_or_refuse(part_, path);
  std::error_code error;
  for (const fs::directory_entry& left : fs::directory_iterator(part_, error))
    remove_files(left.path());  // of a process that was killed
}

void StagedFolder::check(const NameTest& may_replace) {
  std::error_code error;
  const fs::file_status named = fs::symlink_status(path_, error);
  if (!fs::exists(named)) return refuse_folder_in_file(path_);
  if (!fs::is_directory(fs::status(path_, error)))
    throw RefusedOutput(path_.string(), "is there and is not a folder");
  path_ = fs::canonical(path_);
  for (const fs::directory_entry& entry : fs::directory_iterator(path_)) {
    const std::string name = entry.path().filename().string();
    replaces_ = true;
    if (may_replace && may_replace(name) && fs::is_regular_file(entry.symlink_status())) continue;
    throw RefusedOutput(path_.string(), "holds " + name +
                                            ": expected a folder that is not there yet, or an "
                                            "empty one");
  }
}

StagedFolder::~StagedFolder() {
  if (lock_) remove_files(part_);
}

void StagedFolder::commit() {
  std::error_code error;
  const fs::path former = part_path(path_.parent_path() / ("former." + path_.filename().string()));
  if (replaces_) {
    remove_files(former);  // of a process that was killed
    fs::rename(path_, former, error);
    if (error) throw OutputError(path_.string(), "cannot be replaced: " + error.message());
  }
  fs::rename(part_, path_, error);
  if (error) {
    std::error_code ignored;
    if (replaces_) fs::rename(former, path_, ignored);
    throw OutputError(path_.string(), "cannot be put in place: " + error.message());
  }
  lock_.reset();
  if (replaces_) remove_files(former);
}

std::string with_final_names(std::string message) {
  const std::string part = part_path("").string();
  for (const std::string& hidden : {part, std::string(".understory/results/")}) {
    for (std::size_t at = message.find(hidden); at != std::string::npos; at = message.find(hidden))
      message.erase(at, hidden.size());
  }
  return message;
}

}  // namespace understory
