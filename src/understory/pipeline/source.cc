#include "understory/pipeline/source.h"

#include <algorithm>
#include <filesystem>

#include "understory/simulation/simulator.h"

namespace understory {
namespace {

constexpr const char* kScheme = "sim:";

}  // namespace

bool is_simulation(const std::string& name) {
  return name.rfind(kScheme, 0) == 0;
}

std::unique_ptr<Recording> open_source(const std::string& name, const OpenOptions& options,
                                       Log& log) {
  if (is_simulation(name)) return open_simulation(name, log);
  return open_recording(name, options, log);
}

std::vector<std::filesystem::path> files_of(const std::string& recording,
                                            const OpenOptions& options) {
  std::vector<std::filesystem::path> files = {options.metadata_file, options.extrinsics_file};
  if (!is_simulation(recording)) {
    files.emplace_back(recording);
    return files;
  }
  const SimulationUri uri = parse_simulation_uri(recording);
  std::vector<std::string> settings;
  for (const std::string& setting : uri.settings) {
    if (setting.rfind("cache=", 0) != 0) settings.push_back(setting);
  }
  for (const std::string& file : site_files(uri.site, settings))
    files.emplace_back(file);
  return files;
}

std::vector<InputHash> hash_inputs(const std::string& recording) {
  std::vector<InputHash> hashes;
  if (is_simulation(recording)) return hashes;
  std::vector<std::filesystem::path> files;
  if (std::filesystem::is_directory(recording)) {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(recording)) {
      if (entry.is_regular_file()) files.push_back(entry.path());
    }
    std::sort(files.begin(), files.end());
  } else {
    files.emplace_back(recording);
  }
  for (const auto& file : files)
    hashes.push_back(hash_input(file));
  return hashes;
}

}  // namespace understory
