#include "understory/pipeline/inventory/cloud_inventory.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <span>

#include "understory/georeference/systems/coordinate_system.h"
#include "understory/output/inventory_files.h"
#include "understory/output/las_writer.h"
#include "understory/output/layer_files.h"
#include "understory/output/qgis_project.h"
#include "understory/pipeline/georeferencing/run_place.h"
#include "understory/pipeline/inventory/lidar_view.h"
#include "understory/pipeline/judgement/inherited_trust.h"
#include "understory/pipeline/judgement/run_judgement.h"
#include "understory/pipeline/run_folder/run_documents.h"
#include "understory/pipeline/run_folder/run_folder.h"
#include "understory/recording/finding.h"
#include "understory/util/error.h"
#include "understory/util/files/output_guard.h"
#include "understory/util/timing.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

// The cloud itself, or the map of a run.
fs::path cloud_of(const std::string& given) {
  fs::path path(given);
  if (!fs::exists(path)) throw InputError(given, "", "no such file or folder");
  return fs::is_directory(path) ? path / "map.laz" : path;
}

// What the user has to know before using the numbers. The map of a run is judged as `map` does.
void judge(const InventoryResult& inventory, bool of_run, const Log& log, RunDocuments& documents) {
  if (const Found damage = found(log, Finding::kDamage); damage.count > 0)
    documents.lower(RunStatus::kPartial, "the cloud is not whole: " + damage.first);
  if (!inventory.too_sparse) return;
  const bool any = !inventory.trees.empty();
  if (any && of_run) return;
  documents.lower(any || of_run ? RunStatus::kPartial : RunStatus::kUntrusted,
                  few_points_reason(any));
}

// A finished inventory and what it was made from.
struct Stock {
  fs::path path;  // of the cloud
  bool of_run = false;
  std::optional<RunPlace> place;  // of that run
  ResultFrames frames;            // of that run; the frame of a cloud is its own
  StandCloud stand;
  InventoryResult inventory;
  MapPicture picture;
};

// What the user says of the system of a cloud that names none.
void name_system(const InventoryRequest& request, Stock& stock) {
  if (request.coordinate_system.empty()) return;
  std::string& own = stock.stand.cloud.coordinate_system;
  if (stock.of_run || !own.empty())
    throw ConfigError({"--crs is for a cloud that names no coordinate system; " +
                       stock.path.string() + " is in " +
                       (own.empty() ? "the frame of its run" : own.substr(0, 60))});
  own = request.coordinate_system;
}

// map.qgs over the results.
void write_project(const Stock& stock, const fs::path& results) {
  QgisProject project;
  project.title = stock.path.filename().string();
  const std::string& own = stock.stand.cloud.coordinate_system;
  if (stock.of_run) {
    project.crs_wkt = stock.frames.layers.wkt();
    project.crs_code = stock.frames.layers.code();
  } else if (const auto system = CoordinateSystem::find(own)) {
    project.crs_wkt = system->wkt();
    project.crs_code = system->code();
  }
  write_qgis_project(results, project, false);
}

// A run's map and its frames.
Stock stock_of(const InventoryRequest& request) {
  Stock stock;
  stock.path = cloud_of(request.cloud);
  stock.of_run = stock.path != fs::path(request.cloud);
  if (!stock.of_run) return stock;
  stock.place = read_run_place(request.cloud);
  stock.frames.layers = read_layer_frame(request.cloud);
  const CoordinateSystem* system = stock.frames.layers.system();
  if (stock.place && system != nullptr && system->is_geographic())
    stock.frames.local = std::make_unique<LayerFrame>(stock.place->enu_from_world);
  return stock;
}

// How the cloud is written again: in its own system, or that of the layers of its run.
LasOptions las_options_of(const Stock& stock) {
  if (stock.of_run) return las_options(stock.frames.layers);
  LasOptions options;
  options.offset = stock.stand.cloud.origin.array().round();
  if (const auto system = CoordinateSystem::find(stock.stand.cloud.coordinate_system))
    options.crs_wkt = system->wkt();
  return options;
}

// map.laz: the cloud with classes, the tree of each point and heights above the ground.
void write_labelled_cloud(const Stock& stock, const fs::path& file, const ProgressSink& progress) {
  const PointCloudFile& cloud = stock.stand.cloud;
  LasOptions options = las_options_of(stock);
  options.trees = true;
  LasWriter writer(file, options);
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    progress.poll();
    const Eigen::Vector3d in_world = cloud.origin + cloud.points[i].cast<double>();
    const double height = stock.inventory.ground.height_above(in_world);
    const Eigen::Vector3d at = stock.of_run ? stock.frames.layers.from_world(in_world) : in_world;
    LasRecord record;
    record.x = at.x();
    record.y = at.y();
    record.z = at.z();
    if (!cloud.gps_time.empty()) record.gps_time = cloud.gps_time[i];
    if (!cloud.intensity.empty())
      record.intensity = static_cast<std::uint16_t>(std::clamp(cloud.intensity[i], 0.0F, 65535.0F));
    record.classification = stock.inventory.ground.las_class(height);
    record.tree_id = tree_at(stock.inventory, in_world, height);
    record.height_above_ground = static_cast<float>(height);
    writer.add(record);
  }
  writer.commit();
}

void take_stock(const InventoryRequest& request, const fs::path& results, Log& log,
                const ProgressSink& progress, StageTimes& times, Stock& stock) {
  {
    const ScopedTimer timer(times, "reading");
    stock.stand = stock.of_run
                      ? read_run_map(stock.path, stock.frames.layers, request.frame, log, progress)
                      : read_stand(stock.path, request.frame, log, progress);
    name_system(request, stock);
  }
  // The map of a run is in metres, and what is wrong with it is a matter of trust.
  if (!stock.stand.doubt.empty() && !stock.of_run)
    throw InputError(stock.path.string(), "", "expected metres and z up: " + stock.stand.doubt);
  const PointBlocks blocks = blocks_of(stock.stand.cloud);
  {
    const ScopedTimer timer(times, "inventory");
    stock.inventory = take_inventory(blocks, request.config, progress,
                                     stock.of_run ? seen_in_run(request.cloud) : SeenTest());
  }
  const ScopedTimer timer(times, "writing");
  polled(blocks, progress)([&](std::span<const Eigen::Vector3d> points) {
    add_to_picture(stock.picture, points, stock.inventory.ground, stock.frames.drawing());
  });
  if (stock.of_run) {
    write_inventory_files(results, stock.inventory, stock.frames.layers);
  } else {
    write_inventory_files(results, stock.inventory, stock.stand.cloud.coordinate_system);
  }
  if (stock.inventory.owners) write_labelled_cloud(stock, results / "map.laz", progress);
  write_project(stock, results);
}

void describe(const InventoryRequest& request, const Stock& stock, const Log& log,
              const ProgressSink& progress, RunDocuments& documents) {
  const InventoryResult& inventory = stock.inventory;
  const PointCloudFile& cloud = stock.stand.cloud;
  documents.add_input(stock.path, progress);
  if (!stock.of_run) documents.summary().crs_wkt = cloud.coordinate_system;
  documents.count("points", inventory.points);
  documents.count("trees", inventory.trees.size());
  documents.summary().quality["area_m2"] = inventory.area_m2;
  documents.summary().quality["ground_measured_share"] = inventory.ground.measured_share;
  judge(inventory, stock.of_run, log, documents);
  if (!stock.stand.doubt.empty()) documents.inherit({RunStatus::kUntrusted, {stock.stand.doubt}});
  if (!stock.stand.suspicion.empty() && !stock.of_run)
    documents.inherit({RunStatus::kUntrusted, {stock.stand.suspicion}});
  documents.inherit(trust_of_run(request.cloud, true));
  for (const std::string& remark : inventory.remarks)
    documents.remark("inventory", remark);
  ReportInput& report = documents.report();
  report.title = stock.path.filename().string();
  report.made_from =
      fmt::format("Inventory of a point cloud: {}, {} points", cloud.format, inventory.points);
  report.picture = &stock.picture;
  report.inventory = &inventory;
  report.north_is_up = !cloud.coordinate_system.empty();
  if (!stock.of_run || !stock.place) return;
  documents.place(*stock.place, stock.frames);
}

}  // namespace

RunOutcome run_inventory(const InventoryRequest& request, Log& log, const ProgressSink& progress) {
  StageTimes times;
  RunDocuments documents("inventory", request.config_record, times, log);
  if (!request.coordinate_system.empty()) (void)CoordinateSystem(request.coordinate_system);
  Stock stock = stock_of(request);
  refuse_input_as_output(request.run_folder, {request.cloud, stock.path, request.config_file});
  const RunFolder place = RunFolder::claim(request.run_folder, request.overwrite);
  const fs::path results = place.begin_results();
  take_stock(request, results, log, progress, times, stock);
  describe(request, stock, log, progress, documents);
  progress.poll();
  for (const std::string& remark : stock.inventory.remarks)
    log.info(remark);
  documents.write(results);
  place.commit(log);
  place.forget_state();
  return documents.outcome(fmt::format("{} trees on {:.2f} ha; see {}",
                                       stock.inventory.trees.size(), stock.inventory.area_m2 / 1e4,
                                       (place.path() / "report.html").string()));
}

}  // namespace understory
