#include "understory/pipeline/run_folder/input_identity.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <string_view>
#include <system_error>

#include "understory/pipeline/source.h"
#include "understory/recording/bags/byte_source.h"
#include "understory/recording/bags/ros2_bag.h"
#include "understory/util/error.h"
#include "understory/util/files/output_file.h"
#include "understory/util/files/read_error.h"
#include "understory/util/files/record_file.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kRead = std::uint64_t{1} << 20U;  // of each end
constexpr std::string_view kUnreadable = "--------";      // an end that a failing disk keeps

std::string mark_of_file(const std::string& path) {
  const auto file = open_file(path);
  const std::uint64_t size = file->size();
  std::vector<std::uint8_t> bytes;
  file->read(0, kRead, bytes);
  const std::string head = fmt::format("{} bytes, {:08x} ", size, crc32_of(bytes));
  try {
    file->read(size > kRead ? size - kRead : 0, kRead, bytes);
  } catch (const ReadError&) {
    return head + std::string(kUnreadable);
  }
  return head + fmt::format("{:08x}", crc32_of(bytes));
}

// An end that could not be read then or cannot be now tells nothing.
bool same_mark(std::string_view a, std::string_view b) {
  if (a.size() == b.size() && (a.ends_with(kUnreadable) || b.ends_with(kUnreadable))) {
    a.remove_suffix(kUnreadable.size());
    b.remove_suffix(kUnreadable.size());
  }
  return a == b;
}

std::string mark_of_folder(const std::string& path) {
  std::vector<std::string> files;
  std::error_code error;
  for (fs::recursive_directory_iterator entry(path, error), end; !error && entry != end;
       entry.increment(error)) {
    std::error_code ignored;
    if (!entry->is_regular_file(ignored)) continue;
    files.push_back(fmt::format("{} {}\n", fs::relative(entry->path(), path, ignored).string(),
                                entry->file_size(ignored)));
  }
  if (error) throw InputError(path, "", error.message());
  for (const std::string& part : bag_parts_outside(path)) {
    std::error_code ignored;
    files.push_back(
        fmt::format("{} {}\n", fs::path(part).filename().string(), fs::file_size(part, ignored)));
  }
  std::sort(files.begin(), files.end());
  std::uint32_t checksum = 0;
  for (const std::string& file : files)
    checksum = crc32_of(bytes_of(file), checksum);
  return fmt::format("{} files, {:08x}", files.size(), checksum);
}

// The files that the site is made of. Its settings are those of the request.
std::string mark_of_simulation(const std::string& path) {
  std::string mark = "simulation";
  for (const fs::path& file : files_of(path, {}))
    if (!file.empty()) mark += ", " + mark_of_file(file.string());
  return mark;
}

}  // namespace

InputIdentity identify(const std::string& what, const std::string& path) {
  if (is_simulation(path)) return {what, path, mark_of_simulation(path)};
  std::error_code ignored;
  return {what, path, fs::is_directory(path, ignored) ? mark_of_folder(path) : mark_of_file(path)};
}

void expect_same(const std::vector<InputIdentity>& begun_with,
                 const std::vector<InputIdentity>& now) {
  for (std::size_t i = 0; i < begun_with.size() && i < now.size(); ++i) {
    if (same_mark(begun_with[i].mark, now[i].mark)) continue;
    throw InputError(now[i].path, "",
                     "is not " + now[i].what + " that the run was begun with (" +
                         begun_with[i].mark + " then, " + now[i].mark +
                         " now): put the first one back, or map this one into another folder");
  }
  UNDERSTORY_CHECK(begun_with.size() == now.size());
}

}  // namespace understory
