#include "understory/pipeline/run_folder/run_results.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <nlohmann/json.hpp>
#include <system_error>

#include "understory/util/error.h"
#include "understory/util/files/atomic_file.h"

namespace understory {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kRunJson = "run.json";
constexpr std::uintmax_t kLargestRunJson = 64U << 20;

template <std::size_t N>
bool is_one_of(const std::string& text, const std::array<const char*, N>& names) {
  return std::find(names.begin(), names.end(), text) != names.end();
}

std::string text_at(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
}

// Other programs write files of that name, too.
bool is_ours(const Json& json) {
  constexpr std::array<const char*, 5> kCommands = {"map", "correct", "inventory", "georeference",
                                                    "merge"};
  constexpr std::array<const char*, 3> kStatus = {"complete", "partial", "untrusted"};
  return json.is_object() && is_one_of(text_at(json, "command"), kCommands) &&
         is_one_of(text_at(json, "status"), kStatus) && !text_at(json, "version").empty();
}

// A pipe is not opened: its reader would wait for ever.
Json read_json(const fs::path& path) {
  std::error_code error;
  if (!fs::is_regular_file(fs::symlink_status(path, error))) return nullptr;
  if (fs::file_size(path, error) > kLargestRunJson || error) return nullptr;
  std::ifstream file(path);
  return Json::parse(file, nullptr, false);
}

}  // namespace

const std::vector<std::string>& result_names() {
  static const std::vector<std::string> names = {
      "trajectory.tum",  "odometry.tum", "keyframes.tum", "states.csv.gz", "stems.csv.gz",
      "graph.g2o",       "gnss.csv",     "global.csv.gz", "steps.csv",     "loops.csv",
      "corrections.csv", "map.laz",      "trees.csv",     "felled.csv",    "cuts.csv",
      "trees.gpkg",      "dtm.tif",      "dsm.tif",       "chm.tif",       "map.qgs",
      "deformation.csv", "run.json",     "report.html"};
  return names;
}

bool is_result_name(const std::string& name) {
  return std::find(result_names().begin(), result_names().end(), name) != result_names().end();
}

FormerResults former_results(const fs::path& folder) {
  FormerResults former;
  const Json json = read_json(folder / kRunJson);
  former.present = is_ours(json);
  if (!former.present) return former;
  former.names.insert(kRunJson);
  const auto files = json.find("files");
  if (files == json.end() || !files->is_array()) {  // of a version that kept no list
    former.names.insert(result_names().begin(), result_names().end());
    return former;
  }
  for (const Json& name : *files) {
    if (!name.is_string()) continue;
    const fs::path path(name.get<std::string>());
    if (path.has_filename() && path == path.filename()) former.names.insert(path.string());
  }
  return former;
}

std::string foreign_result(const fs::path& folder, const std::set<std::string>& own) {
  for (const std::string& name : result_names()) {
    std::error_code error;
    const fs::file_status status = fs::symlink_status(folder / name, error);
    if (!fs::exists(status)) continue;
    if (own.count(name) == 0 || !fs::is_regular_file(status)) return name;
  }
  return "";
}

void list_results(const fs::path& run_json, const std::set<std::string>& names) {
  Json json = read_json(run_json);
  UNDERSTORY_CHECK(is_ours(json));
  json["files"] = names;
  AtomicFile file(run_json);
  file.write(json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
  file.commit();
}

}  // namespace understory
