#include "understory/pipeline/inventory/cloud_inventory.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "understory/evaluation/trajectory.h"
#include "understory/forest/slice/slice_inventory.h"
#include "understory/georeference/systems/coordinate_system.h"
#include "understory/output/clouds/las_stream.h"
#include "understory/output/inventory_files.h"
#include "understory/output/layers/layer_files.h"
#include "understory/output/layers/qgis_project.h"
#include "understory/output/plot_files.h"
#include "understory/pipeline/georeferencing/run_place.h"
#include "understory/pipeline/inventory/labelled_cloud.h"
#include "understory/pipeline/inventory/lidar_view.h"
#include "understory/pipeline/inventory/stand_documents.h"
#include "understory/pipeline/inventory/stand_plots.h"
#include "understory/pipeline/judgement/inherited_trust.h"
#include "understory/pipeline/judgement/run_judgement.h"
#include "understory/pipeline/judgement/stand_notes.h"
#include "understory/pipeline/pipeline_constants.h"
#include "understory/pipeline/run_folder/run_documents.h"
#include "understory/pipeline/run_folder/run_folder.h"
#include "understory/recording/finding.h"
#include "understory/util/error.h"
#include "understory/util/files/output_guard.h"
#include "understory/util/median.h"
#include "understory/util/parallel.h"
#include "understory/util/parallel_pieces.h"
#include "understory/util/timing.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

using namespace pipeline_constants::cloud_inventory;

// The cloud itself, or the map of a run.
fs::path cloud_of(const std::string& given) {
  fs::path path(given);
  if (!fs::exists(path)) throw InputError(given, "", "no such file or folder");
  return fs::is_directory(path) ? path / "map.laz" : path;
}

// Height that a tenth of the canopy reaches, m above the ground; 0 where nothing is known.
double canopy_height_of(const Raster& canopy) {
  std::vector<double> heights;
  for (const float height : canopy.values)
    if (std::isfinite(height)) heights.push_back(height);
  if (heights.empty()) return 0.0;
  const auto at =
      static_cast<std::ptrdiff_t>(kCanopyQuantile * static_cast<double>(heights.size() - 1));
  std::nth_element(heights.begin(), heights.begin() + at, heights.end());
  return heights[static_cast<std::size_t>(at)];
}

// Whether the list holds any tree that may belong to a high canopy. Thin stems within foliage may
// be found in a crown that is upside down.
bool has_grown_trees(const InventoryResult& inventory) {
  if (inventory.trees.size() > inventory.stems.size()) return true;  // by their crowns
  return std::any_of(inventory.stems.begin(), inventory.stems.end(), [](const StemFit& stem) {
    return !stem.in_foliage && 2.0 * stem.radius_m >= kThinnestGrownM;
  });
}

// Why the list of a cloud in which stems could be seen is wrong; empty: nothing says so.
std::string list_complaint(const InventoryResult& inventory, bool unit_given) {
  const double canopy_m = canopy_height_of(inventory.canopy);
  if (!has_grown_trees(inventory) && !inventory.too_sparse && canopy_m > kTallWithoutStemsM)
    return fmt::format(
        "no stem was found{}, though points stand {:.0f} m above the ground: z may not be up "
        "(--up), or the unit not the metre (--unit-m)",
        inventory.trees.empty() ? "" : " but thin ones", canopy_m);
  std::vector<double> heights;
  std::vector<double> ratios;
  for (const Tree& tree : inventory.trees) {
    if (!std::isfinite(tree.height_m) || !(tree.dbh_m > 0.0)) continue;
    heights.push_back(tree.height_m);
    ratios.push_back(tree.height_m / tree.dbh_m);
  }
  if (unit_given || ratios.size() < kLeastTrees) return {};
  const double height_m = upper_median(heights);
  const double ratio = upper_median(ratios);
  if (height_m < kTallM || ratio < kMostSlender) return {};
  return fmt::format(
      "the trees are {:.0f} m high and {:.0f} times as high as thick: heights may be in feet, and "
      "the plane in metres. Bring both to metres first (--unit-m 1 if it is right as it is)",
      height_m, ratio);
}

constexpr const char* kNoStemInCut =
    "no stem was found in the cut: no ring of points of the size of a stem has an empty inside";

// A finished inventory and what it was made from.
struct Stock {
  fs::path path;  // of the cloud
  bool of_run = false;
  std::optional<RunPlace> place;  // of that run
  ResultFrames frames;            // of that run; the frame of a cloud is its own
  StandCloud stand;
  InventoryResult inventory;
  std::vector<PlotOutline> plots;
  StandResult figures;
  MapPicture picture;
};

// Metres from the lowest to the highest point.
double thickness_of(const StandCloud& stand) {
  const PointCloudFile& cloud = stand.cloud;
  if (stand.streamed) return stand.streamed->tiles->thickness_m();
  if (cloud.points.empty()) return 0.0;
  const auto lower = [](const Eigen::Vector3f& a, const Eigen::Vector3f& b) {
    return a.z() < b.z();
  };
  const auto [low, high] = std::minmax_element(cloud.points.begin(), cloud.points.end(), lower);
  return static_cast<double>(high->z() - low->z());
}

// Diameters of a cloud whose places are rounded.
void mark_coarse(InventoryResult& inventory) {
  for (Tree& tree : inventory.trees)
    if (tree.quality == "good" || tree.quality == "one_side") tree.quality = "coarse";
}

bool has_diameters(const InventoryResult& inventory) {
  return std::any_of(inventory.trees.begin(), inventory.trees.end(),
                     [](const Tree& tree) { return std::isfinite(tree.dbh_m); });
}

// What the user has to know before using the numbers. The map of a run is judged as `map` does.
void judge(const Stock& stock, const InventoryRequest& request, const Log& log,
           RunDocuments& documents) {
  const InventoryResult& inventory = stock.inventory;
  const bool of_run = stock.of_run;
  if (const Found damage = found(log, Finding::kDamage); damage.count > 0)
    documents.lower(RunStatus::kPartial, "the cloud is not whole: " + damage.first);
  if (!stock.stand.coarse.empty() && has_diameters(inventory))
    documents.lower(RunStatus::kUntrusted, stock.stand.coarse);
  if (request.slice) {
    if (inventory.trees.empty()) documents.lower(RunStatus::kUntrusted, kNoStemInCut);
    return;
  }
  if (!of_run) {
    const std::string complaint = list_complaint(inventory, request.frame.unit_m > 0.0);
    if (!complaint.empty()) documents.lower(RunStatus::kUntrusted, complaint);
  }
  if (!inventory.two_images.empty()) documents.lower(RunStatus::kUntrusted, inventory.two_images);
  const bool by_crowns = inventory.trees.size() > inventory.stems.size();
  if (!inventory.too_sparse || inventory.open_land || (inventory.from_above && by_crowns)) return;
  const bool any = !inventory.trees.empty();
  if (any && of_run) return;
  std::string reason = few_points_reason(any);
  if (const double thick_m = thickness_of(stock.stand); !any && thick_m < kThinCutM)
    reason += fmt::format(
        ". It is {:.2f} m thick: give --slice if it is a cut through a stand near breast height",
        thick_m);
  documents.lower(any || of_run ? RunStatus::kPartial : RunStatus::kUntrusted, reason);
}

// What the user says of the system of a cloud that names none.
void name_system(const InventoryRequest& request, Stock& stock) {
  if (request.coordinate_system.empty()) return;
  std::string& own = stock.stand.cloud.coordinate_system;
  if (stock.of_run || !own.empty())
    throw ConfigError({"--crs is for a cloud that names no coordinate system; " +
                       stock.path.string() + " is in " +
                       (own.empty() ? "the frame of its run" : own.substr(0, 60))});
  // The user's own words, so the coordinates are to be those of the system.
  if ((request.frame.unit_m != 0.0 && request.frame.unit_m != 1.0) ||
      (!request.frame.up.empty() && request.frame.up != "z"))
    throw ConfigError(
        {"--crs does not hold for coordinates that --unit-m or --up changes: leave "
         "it out, or convert the cloud first"});
  own = request.coordinate_system;
}

CloudFrame with_system(const InventoryRequest& request) {
  CloudFrame frame = request.frame;
  frame.coordinate_system = request.coordinate_system;
  return frame;
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
  write_qgis_project(results, project);
}

// A run's map and its frames.
// Of the report: the run, or the file of the cloud.
std::string title_of(const Stock& stock) {
  if (!stock.of_run) return stock.path.filename().string();
  return fs::absolute(stock.path).lexically_normal().parent_path().filename().string();
}

Stock stock_of(const InventoryRequest& request) {
  Stock stock;
  stock.path = cloud_of(request.cloud);
  stock.of_run = stock.path != fs::path(request.cloud);
  if (!stock.of_run) return stock;
  if (request.slice)
    throw ConfigError({"--slice is for a cloud that is one thin cut, not for the map of a run"});
  stock.place = read_run_place(request.cloud);
  stock.frames.layers = read_layer_frame(request.cloud);
  const CoordinateSystem* system = stock.frames.layers.system();
  if (stock.place && system != nullptr && system->is_geographic())
    stock.frames.local = std::make_unique<LayerFrame>(stock.place->enu_from_world);
  return stock;
}

// How the cloud is written again: in its own system, or that of the layers of its run.
LasOptions las_options_of(const Stock& stock) {
  LasOptions options;
  if (stock.of_run) {
    options = las_options(stock.frames.layers);
  } else {
    options.offset = stock.inventory.origin.array().round();  // near most of the points
    if (const auto system = CoordinateSystem::find(stock.stand.cloud.coordinate_system))
      options.crs_wkt = system->wkt();
  }
  options.trees = true;
  options.gps_week_time = stock.stand.cloud.gps_week_time;
  return options;
}

// Where the scanner was: by the file that the user names, else by the run.
std::vector<Eigen::Vector3d> scanner_places(const InventoryRequest& request, const Stock& stock) {
  if (request.trajectory.empty())
    return stock.of_run ? places_in_run(request.cloud) : std::vector<Eigen::Vector3d>();
  std::vector<Eigen::Vector3d> places;
  for (const StampedPose& pose : read_trajectory(request.trajectory))
    places.push_back(pose.world_from_body.translation());
  return places;
}

// The frame of the layers: that of the run, or the cloud's own.
const LayerFrame& layers_of(const Stock& stock, const LayerFrame& own) {
  return stock.of_run ? stock.frames.layers : own;
}

// Figures of the stand and of its plots.
void take_figures(const StandTableConfig& config, Stock& stock) {
  const LayerFrame own;
  stock.figures = take_stand(stock.inventory, config, stock.plots, layers_of(stock, own));
}

// Before the work: plots of another place, or in another system. The frame of a run's layers may be
// turned, so its plots are judged by what was seen.
void check_plots_of(const StandTableConfig& config, const Stock& stock) {
  if (stock.of_run || stock.plots.empty()) return;
  Eigen::AlignedBox2d box;
  if (stock.stand.streamed) {
    const GroundArea extent = stock.stand.streamed->tiles->extent();
    box = Eigen::AlignedBox2d(extent.low, extent.high);
  } else {
    for (const Eigen::Vector3f& point : stock.stand.cloud.points)
      box.extend(point.head<2>().cast<double>());
    box.translate(stock.stand.cloud.origin.head<2>());
  }
  refuse_plots_outside(config, stock.plots, box.min(), box.max());
}

// trees.csv, trees.gpkg, the rasters, and of plots plots.csv and plot_classes.csv.
void write_tables(const InventoryRequest& request, const fs::path& results, const Stock& stock) {
  const StandTable& stand = stock.figures.table;
  if (request.slice) {
    write_slice_files(results, stock.inventory, stock.stand.cloud.coordinate_system);
    return;
  }
  if (stock.of_run) {
    write_inventory_files(results, stock.inventory, stock.frames.layers, stand.plots);
  } else {
    write_inventory_files(results, stock.inventory, stock.stand.cloud.coordinate_system,
                          stand.plots);
  }
  if (asks_for_plots(request.config.stand)) write_plot_tables(results, stand);
}

PointBlocks points_of(const StandCloud& stand) {
  if (!stand.streamed) return blocks_of(stand.cloud);
  return [&stand](const PointVisitor& visit) { stand.streamed->tiles->all(visit); };
}

void read_cloud_of(const InventoryRequest& request, const fs::path& work, Log& log,
                   const ProgressSink& progress, Stock& stock) {
  const CloudTiling tiling{request.tiles, work, available_threads(), request.copc};
  // A cut is small, and looked at as a whole.
  const CloudTiling* tiles = request.slice ? nullptr : &tiling;
  stock.stand = stock.of_run ? read_run_map(stock.path, stock.frames.layers, request.frame, log,
                                            progress, tiles)
                             : read_stand(stock.path, with_system(request), log, progress, tiles);
  name_system(request, stock);
  stock.plots = plots_of(request.config.stand, stock.of_run ? stock.frames.layers.wkt()
                                                            : stock.stand.cloud.coordinate_system);
  // The map of a run is in metres, and what is wrong with it is a matter of trust.
  if (!stock.stand.doubt.empty() && !stock.of_run && !request.slice)
    throw InputError(stock.path.string(), "", "expected metres and z up: " + stock.stand.doubt);
  check_plots_of(request.config.stand, stock);
}

InventoryResult inventory_of(const InventoryRequest& request, const Stock& stock,
                             const PointBlocks& blocks, const ProgressSink& progress) {
  if (request.slice) return take_slice(blocks, stock.path.string(), request.config, progress);
  const Lookouts seen = stock.of_run ? seen_in_run(request.cloud) : Lookouts();
  const std::vector<Eigen::Vector3d> scanner = scanner_places(request, stock);
  InventoryConfig config = request.config;
  if (stock.of_run) config.beam = beams_in_run(config.beam, request.cloud);
  if (!stock.stand.streamed) return take_inventory(blocks, config, progress, seen, scanner);
  return take_inventory(*stock.stand.streamed->tiles, config, progress, seen, scanner);
}

void take_stock(const InventoryRequest& request, const RunFolder& place, const fs::path& results,
                Log& log, const ProgressSink& progress, StageTimes& times, Stock& stock) {
  {
    const ScopedTimer timer(times, "reading");
    read_cloud_of(request, place.work(), log, progress, stock);
  }
  const PointBlocks blocks = points_of(stock.stand);
  {
    const ScopedTimer timer(times, "inventory");
    stock.inventory = inventory_of(request, stock, blocks, progress);
    if (!stock.stand.coarse.empty()) mark_coarse(stock.inventory);
    if (!request.slice) take_figures(request.config.stand, stock);
  }
  const ScopedTimer timer(times, "writing");
  polled(blocks, progress)([&](std::span<const Eigen::Vector3d> points) {
    add_to_picture(stock.picture, points, stock.inventory.ground, stock.frames.drawing());
  });
  write_tables(request, results, stock);
  if (stock.inventory.owners || stock.inventory.owner_tiles) {
    LasOptions options = las_options_of(stock);
    if (request.copc) ask_for_copc(options, log);
    const std::uint64_t too_far = write_labelled_cloud(
        {stock.stand, stock.inventory, stock.of_run ? &stock.frames.layers : nullptr}, options,
        results / "map.laz", progress);
    if (too_far > 0)
      stock.inventory.remarks.push_back(fmt::format(
          "{} points lie over 2,147 km from the others and are not in map.laz.", too_far));
  }
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
  if (!request.slice) note_doubts(inventory, documents.summary());
  documents.summary().quality["area_m2"] = inventory.area_m2;
  documents.summary().quality["ground_measured_share"] = inventory.ground.measured_share;
  judge(stock, request, log, documents);
  if (!stock.stand.doubt.empty() && !request.slice)
    documents.inherit({RunStatus::kUntrusted, {stock.stand.doubt}});
  if (!stock.stand.suspicion.empty() && !stock.of_run && !request.slice)
    documents.inherit({RunStatus::kUntrusted, {stock.stand.suspicion}});
  documents.inherit(trust_of_run(request.cloud, true));
  for (const std::string& remark : inventory.remarks)
    documents.remark("inventory", remark);
  if (!request.slice) describe_stand(stock.figures, documents);
  if (!request.config.stand.plots.empty() && !is_plot_text(request.config.stand.plots))
    documents.add_input(request.config.stand.plots, progress);
  ReportInput& report = documents.report();
  report.title = title_of(stock);
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
  const StandTableConfig& stand = request.config.stand;
  if (request.slice && asks_for_plots(stand))
    throw ConfigError(
        {"--plots and --plot-grid need the ground between the stems, which a cut "
         "(--slice) does not show"});
  refuse_input_as_output(request.run_folder,
                         {request.cloud, stock.path, request.config_file,
                          is_plot_text(stand.plots) ? std::string() : stand.plots});
  const RunFolder place = RunFolder::claim(request.run_folder, request.overwrite);
  const fs::path results = place.begin_results();
  take_stock(request, place, results, log, progress, times, stock);
  describe(request, stock, log, progress, documents);
  progress.poll();
  for (const std::string& remark : stock.inventory.remarks)
    log.info(remark);
  documents.write(results);
  place.commit(log);
  place.forget_state();
  return documents.outcome((request.slice ? std::string() : terminal_notes(stock.inventory)) +
                           fmt::format("{} tree{}{}; see {}", stock.inventory.trees.size(),
                                       stock.inventory.trees.size() == 1 ? "" : "s",
                                       stand_in_words(stock.figures.table),
                                       (place.path() / "report.html").string()));
}

}  // namespace understory
