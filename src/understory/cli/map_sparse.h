#pragma once

#include <string>
#include <vector>

#include "understory/cli/command.h"
#include "understory/recording/recording.h"

namespace understory {

// `understory map --front-end sparse`, as given on the command line.
struct SparseMapOptions {
  std::string recording;
  std::string run_folder;
  std::string profile;
  std::string config_file;
  std::vector<std::string> settings;
  bool realtime = false;
  bool overwrite = false;
  bool print_config = false;
  OpenOptions open;
};
[[nodiscard]] int run_sparse_map(const SparseMapOptions& options, CommandContext& context);

}  // namespace understory
