#include "understory/pipeline/source.h"

#include <algorithm>
#include <filesystem>
#include <system_error>

#include "understory/simulation/simulator.h"
#include "understory/util/error.h"

namespace understory {
namespace {

constexpr const char* kScheme = "sim:";

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
  std::sort(files.begin(), files.end());
  return files;
}

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

std::vector<InputHash> hash_inputs(const std::string& recording, Log& log) {
  std::vector<InputHash> hashes;
  if (is_simulation(recording)) return hashes;
  const auto lost = [&](const std::string& said) {
    log.warn("recording.no_hash",
             said + ": the recording cannot be read any more, and run.json lacks its hash");
  };
  for (const auto& file : plain_files(recording, lost)) {
    try {
      hashes.push_back(hash_input(file));
    } catch (const InputError& error) {
      lost(error.what());
      hashes.push_back({file.filename().string(), 0, ""});
    }
  }
  return hashes;
}

}  // namespace understory
