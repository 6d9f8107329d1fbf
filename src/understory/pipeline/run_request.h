#pragma once

#include <filesystem>
#include <string>

#include "understory/recording/recording.h"

namespace understory {

// What one call of `understory map` asks for, whatever the front end.
struct RunRequest {
  std::string recording;  // file, folder or sim:SITE
  std::filesystem::path run_folder;
  std::string config_yaml;  // resolved, every key, for run.json and for resuming
  OpenOptions open;
  bool realtime = false;   // played at the speed of its sensors; late scans are dropped
  bool overwrite = false;  // start anew although the folder holds an unfinished run
};

}  // namespace understory
