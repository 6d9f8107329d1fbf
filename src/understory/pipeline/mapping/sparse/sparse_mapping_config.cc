#include "understory/pipeline/mapping/sparse/sparse_mapping_config.h"

#include <memory>

#include "understory/pipeline/mapping/dense/dense_mapping_config.h"
#include "understory/util/error.h"

namespace understory {
namespace {

void read_boxes(SparseMappingConfig& config) {
  if (config.machine_boxes_file.empty()) return;
  config.front_end.machine_boxes = std::make_shared<const std::vector<MachineBox>>(
      read_machine_boxes(config.machine_boxes_file));
}

}  // namespace

ConfigTable sparse_mapping_table(SparseMappingConfig& config) {
  ConfigTable table;
  table.section("time_repair", [&] { EventOrderer::describe(table, config.loop.time_repair); });
  table.section("preprocess", [&] {
    table.add("machine_boxes_file", config.machine_boxes_file,
              "YAML of boxes around the machine: what lies in them is no stem; empty: none");
  });
  table.section("stems", [&] {
    describe(table, config.front_end);
    table.section("pace", [&] { describe(table, config.pace); });
  });
  describe(table, config.correction);
  table.section("georeference", [&] { describe(table, config.georeference); });
  table.section("output", [&] { describe(table, config.output); });
  table.section("run", [&] {
    table.add("checkpoint_interval_s", config.loop.checkpoint_interval_s, {0.1, 60.0}, "s",
              "of recording between checkpoints");
    table.add("realtime_queue_scans", config.loop.realtime_queue_scans, {1, 1000}, "scans",
              "--realtime: scans that may wait; older ones are dropped");
  });
  return table;
}

ReadConfig<SparseMappingConfig> read_sparse_mapping_config(const std::string& profile,
                                                           const std::string& file,
                                                           const std::vector<std::string>& settings,
                                                           Log& log) {
  SparseMappingConfig config;
  ConfigTable table = sparse_mapping_table(config);
  ConfigProblems problems;
  ConfigOrigins origins;
  problems.gather([&] {
    if (profile.empty()) return;
    // A profile serves both front ends: what it sets for scans alone is no news.
    std::vector<std::string> for_scans;
    const std::string before = table.to_yaml(false);
    table.read_yaml(profile_text(profile), "profile " + profile, &for_scans);
    note_yaml(table, profile_text(profile), "profile " + profile, origins);
    if (table.to_yaml(false) == before)
      log.info("profile " + profile + " changes nothing for stems: its settings are for scans");
  });
  problems.gather([&] {
    if (file.empty()) return;
    table.read_file(file);
    note_file(table, file, origins);
  });
  problems.gather([&] { table.set(settings); });
  note_settings(table, settings, origins);
  problems.gather([&] { read_boxes(config); });
  problems.gather([&] { check(config.georeference); });
  problems.throw_if_any();
  return {config, origins};
}

void reread(SparseMappingConfig& config, const std::string& yaml, const std::string& origin,
            const std::function<std::string(const std::string&)>& found) {
  sparse_mapping_table(config).read_yaml(yaml, origin);
  for (std::string* file : {&config.machine_boxes_file, &config.correction.harvester.head_log})
    *file = found(*file);
  read_boxes(config);
}

}  // namespace understory
