#include "understory/pipeline/source.h"

#include <algorithm>
#include <filesystem>
#include <system_error>

#include "understory/recording/bags/ros2_bag.h"
#include "understory/recording/lidars/merged_lidars.h"
#include "understory/simulation/simulation_uri.h"
#include "understory/simulation/simulator.h"
#include "understory/util/error.h"

namespace understory {
namespace {

constexpr const char* kScheme = "sim:";
constexpr const char* kTreesKey = "stand.trees=";

template <typename Lost>
std::vector<std::filesystem::path> plain_files(const std::string& recording, const Lost& lost) {
  std::error_code error;
  if (!std::filesystem::is_directory(recording, error)) return {recording};
  std::vector<std::filesystem::path> files;
  for (std::filesystem::recursive_directory_iterator entry(recording, error), end;
       !error && entry != end; entry.increment(error)) {
    std::error_code ignored;
    if (entry->is_regular_file(ignored)) files.push_back(entry->path());
  }
  if (error) lost(recording + ": " + error.message());
  for (const std::string& part : bag_parts_outside(recording))
    files.emplace_back(part);
  std::sort(files.begin(), files.end());
  return files;
}

std::string absolute(const std::filesystem::path& folder, const std::string& file) {
  const bool relative = !file.empty() && std::filesystem::path(file).is_relative();
  return relative ? (folder / file).lexically_normal().string() : file;
}

// The list of trees that a site's own file names; none of a shipped site, or where it cannot be
// read: opening it says so.
std::string trees_of_site_file(const std::string& site) {
  if (is_shipped_site(site)) return "";
  try {
    return load_site(site, {}).stand.trees;
  } catch (const Error&) {
    return "";
  }
}

// `key=PATH` of a simulation with the path made absolute; anything else as it is.
std::string absolute_setting(const std::filesystem::path& folder, const std::string& setting) {
  for (const std::string key : {"cache=", kTreesKey}) {
    if (setting.rfind(key, 0) == 0) return key + absolute(folder, setting.substr(key.size()));
  }
  return setting;
}

}  // namespace

bool is_simulation(const std::string& name) {
  return name.rfind(kScheme, 0) == 0;
}

std::unique_ptr<Recording> open_source(const std::string& name, const OpenOptions& options,
                                       Log& log) {
  if (!is_simulation(name)) return open_recording(name, options, log);
  const auto open = [&](const OpenOptions& of_lidar, Log& own) {
    return open_simulation(name, own, of_lidar.lidar_topic);
  };
  return open_lidars(name, options, open, log);
}

namespace {

// Those that the site itself knows.
std::vector<std::string> site_settings(const SimulationUri& uri) {
  std::vector<std::string> settings;
  for (const std::string& setting : uri.settings) {
    if (setting.rfind("cache=", 0) != 0) settings.push_back(setting);
  }
  return settings;
}

}  // namespace

std::vector<std::filesystem::path> files_of(const std::string& recording,
                                            const OpenOptions& options) {
  std::vector<std::filesystem::path> files = {options.metadata_file, options.extrinsics_file};
  if (!is_simulation(recording)) {
    files.emplace_back(recording);
    for (const std::string& part : bag_parts_outside(recording))
      files.emplace_back(part);
    return files;
  }
  const SimulationUri uri = parse_simulation_uri(recording);
  const auto named =
      with_problems_of(uri, [&] { return site_files(uri.site, site_settings(uri)); });
  for (const std::string& file : named)
    files.emplace_back(file);
  return files;
}

std::string named_from(const std::filesystem::path& folder, const std::string& name) {
  if (!is_simulation(name)) return absolute(folder, name);
  const SimulationUri uri = parse_simulation_uri(name);
  const std::string site = is_shipped_site(uri.site) ? uri.site : absolute(folder, uri.site);
  std::vector<std::string> settings;
  for (const std::string& setting : uri.settings)
    settings.push_back(absolute_setting(folder, setting));
  const std::string trees = trees_of_site_file(site);
  const bool other_trees = std::any_of(settings.begin(), settings.end(), [](const std::string& s) {
    return s.rfind(kTreesKey, 0) == 0;
  });
  if (!trees.empty() && !other_trees) settings.push_back(kTreesKey + absolute(folder, trees));
  std::string from_there = kScheme + site;
  for (std::size_t i = 0; i < settings.size(); ++i)
    from_there += (i == 0 ? "?" : "&") + settings[i];
  return from_there;
}

std::vector<InputHash> hash_inputs(const std::string& recording, Log& log,
                                   const ProgressSink& progress) {
  std::vector<InputHash> hashes;
  if (is_simulation(recording)) return hashes;
  const auto lost = [&](const std::string& said) {
    log.warn("recording.no_hash",
             said + ": the recording cannot be read any more, and run.json lacks its hash");
  };
  for (const auto& file : plain_files(recording, lost)) {
    try {
      hashes.push_back(hash_input(file, progress));
    } catch (const InputError& error) {
      lost(error.what());
      hashes.push_back({file.filename().string(), 0, ""});
    }
  }
  return hashes;
}

}  // namespace understory
