#include "understory/util/files/output_guard.h"

#include <unistd.h>

#include <algorithm>
#include <system_error>

#include "understory/util/files/durable.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

// What the system knows a path as; `fs::equivalent` compares device and inode.
bool same(const fs::path& a, const fs::path& b) {
  std::error_code error;
  return fs::equivalent(a, b, error) && !error;
}

// With all links resolved as far as the path exists.
fs::path resolved(const fs::path& path) {
  std::error_code error;
  const fs::path absolute = fs::absolute(path, error);
  if (error) return path;
  fs::path result = fs::weakly_canonical(absolute, error);
  if (error) return absolute.lexically_normal();
  return result.has_filename() ? result : result.parent_path();  // no trailing slash
}

// The place of the name itself, where the name is a link to elsewhere.
fs::path resolved_name(const fs::path& path) {
  std::error_code error;
  fs::path absolute = fs::absolute(path, error);
  if (error) return path;
  if (!absolute.has_filename()) absolute = absolute.parent_path();
  return resolved(absolute.parent_path()) / absolute.filename();
}

// Whether `folder` is `path` or one of the folders above it.
bool holds(const fs::path& folder, const fs::path& path) {
  for (fs::path at = path;; at = at.parent_path()) {
    if (at == folder || same(at, folder)) return true;
    if (at == at.parent_path()) return false;
  }
}

[[noreturn]] void refuse(const fs::path& output, const std::string& relation,
                         const fs::path& input) {
  throw RefusedOutput(output.string(), relation + " " + input.string() +
                                           ", which is read: expected a place of its own for the "
                                           "output");
}

void refuse_one(const fs::path& output, const fs::path& input, const fs::path& named) {
  std::error_code error;
  const bool folder = fs::is_directory(input, error);
  for (const fs::path& place : {resolved(output), resolved_name(output)}) {
    if (place == resolved(input) || same(place, input)) refuse(output, "is the input", named);
    if (folder && holds(resolved(input), place)) refuse(output, "lies in the input", named);
  }
  for (const fs::path& place : {resolved(input), resolved_name(input)}) {
    if (holds(resolved(output), place)) refuse(output, "holds the input", named);
  }
}

// The links in a folder lead to inputs, too, and a hard link of the output may lie in it.
void refuse_content(const fs::path& output, const fs::path& folder) {
  std::error_code error;
  fs::recursive_directory_iterator entry(folder, fs::directory_options::skip_permission_denied,
                                         error);
  const bool is_file = fs::is_regular_file(output, error);
  for (const fs::recursive_directory_iterator end; entry != end; entry.increment(error)) {
    std::error_code ignored;
    if (entry->is_symlink(ignored) && entry->is_regular_file(ignored))
      refuse_one(output, entry->path(), entry->path());
    if (is_file && same(output, entry->path())) refuse(output, "is the input", entry->path());
    if (error) break;
  }
}

// From the inside out; what is not empty stays.
void remove_empty(const std::vector<fs::path>& folders) {
  for (auto path = folders.rbegin(); path != folders.rend(); ++path)
    (void)::rmdir(path->c_str());
}

}  // namespace

void refuse_input_as_output(const fs::path& output, const std::vector<fs::path>& inputs) {
  if (output.empty()) return;
  for (const fs::path& input : inputs) {
    std::error_code error;
    if (input.empty() || !fs::exists(fs::symlink_status(input, error))) continue;
    refuse_one(output, input, input);
    if (fs::is_directory(input, error)) refuse_content(output, input);
  }
}

void refuse_folder_in_file(const fs::path& folder) {
  std::error_code error;
  fs::path at = fs::absolute(folder, error).parent_path();
  fs::path named = folder.parent_path();
  for (; at != at.parent_path(); at = at.parent_path(), named = named.parent_path()) {
    const fs::file_status status = fs::status(at, error);
    if (!fs::exists(status)) continue;
    if (fs::is_directory(status)) return;
    throw RefusedOutput(folder.string(), "cannot be made: " + named.string() +
                                             " is a file: expected a place outside of it");
  }
}

fs::path place_of_file(const fs::path& path, bool overwrite) {
  if (path.empty()) throw ConfigError({"the name of the output is empty"});
  if (!path.has_filename()) throw RefusedOutput(path.string(), "is the name of a folder");
  std::error_code error;
  const fs::file_status named = fs::symlink_status(path, error);
  if (named.type() != fs::file_type::not_found && !fs::status_known(named))
    throw OutputError(path.string(), "cannot be written: " + error.message());
  if (!fs::exists(named)) {
    const fs::path folder = path.parent_path().empty() ? fs::path(".") : path.parent_path();
    const fs::file_status above = fs::status(folder, error);
    if (!fs::exists(above))
      throw RefusedOutput(path.string(), "there is no folder " + folder.string());
    if (!fs::is_directory(above))
      throw RefusedOutput(path.string(), folder.string() + " is not a folder");
    return path;
  }
  const fs::file_status status = fs::status(path, error);
  if (fs::is_directory(status)) throw RefusedOutput(path.string(), "is a folder, expected a file");
  if (!fs::is_regular_file(status))
    throw RefusedOutput(path.string(), "is there and is not a regular file: it is left as it is");
  if (!overwrite)
    throw RefusedOutput(path.string(), "is there already: give --overwrite to replace it");
  return fs::is_symlink(named) ? fs::canonical(path) : path;
}

MadeFolders::MadeFolders(const fs::path& folder) {
  std::error_code error;
  std::vector<fs::path> missing;
  for (fs::path at = fs::absolute(folder);
       !fs::exists(fs::status(at, error)) && at != at.parent_path(); at = at.parent_path()) {
    if (at.has_filename()) missing.push_back(at);
  }
  std::reverse(missing.begin(), missing.end());
  for (const fs::path& path : missing) {
    if (fs::create_directory(path, error)) made_.push_back(path);
    if (error) break;
  }
  if (!error && fs::is_directory(folder, error)) return;
  const std::string reason = error ? error.message() : "it is not a folder";
  remove_empty(made_);
  throw OutputError(folder.string(), "cannot be made: " + reason);
}

void MadeFolders::sync() const {
  for (const std::filesystem::path& made : made_)
    sync_folder(folder_of(made));
}

MadeFolders::~MadeFolders() {
  remove_empty(made_);
}

}  // namespace understory
