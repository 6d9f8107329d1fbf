#include "understory/pipeline/mapping/front_end_config.h"

#include <algorithm>
#include <utility>

#include "understory/georeference/plot_file.h"

namespace understory {
namespace {

// Of a configuration by value, because a table is bound to what it changes.
std::string yaml(DenseMappingConfig config) {
  return dense_mapping_table(config).to_yaml(false);
}
std::string yaml(SparseMappingConfig config) {
  return sparse_mapping_table(config).to_yaml(false);
}

std::vector<std::string> named_files(const DenseMappingConfig& config) {
  const std::string& plots = config.inventory.stand.plots;
  return {config.odometry.machine_boxes_file, is_plot_text(plots) ? std::string() : plots};
}
std::vector<std::string> named_files(const SparseMappingConfig& config) {
  return {config.machine_boxes_file, config.correction.harvester.head_log};
}

Adapted<DenseMappingConfig> adapt_one(const DenseMappingConfig& asked, const ConfigOrigins& origins,
                                      const SensorTraits& traits, const RunConditions& conditions) {
  return adapt(asked, origins, traits, conditions);
}
Adapted<SparseMappingConfig> adapt_one(const SparseMappingConfig& asked,
                                       const ConfigOrigins& origins, const SensorTraits& /*traits*/,
                                       const RunConditions& conditions) {
  return adapt(asked, origins, conditions);
}

// Those of the settings that only the other front end has.
template <typename Table>
std::vector<std::string> keys_of(const std::vector<std::string>& settings, const Table& other) {
  std::vector<std::string> keys;
  for (const std::string& setting : settings) {
    const std::string key = setting.substr(0, setting.find('='));
    const auto& fields = other.fields();
    if (std::any_of(fields.begin(), fields.end(), [&](const auto& f) { return f.key == key; }))
      keys.push_back(key);
  }
  return keys;
}

// The problems of one front end. An unknown key that is one of the other's is named as such.
ConfigError with_other_front_end(const ConfigError& error, const std::vector<std::string>& keys,
                                 const std::string& other) {
  std::vector<std::string> problems = error.problems();
  for (std::string& problem : problems) {
    for (const std::string& key : keys) {
      if (problem.starts_with("--set " + key + ": unknown key"))
        problem = "--set " + key + ": is a setting of --front-end " + other;
    }
  }
  return ConfigError(std::move(problems));
}

}  // namespace

std::string name_of(const FrontEndConfig& config) {
  return std::holds_alternative<SparseMappingConfig>(config) ? kSparseFrontEnd : kDenseFrontEnd;
}

std::string yaml_of(const FrontEndConfig& config) {
  return std::visit([](const auto& one) { return yaml(one); }, config);
}

const EventLoopConfig& loop_of(const FrontEndConfig& config) {
  return std::visit([](const auto& one) -> const EventLoopConfig& { return one.loop; }, config);
}

const GeoreferenceConfig& georeference_of(const FrontEndConfig& config) {
  return std::visit([](const auto& one) -> const GeoreferenceConfig& { return one.georeference; },
                    config);
}

WorldFrame world_frame_of(const FrontEndConfig& config) {
  return std::visit([](const auto& one) { return one.output.world_frame; }, config);
}

std::vector<std::string> files_named_in(const FrontEndConfig& config) {
  return std::visit([](const auto& one) { return named_files(one); }, config);
}

void check_files_named_in(const FrontEndConfig& config) {
  if (const auto* sparse = std::get_if<SparseMappingConfig>(&config))
    (void)read_head_log(sparse->correction.harvester.head_log);
  // In which coordinates the plots are is known at the end: here only whether they can be read.
  if (const auto* dense = std::get_if<DenseMappingConfig>(&config)) {
    const std::string& plots = dense->inventory.stand.plots;
    if (!plots.empty()) check_plots(plots);
  }
}

bool depends_on_sensors(const FrontEndConfig& config) {
  return std::holds_alternative<DenseMappingConfig>(config);
}

ReadConfig<FrontEndConfig> read_front_end_config(const std::string& front_end,
                                                 const std::string& profile,
                                                 const std::string& file,
                                                 const std::vector<std::string>& settings,
                                                 Log& log) {
  const bool sparse = front_end == kSparseFrontEnd;
  try {
    if (sparse) {
      auto read = read_sparse_mapping_config(profile, file, settings, log);
      return {std::move(read.config), std::move(read.origins)};
    }
    auto read = read_dense_mapping_config(profile, file, settings);
    return {std::move(read.config), std::move(read.origins)};
  } catch (const ConfigError& error) {
    DenseMappingConfig dense;
    SparseMappingConfig stems;
    throw with_other_front_end(error,
                               sparse ? keys_of(settings, dense_mapping_table(dense))
                                      : keys_of(settings, sparse_mapping_table(stems)),
                               sparse ? kDenseFrontEnd : kSparseFrontEnd);
  }
}

FrontEndConfig reread_front_end_config(
    const std::string& front_end, const std::string& yaml, const std::string& origin,
    const std::function<std::string(const std::string&)>& found) {
  if (front_end == kSparseFrontEnd) {
    SparseMappingConfig config;
    reread(config, yaml, origin, found);
    return config;
  }
  DenseMappingConfig config;
  reread(config, yaml, origin, found);
  return config;
}

Adapted<FrontEndConfig> adapt_front_end(const FrontEndConfig& asked, const ConfigOrigins& origins,
                                        const SensorTraits& traits,
                                        const RunConditions& conditions) {
  return std::visit(
      [&](const auto& one) -> Adapted<FrontEndConfig> {
        auto adapted = adapt_one(one, origins, traits, conditions);
        return {std::move(adapted.config), std::move(adapted.changes)};
      },
      asked);
}

std::string commented_yaml(const Adapted<FrontEndConfig>& adapted, const ConfigOrigins& origins) {
  return std::visit(
      [&](const auto& one) {
        return commented_yaml(Adapted<std::decay_t<decltype(one)>>{one, adapted.changes}, origins);
      },
      adapted.config);
}

}  // namespace understory
