#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "understory/recording/extrinsics.h"
#include "understory/recording/lidars/late_scans.h"
#include "understory/recording/lidars/merged_lidars.h"
#include "understory/recording/recording_constants.h"
#include "understory/util/error.h"

namespace understory {
namespace {

std::vector<std::string> names_in(const std::string& list) {
  std::vector<std::string> names;
  for (std::size_t begin = 0; begin <= list.size();) {
    const std::size_t end = std::min(list.find(',', begin), list.size());
    const std::string name = list.substr(begin, end - begin);
    begin = end + 1;
    if (name.empty() && list.empty()) break;
    if (name.empty()) throw ConfigError({"--lidar-topic " + list + ": expected A,B without gaps"});
    if (std::find(names.begin(), names.end(), name) != names.end())
      throw ConfigError({"--lidar-topic " + list + ": " + name + " is named twice"});
    names.push_back(name);
  }
  return names;
}

double lateness_by_file(const OpenOptions& options) {
  return options.extrinsics_file.empty() ? 0.0 : lateness_of_file(options.extrinsics_file);
}

}  // namespace

double lateness_of(const OpenOptions& options) {
  const std::vector<NamedLidar> named = named_lidars(options);
  return named.empty() ? lateness_by_file(options) : named.front().late_s;
}

std::vector<NamedLidar> named_lidars(const OpenOptions& options) {
  std::vector<NamedLidar> listed;
  if (!options.extrinsics_file.empty()) {
    for (const ListedLidar& lidar : lidars_of_file(options.extrinsics_file))
      listed.push_back({lidar.topic, lidar.late_s, static_cast<int>(listed.size())});
  }
  const std::vector<std::string> names = names_in(options.lidar_topic);
  if (names.empty()) return listed;
  std::vector<NamedLidar> named;
  for (const std::string& name : names) {
    const auto entry = std::find_if(listed.begin(), listed.end(),
                                    [&](const NamedLidar& each) { return each.topic == name; });
    if (entry != listed.end()) {
      named.push_back(*entry);
    } else if (listed.empty()) {
      named.push_back({name, lateness_by_file(options), static_cast<int>(named.size())});
    } else {
      throw ConfigError(
          {options.extrinsics_file + ": lidars: expected an entry with topic " + name});
    }
  }
  if (named.size() > 1 && listed.empty() && !options.extrinsics_file.empty())
    throw ConfigError({options.extrinsics_file +
                       ": expected each of several lidars under `lidars`, with its topic and "
                       "body_from_lidar"});
  return named;
}

OpenOptions options_for(const NamedLidar& lidar, const OpenOptions& options) {
  OpenOptions own = options;
  own.lidar_topic = lidar.topic;
  own.lidar_entry = lidar.entry;
  return own;
}

std::unique_ptr<Recording> open_lidars(const std::string& file, const OpenOptions& options,
                                       const OpenOneLidar& open, Log& log) {
  const std::vector<NamedLidar> chosen = named_lidars(options);
  if (chosen.empty()) return without_lateness(open(options, log), lateness_by_file(options));
  if (chosen.size() > recording_constants::merged_lidars::kMostLidars)
    throw ConfigError({"expected 16 lidars at most"});
  std::vector<LidarReader> readers;
  for (const NamedLidar& lidar : chosen) {
    LidarReader reader;
    reader.topic = lidar.topic;
    if (!readers.empty()) reader.log = std::make_unique<Log>();
    Log& own_log = readers.empty() ? log : *reader.log;
    reader.recording = without_lateness(open(options_for(lidar, options), own_log), lidar.late_s);
    readers.push_back(std::move(reader));
  }
  if (readers.size() == 1) return std::move(readers.front().recording);
  return merge_lidars(file, std::move(readers), log);
}

}  // namespace understory
