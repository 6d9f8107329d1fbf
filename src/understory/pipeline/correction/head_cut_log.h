#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "understory/forest/trees/tree_fall.h"
#include "understory/geometry/stamped_pose.h"
#include "understory/map/head_cuts.h"
#include "understory/output/run_summary.h"
#include "understory/sensor/tree.h"
#include "understory/util/config/config.h"
#include "understory/util/log.h"

namespace understory {

// What a harvester does to the stand that it maps: where and when it felled trees. The log of the
// computer of its head tells (P1 section 4).
struct HeadCutLogConfig {
  bool fells = false;    // a machine fells trees meanwhile
  std::string head_log;  // CSV (docs/reference/machine.md); empty: none
  CutMatching cuts;
};
void describe(ConfigTable& table, HeadCutLogConfig& config);
// Whether trees that are gone were felled: a machine fells, or has a log. Else they are missing.
[[nodiscard]] bool fells_trees(const HeadCutLogConfig& config);

// A felling cut as it stands in the log.
struct LoggedCut {
  TimeNs stamp = 0;
  Eigen::Vector3d head_in_body = Eigen::Vector3d::Zero();  // metres
};

// Reads `timestamp,x,y,z` in the order of time; nothing for no file. Throws InputError with the
// line where a cell is no number or time goes backwards.
[[nodiscard]] std::vector<LoggedCut> read_head_log(const std::string& file);

// The cuts where the path says that the machine was. Those before its begin or after its end are
// left out, with a warning. `path` is in the order of time.
[[nodiscard]] std::vector<HeadCut> place_cuts(const std::vector<LoggedCut>& cuts,
                                              const std::vector<StampedPose>& path, Log& log);

// A sparse map and the views that it was made of; `trees` are those of its tree list, one for each
// stem.
struct FelledStand {
  const std::vector<StemView>& views;
  const std::vector<Pose>& world_from_body;
  const std::vector<MappedStem>& stems;
  std::vector<Tree>& trees;
};

// Gives the trees that the views saw and then saw no more, and those that the head cut, the time
// since when they are missing. Writes felled.csv: these trees where a machine fells, else none.
// With cuts also cuts.csv (`timestamp,x,y,z,tree_id,distance_m`, world frame, the last two empty
// where no tree of the list stood). Where most of four cuts or more lie at no tree, none gets one:
// the log warns of it. Adds its counts to the summary. Returns what felled.csv holds.
std::vector<TreeFall> write_felled_trees(const std::filesystem::path& folder,
                                         const FelledStand& stand, const std::vector<HeadCut>& cuts,
                                         const HeadCutLogConfig& config, RunSummary& summary,
                                         Log& log);

// cuts.csv of one run to that of another in which everything is moved; nothing where there is none.
// Throws InputError or OutputError.
void write_moved_cuts(const std::filesystem::path& from, const std::filesystem::path& to,
                      const Pose& to_world_from_world);

}  // namespace understory
