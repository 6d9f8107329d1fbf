#pragma once

#include <functional>
#include <string>
#include <variant>
#include <vector>

#include "understory/evaluation/world_frame.h"
#include "understory/pipeline/mapping/adaptation.h"
#include "understory/pipeline/mapping/dense/dense_mapping_config.h"
#include "understory/pipeline/mapping/sparse/sparse_mapping_config.h"
#include "understory/util/config/config_origins.h"
#include "understory/util/log.h"

namespace understory {

// The front ends of `understory map`, as --front-end and checkpoints name them.
inline constexpr const char* kDenseFrontEnd = "dense";
inline constexpr const char* kSparseFrontEnd = "sparse";

// Everything that can be set for `understory map`. Which of the two it is says which front end.
using FrontEndConfig = std::variant<DenseMappingConfig, SparseMappingConfig>;

// The name of the front end that a configuration belongs to: dense or sparse.
[[nodiscard]] std::string name_of(const FrontEndConfig& config);
// Every key, without comments.
[[nodiscard]] std::string yaml_of(const FrontEndConfig& config);
// What the event loop takes from it.
[[nodiscard]] const EventLoopConfig& loop_of(const FrontEndConfig& config);
// How the run lies on the globe.
[[nodiscard]] const GeoreferenceConfig& georeference_of(const FrontEndConfig& config);
// The axes of its files.
[[nodiscard]] WorldFrame world_frame_of(const FrontEndConfig& config);
// Other files that it names; empty names for none: the machine's boxes, the log of the head.
[[nodiscard]] std::vector<std::string> files_named_in(const FrontEndConfig& config);
// Throws InputError where one of them cannot be used that is read only at the end.
void check_files_named_in(const FrontEndConfig& config);
// Whether the first scans are looked at before the configuration is adapted (learn_traits). Stems
// are found in the same way in any scan.
[[nodiscard]] bool depends_on_sensors(const FrontEndConfig& config);

// Defaults, then the profile, then the file, then the settings ("key=value"). Empty = none. Throws
// ConfigError for all problems together.
[[nodiscard]] ReadConfig<FrontEndConfig> read_front_end_config(
    const std::string& front_end, const std::string& profile, const std::string& file,
    const std::vector<std::string>& settings, Log& log);
// From what `yaml_of` wrote; `found` says where a file lies now that is named in it. Throws
// ConfigError, or InputError where such a file cannot be read.
[[nodiscard]] FrontEndConfig reread_front_end_config(
    const std::string& front_end, const std::string& yaml, const std::string& origin,
    const std::function<std::string(const std::string&)>& found);

// As adapt() and commented_yaml() of the two (adaptation.h).
[[nodiscard]] Adapted<FrontEndConfig> adapt_front_end(const FrontEndConfig& asked,
                                                      const ConfigOrigins& origins,
                                                      const SensorTraits& traits,
                                                      const RunConditions& conditions);
[[nodiscard]] std::string commented_yaml(const Adapted<FrontEndConfig>& adapted,
                                         const ConfigOrigins& origins);

}  // namespace understory
