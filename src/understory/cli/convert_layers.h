#pragma once

#include <string>

#include "understory/cli/command.h"

namespace understory {

// What `convert RUN` writes of the layers of a run: one of them, or all into a database.
struct LayerConversion {
  std::string input;            // run folder or GeoPackage
  std::string output;           // .geojson; empty where `target` is given
  std::string target;           // "PG:..."
  std::string layer = "trees";  // of a .geojson
  std::string schema = "understory";
  std::string run_id;  // empty: from the hashes of the run's input
  bool overwrite = false;
};

// Whether the output of `convert` is one of the layers of a run.
[[nodiscard]] bool is_layer_output(const std::string& output);

// Writes it, prints what was written, returns the exit code. Throws InputError, OutputError and
// ConfigError.
[[nodiscard]] int convert_layers(const LayerConversion& conversion, CommandContext& context);

}  // namespace understory
