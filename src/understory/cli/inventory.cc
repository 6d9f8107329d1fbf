#include <fmt/format.h>

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <system_error>

#include "understory/cli/command.h"
#include "understory/cli/inventory_cloud.h"
#include "understory/cli/outcome.h"
#include "understory/cli/suggestion.h"
#include "understory/forest/inventory.h"
#include "understory/output/inventory_files.h"
#include "understory/output/report.h"
#include "understory/pipeline/judgement/inherited_trust.h"
#include "understory/pipeline/mapping/lidar_view.h"
#include "understory/pipeline/run_folder/run_folder.h"
#include "understory/recording/clouds/cloud_file.h"
#include "understory/recording/finding.h"
#include "understory/util/error.h"
#include "understory/util/output_guard.h"
#include "understory/util/version.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

struct InventoryOptions {
  std::string cloud;
  std::string folder;
  std::string config_file;
  std::vector<std::string> settings;
  bool print_config = false;
  bool overwrite = false;
  CloudFrame frame;
};

// The cloud itself, or the map of a run.
fs::path cloud_of(const std::string& given) {
  refuse_recording(given);
  fs::path path(given);
  if (!fs::exists(path)) throw InputError(given, "", "no such file or folder");
  return fs::is_directory(path) ? path / "map.laz" : path;
}

// What the user has to know before using the numbers.
void judge(const InventoryResult& inventory, const Log& log, RunSummary& summary) {
  const auto lower = [&](RunStatus status, const std::string& reason) {
    summary.status = status;
    summary.reasons.push_back(reason);
  };
  if (const Found damage = found(log, Finding::kDamage); damage.count > 0)
    lower(RunStatus::kPartial, "the cloud is not whole: " + damage.first);
  if (!inventory.too_sparse) return;
  if (inventory.trees.empty()) {
    lower(RunStatus::kUntrusted,
          "No stem could be measured: too few points lie near breast height. That the list of "
          "trees is empty does not mean that there are none.");
  } else {
    lower(RunStatus::kPartial,
          "Few points lie near breast height: trees are missing from the list.");
  }
}

RunSummary summary_of(const InventoryResult& inventory, const std::string& config,
                      const std::string& crs, const Log& log) {
  RunSummary summary;
  summary.command = "inventory";
  summary.version = kVersion;
  summary.config_yaml = config;
  summary.crs_wkt = crs;
  summary.counts["points"] = static_cast<std::int64_t>(inventory.points);
  summary.counts["trees"] = static_cast<std::int64_t>(inventory.trees.size());
  summary.quality["area_m2"] = inventory.area_m2;
  summary.quality["ground_measured_share"] = inventory.ground.measured_share;
  judge(inventory, log, summary);
  return summary;
}

// A finished inventory and what it was made from.
struct Stock {
  std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now();
  fs::path path;  // of the cloud
  bool of_run = false;
  StandCloud stand;
  InventoryResult inventory;
  MapPicture picture;
  StageTimes times;

  [[nodiscard]] double elapsed_s() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  }
};

void take_stock(const InventoryOptions& options, const InventoryConfig& config,
                const fs::path& results, CommandContext& context, Stock& stock) {
  {
    const ScopedTimer timer(stock.times, "reading");
    stock.stand = read_stand(stock.path, options.frame, context.log);
  }
  // The map of a run is in metres, and what is wrong with it is a matter of trust.
  if (!stock.stand.doubt.empty() && !stock.of_run)
    throw InputError(stock.path.string(), "", "expected metres and z up: " + stock.stand.doubt);
  const PointBlocks blocks = blocks_of(stock.stand.cloud);
  {
    const ScopedTimer timer(stock.times, "inventory");
    stock.inventory = take_inventory(blocks, config, context.progress,
                                     stock.of_run ? seen_in_run(options.cloud) : SeenTest());
  }
  const ScopedTimer timer(stock.times, "writing");
  blocks([&](std::span<const Eigen::Vector3d> points) {
    add_to_picture(stock.picture, points, stock.inventory.ground);
  });
  write_inventory_files(results, stock.inventory, stock.stand.cloud.coordinate_system);
}

// report.html and run.json.
RunSummary report_on(const InventoryOptions& options, const std::string& config,
                     const fs::path& results, const Stock& stock, Log& log) {
  const InventoryResult& inventory = stock.inventory;
  const PointCloudFile& cloud = stock.stand.cloud;
  RunSummary summary = summary_of(inventory, config, cloud.coordinate_system, log);
  summary.inputs.push_back(hash_input(stock.path));
  if (!stock.stand.doubt.empty())
    inherit({RunStatus::kUntrusted, {stock.stand.doubt}}, summary.status, summary.reasons);
  if (!stock.stand.suspicion.empty() && !stock.of_run)
    inherit({RunStatus::kUntrusted, {stock.stand.suspicion}}, summary.status, summary.reasons);
  inherit(trust_of_run(options.cloud, true), summary.status, summary.reasons);
  for (const std::string& remark : inventory.remarks)
    log.info(remark);
  summary.warnings = log.warnings();
  summary.stages = summarise(stock.times);
  summary.wall_s = stock.elapsed_s();
  summary.cpu_s = process_cpu_seconds();
  summary.peak_memory_mb = peak_memory_mb();
  ReportInput report;
  report.title = stock.path.filename().string();
  report.made_from =
      fmt::format("Inventory of a point cloud: {}, {} points", cloud.format, inventory.points);
  report.summary = summary;
  report.picture = &stock.picture;
  report.inventory = &inventory;
  report.north_is_up = !cloud.coordinate_system.empty();
  write_report(results / "report.html", report);
  for (const std::string& remark : inventory.remarks)
    summary.warnings.push_back({"inventory", remark, 1});
  summary.wall_s = stock.elapsed_s();  // all of it, the report too
  write_run_json(results / "run.json", summary);
  return summary;
}

int run_inventory(const InventoryOptions& options, CommandContext& context) {
  Stock stock;
  InventoryConfig config;
  ConfigTable table;
  describe(table, config);
  if (!options.config_file.empty()) table.read_file(options.config_file);
  table.set(options.settings);
  if (options.print_config) {
    std::printf("%s", table.to_yaml(true).c_str());
    return kExitDone;
  }
  if (options.cloud.empty() || options.folder.empty()) {
    throw ConfigError({"inventory needs a cloud (or run folder) and -o DIR; see --help"});
  }
  stock.path = cloud_of(options.cloud);
  stock.of_run = stock.path != fs::path(options.cloud);
  refuse_input_as_output(options.folder, {options.cloud, stock.path, options.config_file});
  const RunFolder place = RunFolder::claim(options.folder, options.overwrite);
  const fs::path folder = place.begin_results();
  take_stock(options, config, folder, context, stock);
  const RunSummary summary = report_on(options, table.to_yaml(false), folder, stock, context.log);
  place.commit(context.log);
  place.forget_state();
  return report_outcome(
      fmt::format("{} trees on {:.2f} ha; see {}", stock.inventory.trees.size(),
                  stock.inventory.area_m2 / 1e4, (place.path() / "report.html").string()),
      summary.status, summary.reasons);
}

}  // namespace

void add_inventory_command(CLI::App& app, Command& chosen) {
  auto options = std::make_shared<InventoryOptions>();
  CLI::App* command = app.add_subcommand(
      "inventory", "Ground, trees and stem diameters from any point cloud or from a run");
  command->add_option("CLOUD", options->cloud,
                      "Point cloud (.las, .laz, .ply, .pcd) in metres, z up; or a run folder");
  command->add_option("-o,--output", options->folder, "Folder for the results");
  command->add_option("--config", options->config_file, "YAML file with settings");
  command->add_option("--set", options->settings, "key=value, may be repeated");
  add_cloud_frame_options(*command, options->frame);
  command->add_flag("--print-config", options->print_config, "Print every key and its meaning");
  command->add_flag("--overwrite", options->overwrite, kOverwriteMeaning);
  command->footer(
      "Writes trees.csv, trees.gpkg, dtm.tif, chm.tif, report.html and run.json.\n"
      "Example:\n  understory inventory plot.laz -o plot-inventory");
  command->callback([options, &chosen] {
    chosen = [options](CommandContext& context) { return run_inventory(*options, context); };
  });
}

}  // namespace understory
