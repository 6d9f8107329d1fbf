#pragma once

#include <functional>
#include <string>
#include <vector>

#include "understory/odometry/stems/stem_front_end.h"
#include "understory/odometry/stems/stem_pacer.h"
#include "understory/pipeline/correction/correction_config.h"
#include "understory/pipeline/georeferencing/run_place.h"
#include "understory/pipeline/mapping/event_loop_config.h"
#include "understory/pipeline/run_folder/output_config.h"
#include "understory/util/config/config.h"
#include "understory/util/config/config_origins.h"
#include "understory/util/log.h"

namespace understory {

// Everything that can be set for `understory map --front-end sparse`.
struct SparseMappingConfig {
  EventLoopConfig loop;
  std::string machine_boxes_file;  // YAML, the same as for the dense front end; empty: none
  StemFrontEndConfig front_end;
  StemPaceConfig pace;
  CorrectionConfig correction;
  GeoreferenceConfig georeference;
  OutputConfig output;
};

// The table of all keys, bound to `config`.
[[nodiscard]] ConfigTable sparse_mapping_table(SparseMappingConfig& config);

// Defaults, then the profile, then the file, then the settings ("key=value"). Empty = none. Keys of
// a profile that are not about stems are passed over, which is noted; all other problems are in one
// ConfigError. The machine's boxes are read, too.
[[nodiscard]] ReadConfig<SparseMappingConfig> read_sparse_mapping_config(
    const std::string& profile, const std::string& file, const std::vector<std::string>& settings,
    Log& log);

// A configuration as `to_yaml` of its table wrote it, with the boxes; `found` says where a file
// lies now that is named in it. Throws ConfigError.
void reread(SparseMappingConfig& config, const std::string& yaml, const std::string& origin,
            const std::function<std::string(const std::string&)>& found);

}  // namespace understory
