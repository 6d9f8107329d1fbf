#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "understory/evaluation/world_frame.h"
#include "understory/forest/inventory.h"
#include "understory/forest/stand/stand_table.h"
#include "understory/forest/trees/tree_fall.h"
#include "understory/georeference/systems/layer_frame.h"
#include "understory/output/report/map_picture.h"
#include "understory/output/run_summary.h"
#include "understory/util/time.h"

namespace understory {

// One scan of the run as the report shows it (world frame, finished trajectory).
struct ReportScan {
  TimeNs stamp = 0;
  Eigen::Vector3f position = Eigen::Vector3f::Zero();
  float wall_ms = 0.0F;
  float inlier_ratio = std::numeric_limits<float>::quiet_NaN();  // NaN: the scan had no match
  float fitness_m2 = std::numeric_limits<float>::quiet_NaN();
  bool weak = false;  // gated, unmatched or degenerate: position is mostly a prediction
};

// A loop that was tried: its two views were matched.
struct ReportLoop {
  Eigen::Vector3d from = Eigen::Vector3d::Zero();
  Eigen::Vector3d to = Eigen::Vector3d::Zero();
  TimeNs from_stamp = 0;
  TimeNs to_stamp = 0;
  bool accepted = false;
  double correction_m = 0.0;  // by how much it disagreed with the trajectory before
  std::string reason;         // why rejected
};

// A fix of the receiver's antenna (world frame).
struct ReportFix {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();
  bool used = false;  // had a weight in the fit of the path
};

// Errors against a known truth (simulated or surveyed). Series may be empty.
struct ReportTruth {
  std::string alignment;  // "none (the first pose as recorded)", "SE(3)" ...
  double ape_rmse_m = std::numeric_limits<double>::quiet_NaN();
  double ape_max_m = std::numeric_limits<double>::quiet_NaN();
  double drift_end_m = std::numeric_limits<double>::quiet_NaN();
  double drift_percent = std::numeric_limits<double>::quiet_NaN();
  std::vector<std::pair<double, double>> ape_over_time;   // seconds since start, metres
  std::vector<std::pair<std::string, std::string>> more;  // name, value with unit
};

// Two views as the odometry placed them (P0 figures 9 and 10).
struct ReportPair {
  int later = 0;
  int earlier = 0;
  double overlap = 0.0;  // of the sectors that they see
  double error_m = 0.0;  // of their stems that lie in both
  bool acceptable = false;
};

// All pairs of views, as many as fit (P1 figure 5): a row per earlier view, a column per later one.
// NaN: nothing in common.
struct ReportViewMatrix {
  int views = 0;
  int side = 0;
  std::vector<float> overlap;
  std::vector<float> error_m;
};

// How a map of stems corrected itself (graph/self_correction/self_correction.h).
struct ReportCorrection {
  struct Figure {
    std::string name;  // with unit
    double before = 0.0;
    double after = 0.0;
    int digits = 3;
  };
  using Pairs = std::vector<std::pair<double, double>>;  // later view, earlier view
  std::vector<Figure> figures;
  Pairs kept;
  Pairs tried;  // and not kept
  std::string ended;
  std::vector<ReportPair> pairs;  // drawn at random; empty: not drawn
  double acceptable_m = 0.3;      // P0 (27)
  double acceptable_per_overlap_m = 0.5;
  double min_overlap = 0.4;
  ReportViewMatrix matrix_before;
  ReportViewMatrix matrix_after;
  std::vector<Eigen::Vector2f> sights_before;  // of all views, world frame
  std::vector<Eigen::Vector2f> sights_after;
  Eigen::Vector2f max_moved = Eigen::Vector2f::Zero();
  double ring_m = 5.0;
  std::vector<double> trees_per_ha;  // in rings about the way
};

// How one map of trees leads to another (P1 figure 7), world frame of the first.
struct ReportDeformation {
  struct Arrow {
    Eigen::Vector2d at = Eigen::Vector2d::Zero();  // a tree of the second map
    Eigen::Vector2d by = Eigen::Vector2d::Zero();  // towards the first one, smoothed, metres
  };
  std::vector<Arrow> arrows;
  std::vector<Eigen::Vector2d> path_of_first;  // empty: not known
  std::vector<Eigen::Vector2d> path_of_second;
  std::vector<Eigen::Vector2d> moved_path_of_second;  // by the field
  double mean_m = 0.0;  // distance of the trees that both maps hold, before they were moved
};

// All that the report shows. What is empty is left out of the page.
struct ReportInput {
  std::string title;      // name of the recording or cloud
  std::string made_from;  // "MCAP, OS-0-128, 2,410 scans" in words
  RunSummary summary;
  const MapPicture* picture = nullptr;         // not owned
  const InventoryResult* inventory = nullptr;  // not owned
  const StandTable* stand = nullptr;           // not owned; of an inventory, or of `trees`
  const std::vector<Tree>* trees = nullptr;    // not owned; without an inventory
  std::vector<TreeFall> falls;                 // of these trees
  std::vector<ReportScan> scans;
  std::vector<ReportFix> fixes;
  double sensor_period_ms = 0.0;  // 0: unknown
  // Finest cells of the map, to whose means scans are matched, metres; 0: it holds single points.
  double map_cell_m = 0.0;
  std::vector<ReportLoop> loops;
  std::size_t loops_not_listed = 0;  // views that look like an earlier place, and matching refuted
  bool loop_closure_enabled = true;
  std::optional<ReportCorrection> correction;
  std::optional<ReportDeformation> deformation;
  std::optional<ReportTruth> truth;
  std::vector<std::string> remarks;           // what to distrust in results of this kind
  WorldFrame world_frame = WorldFrame::kEnu;  // the axes of the lists of trees, as in the files
  bool north_is_up = false;                   // the frame that the map is drawn in has its north up
  // The frame that the map is drawn in, and `picture` with it; null: the world frame.
  const LayerFrame* drawing = nullptr;  // not owned
  bool has_fixes = false;               // of a GNSS receiver
  // Of a run that was moved: how its scans were matched stands in its own report.
  bool moved = false;
  std::vector<std::string> not_moved;  // names of its results that only its own folder has
  // Of `trees` without an inventory: they come from a cloud, so that heights are measured.
  bool trees_of_cloud = false;
  double area_m2 = 0.0;  // squares with points, of these trees; 0: unknown
};

// One self-contained page that needs no network, and no scripts to be read. Its scripts move the
// map, sort and filter the table of trees, and leaf through the sheets of single trees. It lists
// the results that lie in its folder by then, and run.json, which is written last. Throws
// OutputError.
void write_report(const std::filesystem::path& path, const ReportInput& input);
// `files`: names of the results beside it.
[[nodiscard]] std::string report_html(const ReportInput& input,
                                      const std::vector<std::string>& files = {});

}  // namespace understory
