#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "understory/output/run_summary.h"
#include "understory/recording/recording.h"
#include "understory/util/progress.h"

namespace understory {

// Opens what a user may name as a recording: a file or folder, or "sim:SITE?seed=N&key=value" for
// the simulator as a live source.
[[nodiscard]] std::unique_ptr<Recording> open_source(const std::string& name,
                                                     const OpenOptions& options, Log& log);

// Whether `name` is a simulated recording.
[[nodiscard]] bool is_simulation(const std::string& name);

// The same recording, named from any other folder than `folder`: paths in it are made absolute. Of
// the simulator these are the site's file, its list of trees and the folder for scans.
[[nodiscard]] std::string named_from(const std::filesystem::path& folder, const std::string& name);

// Hashes of the recording's files, in order of their names; none for the simulator. What cannot be
// read any more at the end of a run has no hash, with a warning (key "recording.no_hash"). Polls
// `progress`.
[[nodiscard]] std::vector<InputHash> hash_inputs(const std::string& recording, Log& log,
                                                 const ProgressSink& progress = {});

// The files and folders that opening a recording reads. They are the recording, parts of a bag
// outside its folder, and the metadata and extrinsics that were named. Of a simulation they are the
// site and its trees.
[[nodiscard]] std::vector<std::filesystem::path> files_of(const std::string& recording,
                                                          const OpenOptions& options);

}  // namespace understory
