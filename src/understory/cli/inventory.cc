#include <fmt/format.h>

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <system_error>

#include "understory/cli/command.h"
#include "understory/forest/inventory.h"
#include "understory/output/inventory_files.h"
#include "understory/output/report.h"
#include "understory/pipeline/lidar_view.h"
#include "understory/pipeline/run_folder.h"
#include "understory/recording/cloud_file.h"
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
};

// The cloud itself, or the map of a run.
fs::path cloud_of(const std::string& given) {
  fs::path path(given);
  if (!fs::is_directory(path)) return path;
  fs::path map = path / "map.laz";
  if (!fs::exists(map)) {
    throw InputError(given, "", "expected a point cloud, or a run folder with a map.laz in it");
  }
  return map;
}

PointBlocks blocks_of(const PointCloudFile& cloud) {
  return [&cloud](const PointVisitor& visit) {
    constexpr std::size_t kBlock = 65'536;
    std::vector<Eigen::Vector3d> block;
    block.reserve(kBlock);
    for (const Eigen::Vector3f& point : cloud.points) {
      block.push_back(cloud.origin + point.cast<double>());
      if (block.size() == kBlock) {
        visit(block);
        block.clear();
      }
    }
    if (!block.empty()) visit(block);
  };
}

// What the user has to know before using the numbers.
void judge(const InventoryResult& inventory, const Log& log, RunSummary& summary) {
  const auto lower = [&](RunStatus status, const std::string& reason) {
    summary.status = status;
    summary.reasons.push_back(reason);
  };
  for (const Log::Warning& warning : log.warnings()) {
    if (warning.key == "recording.damaged")
      lower(RunStatus::kPartial, "the cloud is not whole: " + warning.first_message);
  }
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

int run_inventory(const InventoryOptions& options, CommandContext& context) {
  const auto start = std::chrono::steady_clock::now();
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
  const fs::path path = cloud_of(options.cloud);
  refuse_input_as_output(options.folder, {options.cloud, path, options.config_file});
  const RunFolder place = RunFolder::claim(options.folder, options.overwrite);
  const fs::path folder = place.begin_results();
  StageTimes times;
  PointCloudFile cloud;
  {
    const ScopedTimer timer(times, "reading");
    cloud = read_cloud(path.string(), context.log);
  }
  const PointBlocks blocks = blocks_of(cloud);
  InventoryResult inventory;
  {
    const ScopedTimer timer(times, "inventory");
    const SeenTest in_view =
        path == fs::path(options.cloud) ? SeenTest() : seen_in_run(options.cloud);
    inventory = take_inventory(blocks, config, context.progress, in_view);
  }
  MapPicture picture;
  {
    const ScopedTimer timer(times, "writing");
    blocks([&](std::span<const Eigen::Vector3d> points) {
      add_to_picture(picture, points, inventory.ground);
    });
    write_inventory_files(folder, inventory, cloud.coordinate_system);
  }
  RunSummary summary =
      summary_of(inventory, table.to_yaml(false), cloud.coordinate_system, context.log);
  summary.inputs.push_back(hash_input(path));
  for (const std::string& remark : inventory.remarks)
    context.log.info(remark);
  summary.warnings = context.log.warnings();
  summary.stages = summarise(times);
  summary.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  summary.cpu_s = process_cpu_seconds();
  summary.peak_memory_mb = peak_memory_mb();
  ReportInput report;
  report.title = path.filename().string();
  report.made_from =
      fmt::format("Inventory of a point cloud: {}, {} points", cloud.format, inventory.points);
  report.summary = summary;
  report.picture = &picture;
  report.inventory = &inventory;
  report.north_is_up = !cloud.coordinate_system.empty();
  write_report(folder / "report.html", report);
  for (const std::string& remark : inventory.remarks)
    summary.warnings.push_back({"inventory", remark, 1});
  write_run_json(folder / "run.json", summary);
  place.commit(context.log);
  place.forget_state();
  std::printf("%zu trees on %.2f ha; see %s\n", inventory.trees.size(), inventory.area_m2 / 1e4,
              (place.path() / "report.html").string().c_str());
  for (const std::string& reason : summary.reasons)
    std::fprintf(stderr, "%s: %s\n", to_string(summary.status).c_str(), reason.c_str());
  return summary.status == RunStatus::kComplete ? kExitDone : kExitUntrusted;
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
