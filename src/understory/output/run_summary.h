#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/georeference/systems/geodetic.h"
#include "understory/util/config/config_origins.h"
#include "understory/util/log.h"
#include "understory/util/progress.h"
#include "understory/util/timing.h"

namespace understory {

// The verdict on a run. Partial: good, but incomplete or wrong in single scans; untrusted: the map
// is probably wrong.
enum class RunStatus { kComplete, kPartial, kUntrusted };
// The name of a status in run.json.
[[nodiscard]] std::string to_string(RunStatus status);

// An input file of a run, as run.json names it.
struct InputHash {
  std::string file;
  std::uint64_t bytes = 0;
  std::string sha256;  // empty: it could not be read any more
};

// SHA-256 of a file's bytes, lower-case hexadecimal. Polls `progress`. Throws InputError if it
// cannot be read.
[[nodiscard]] InputHash hash_input(const std::filesystem::path& path,
                                   const ProgressSink& progress = {});

// SHA-256 of a text, lower-case hexadecimal.
[[nodiscard]] std::string hash_text(const std::string& text);

// Time that one stage took, over all its runs.
struct StageSummary {
  Distribution wall_ms;
  Distribution cpu_ms;
  double total_wall_s = 0.0;
  // Mean CPU time of each tenth of the stage's runs in order, from 100 runs on: whether the work
  // grows with the length of the run.
  std::vector<double> cpu_ms_by_tenth = {};
};
[[nodiscard]] std::map<std::string, StageSummary> summarise(const StageTimes& times);

// Means over so many scans one after another: how the work on a scan goes on over a run.
struct ScanBlock {
  double from_s = 0.0;  // since the first scan
  std::size_t scans = 0;
  double wall_ms = 0.0;
  double cpu_ms = 0.0;
  double map_size = 0.0;  // points or cells of the local map
};
// Means of neighbouring blocks, as few of them together as give `most` blocks at most. The last one
// may hold fewer. Each block holds a scan at least.
[[nodiscard]] std::vector<ScanBlock> joined(const std::vector<ScanBlock>& blocks, std::size_t most);

using Figure = std::variant<std::int64_t, double, std::string, bool>;

// How high the lidar looked: what tells which tops of trees it cannot have seen.
struct LidarViewFigures {
  std::vector<double> body_from_lidar;  // 4 x 4, row by row
  std::vector<double> highest_deg;      // by azimuth in the lidar frame from -180 degrees on; NaN
};

// Where the world frame of a run lies on the globe, and what its layers are in: map.laz, rasters,
// trees.gpkg.
struct RunPlace {
  bool on_globe = false;  // what follows holds; else the layers are in the world frame
  std::string reason;     // why not
  std::string method;     // that found it, as `georeference --method` names it
  // Of the receiver whose fixes the run holds, in the body frame, metres; nothing where unknown.
  std::optional<Eigen::Vector3d> antenna_in_body;
  std::optional<Eigen::Vector3d> second_antenna_in_body;  // that its headings lead to
  Pose enu_from_world;                                    // to east, north, up at the origin
  GeodeticPlace origin;
  std::string coordinate_system;  // "EPSG:3067", or its name
  std::string heights;            // what heights of the layers are above, in words
  double north_deg = 0.0;         // true north clockwise from grid north, at the origin
  double grid_scale = 1.0;        // metres of the grid per metre of the ground, there
  // Standard deviations; NaN where the method does not tell.
  double expected_error_m = std::numeric_limits<double>::quiet_NaN();  // over the path
  double heading_sd_deg = std::numeric_limits<double>::quiet_NaN();
};

// Place and clock of the IMU as a run refined them, beside what it was mapped with.
struct ImuCalibrationFigures {
  std::vector<double> translation_m;  // of body_from_imu
  std::vector<double> rotation_xyzw;
  double late_s = 0.0;             // stamp of the IMU less that of the lidar, for one moment
  std::vector<double> covariance;  // 7 x 7, row by row: rotation, place, lateness
  double duration_s = 0.0;         // of the motion that tells it
  std::uint64_t windows = 0;       // that it was told by
  std::uint64_t begun_anew = 0;    // times that the recording was
  double moved_m = 0.0;            // from what the recording gave to what it was mapped with
  double turned_deg = 0.0;         // the same
  double used_late_s = 0.0;        // lateness that it was mapped with
};

// Of run.json and the files that it lists. It rises where an older version of the program would
// read them wrong, and that version then refuses them.
inline constexpr int kRunFormat = 1;

// What run.json says. Warnings are one per kind. A command makes it with RunDocuments
// (pipeline/run_folder/run_documents.h), which fills in what all commands have in common.
struct RunSummary {
  std::string command;  // "map", "inventory", "correct", "georeference", "merge"
  std::string version;
  RunStatus status = RunStatus::kComplete;
  std::vector<std::string> reasons;  // empty if complete
  std::vector<std::string> notes;    // what is in doubt though it does not lower the status
  std::vector<Log::Warning> warnings;
  ConfigRecord config;
  std::vector<InputHash> inputs;
  std::uint64_t scans = 0;
  std::uint64_t poses = 0;
  double recording_s = 0.0;
  double wall_s = 0.0;
  double cpu_s = 0.0;
  double peak_memory_mb = 0.0;
  std::map<std::string, StageSummary> stages;
  std::vector<ScanBlock> scan_blocks;      // in order of time; empty: not known
  std::map<std::string, Figure> counts;    // keyframes, loops_accepted, map_points, trees ...
  std::map<std::string, Figure> quality;   // inlier_ratio_mean, ape_rmse_m ...
  std::map<std::string, Figure> evidence;  // what the status rests on
  std::string crs_wkt;                     // of the layers; empty = local frame
  std::optional<RunPlace> place;           // of runs with a world frame
  // The frame of each file that has one: "world", or the coordinate system.
  std::map<std::string, std::string> frames;
  LidarViewFigures lidar_view;                           // empty = unknown
  std::optional<ImuCalibrationFigures> imu_calibration;  // with `refine_imu`
  std::string lidar_model;                               // empty = unknown, or several
};

// Of a run at the speed of its sensors: milliseconds from the end of a scan to its pose. The
// figures are latency_ms_mean, _p50, _p99 and _max.
void add_latency(const Distribution& latency_ms, RunSummary& summary);

// Writes run.json (keys of docs/reference/outputs.md); NaN becomes null.
void write_run_json(const std::filesystem::path& path, const RunSummary& summary);
[[nodiscard]] std::string run_json(const RunSummary& summary);

}  // namespace understory
