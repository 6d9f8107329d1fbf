#include "understory/pipeline/inventory/cloud_inventory.h"

#include <fmt/format.h>

#include <chrono>
#include <span>

#include "understory/output/inventory_files.h"
#include "understory/output/report.h"
#include "understory/pipeline/judgement/inherited_trust.h"
#include "understory/pipeline/mapping/lidar_view.h"
#include "understory/pipeline/run_folder/run_folder.h"
#include "understory/recording/finding.h"
#include "understory/util/error.h"
#include "understory/util/files/output_guard.h"
#include "understory/util/timing.h"
#include "understory/util/version.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

// The cloud itself, or the map of a run.
fs::path cloud_of(const std::string& given) {
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
          "No stem could be measured: too few points lie near breast height. The list of trees is "
          "empty, but the stand need not be.");
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

void take_stock(const InventoryRequest& request, const fs::path& results, Log& log,
                const ProgressSink& progress, Stock& stock) {
  {
    const ScopedTimer timer(stock.times, "reading");
    stock.stand = read_stand(stock.path, request.frame, log);
  }
  // The map of a run is in metres, and what is wrong with it is a matter of trust.
  if (!stock.stand.doubt.empty() && !stock.of_run)
    throw InputError(stock.path.string(), "", "expected metres and z up: " + stock.stand.doubt);
  const PointBlocks blocks = blocks_of(stock.stand.cloud);
  {
    const ScopedTimer timer(stock.times, "inventory");
    stock.inventory = take_inventory(blocks, request.config, progress,
                                     stock.of_run ? seen_in_run(request.cloud) : SeenTest());
  }
  const ScopedTimer timer(stock.times, "writing");
  blocks([&](std::span<const Eigen::Vector3d> points) {
    add_to_picture(stock.picture, points, stock.inventory.ground);
  });
  write_inventory_files(results, stock.inventory, stock.stand.cloud.coordinate_system);
}

// report.html and run.json.
RunSummary report_on(const InventoryRequest& request, const fs::path& results, const Stock& stock,
                     Log& log) {
  const InventoryResult& inventory = stock.inventory;
  const PointCloudFile& cloud = stock.stand.cloud;
  RunSummary summary = summary_of(inventory, request.config_yaml, cloud.coordinate_system, log);
  summary.inputs.push_back(hash_input(stock.path));
  if (!stock.stand.doubt.empty())
    inherit({RunStatus::kUntrusted, {stock.stand.doubt}}, summary.status, summary.reasons);
  if (!stock.stand.suspicion.empty() && !stock.of_run)
    inherit({RunStatus::kUntrusted, {stock.stand.suspicion}}, summary.status, summary.reasons);
  inherit(trust_of_run(request.cloud, true), summary.status, summary.reasons);
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

}  // namespace

InventoryOutcome run_inventory(const InventoryRequest& request, Log& log,
                               const ProgressSink& progress) {
  Stock stock;
  stock.path = cloud_of(request.cloud);
  stock.of_run = stock.path != fs::path(request.cloud);
  refuse_input_as_output(request.run_folder, {request.cloud, stock.path, request.config_file});
  const RunFolder place = RunFolder::claim(request.run_folder, request.overwrite);
  const fs::path results = place.begin_results();
  take_stock(request, results, log, progress, stock);
  const RunSummary summary = report_on(request, results, stock, log);
  place.commit(log);
  place.forget_state();
  return {summary.status, summary.reasons,
          fmt::format("{} trees on {:.2f} ha; see {}", stock.inventory.trees.size(),
                      stock.inventory.area_m2 / 1e4, (place.path() / "report.html").string())};
}

}  // namespace understory
