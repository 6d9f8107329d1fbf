#include "understory/pipeline/correction/head_cut_log.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "understory/evaluation/world_frame.h"
#include "understory/output/run_tables.h"
#include "understory/pipeline/pipeline_constants.h"
#include "understory/util/error.h"
#include "understory/util/files/atomic_file.h"
#include "understory/util/files/csv.h"

namespace understory {
namespace {

using namespace pipeline_constants::head_cut_log;

TimeNs stamp_of(const FelledStand& stand, int view) {
  return stand.views[static_cast<std::size_t>(view)].stamp;
}

// A row of cuts.csv.
struct PlacedCut {
  TimeNs stamp = 0;
  Eigen::Vector3d head_in_world = Eigen::Vector3d::Zero();
  int tree_id = 0;  // 0: none
  double distance_m = 0.0;
};

void write_cuts(const std::filesystem::path& path, const std::vector<PlacedCut>& cuts) {
  AtomicTextFile file(path);
  file.write("timestamp,x,y,z,tree_id,distance_m\n");
  for (const PlacedCut& cut : cuts) {
    const Eigen::Vector3d& p = cut.head_in_world;
    file.write(fmt::format("{},{},{},{},", format_seconds(cut.stamp), csv_cell(p.x(), 3),
                           csv_cell(p.y(), 3), csv_cell(p.z(), 3)));
    file.write(cut.tree_id == 0 ? ",\n" : fmt::format("{},{:.3f}\n", cut.tree_id, cut.distance_m));
  }
  file.commit();
}

// The cuts with the trees that they felled. Where most of many cuts lie at no tree, the places of
// the head are not those of the frame of the body. What lies near a cut is there by chance then.
std::vector<CutTree> trees_of_cuts(const FelledStand& stand, const std::vector<HeadCut>& cuts,
                                   const std::vector<FelledTree>& felled, const CutMatching& config,
                                   Log& log) {
  std::vector<CutTree> matched = match_cuts(cuts, stand.stems, felled, stand.views, config);
  const auto without = static_cast<std::size_t>(std::count_if(
      matched.begin(), matched.end(), [](const CutTree& cut) { return cut.tree < 0; }));
  if (matched.size() < kFewestCuts || 2 * without <= matched.size()) return matched;
  log.warn(
      "felling.head_place",
      fmt::format("{} of {} cuts of the head lie at no tree, so no tree gets a cut from the log. "
                  "The log and the path do not share one body frame or one clock: check "
                  "the extrinsics of the lidar (--extrinsics FILE)",
                  without, matched.size()));
  return std::vector<CutTree>(matched.size());
}

TimeNs stamp_in(const CsvReader& table) {
  TimeNs stamp = 0;
  if (!parse_seconds(std::string(table.text("timestamp")), stamp))
    table.fail("expected seconds in column 'timestamp'");
  return stamp;
}

}  // namespace

void describe(ConfigTable& table, HeadCutLogConfig& config) {
  table.add("fells", config.fells,
            "a machine fells trees while it maps: trees that are gone are felled; else, without a "
            "log of its head, they are only missing");
  table.add("head_log", config.head_log,
            "CSV of a harvester's felling cuts, timestamp,x,y,z of its head in the body frame; "
            "empty: none");
  table.add("reach_m", config.cuts.reach_m, {0.0, 10.0}, "m",
            "largest distance in the plane from the head to the tree that it cut");
  table.add("settle_s", config.cuts.settle_s, {0.0, 3600.0}, "s",
            "longest time for which a cut tree may still be seen at its place");
}

bool fells_trees(const HeadCutLogConfig& config) {
  return config.fells || !config.head_log.empty();
}

std::vector<LoggedCut> read_head_log(const std::string& file) {
  std::vector<LoggedCut> cuts;
  if (file.empty()) return cuts;
  CsvReader table(file, {"timestamp", "x", "y", "z"});
  while (table.next()) {
    const auto refuse = [&](const std::string& what) {
      throw InputError(file, table.lines().position(), what);
    };
    LoggedCut cut;
    if (!parse_seconds(std::string(table.text("timestamp")), cut.stamp))
      refuse("expected seconds in column 'timestamp'");
    if (!cuts.empty() && cut.stamp < cuts.back().stamp) refuse("is earlier than the cut before it");
    cut.head_in_body = {table.finite("x"), table.finite("y"), table.finite("z")};
    cuts.push_back(cut);
  }
  return cuts;
}

std::vector<HeadCut> place_cuts(const std::vector<LoggedCut>& cuts,
                                const std::vector<StampedPose>& path, Log& log) {
  std::vector<HeadCut> placed;
  for (const LoggedCut& cut : cuts) {
    const auto after =
        std::lower_bound(path.begin(), path.end(), cut.stamp,
                         [](const StampedPose& pose, TimeNs time) { return pose.stamp < time; });
    if (after == path.end() || (after == path.begin() && after->stamp != cut.stamp)) {
      log.warn("felling.outside", "cut at " + format_seconds(cut.stamp) +
                                      " lies outside the time of the path and is left out");
      continue;
    }
    Pose pose = after->world_from_body;
    if (after->stamp != cut.stamp) {
      const StampedPose& before = *(after - 1);
      pose = interpolate(
          before.world_from_body, pose,
          to_seconds(cut.stamp - before.stamp) / to_seconds(after->stamp - before.stamp));
    }
    placed.push_back({cut.stamp, pose * cut.head_in_body});
  }
  return placed;
}

std::vector<TreeFall> write_felled_trees(const std::filesystem::path& folder,
                                         const FelledStand& stand, const std::vector<HeadCut>& cuts,
                                         const HeadCutLogConfig& config, RunSummary& summary,
                                         Log& log) {
  const bool fells = fells_trees(config);
  const std::vector<FelledTree> felled =
      felled_trees(stand.views, stand.world_from_body, stand.stems,
                   fells ? FelledConfig() : FelledConfig::unattended());
  std::map<std::size_t, TreeFall> falls;  // by tree
  for (const FelledTree& fell : felled) {
    const Tree& tree = stand.trees[fell.tree];
    falls[fell.tree] = {tree.id,
                        tree.x,
                        tree.y,
                        stamp_of(stand, fell.last_seen),
                        stamp_of(stand, fell.first_missed),
                        fell.missed};
  }
  if (!cuts.empty()) {
    const auto matched = trees_of_cuts(stand, cuts, felled, config.cuts, log);
    std::vector<PlacedCut> rows;
    for (std::size_t i = 0; i < cuts.size(); ++i) {
      rows.push_back({cuts[i].stamp, cuts[i].head_in_world, 0, matched[i].distance_m});
      if (matched[i].tree < 0) continue;
      const auto index = static_cast<std::size_t>(matched[i].tree);
      const Tree& tree = stand.trees[index];
      rows.back().tree_id = tree.id;
      const int missed = falls.contains(index) ? falls[index].missed : 0;
      falls[index] = {tree.id, tree.x, tree.y, cuts[i].stamp, cuts[i].stamp, missed};
    }
    write_cuts(folder / "cuts.csv", rows);
    summary.counts["head_cuts"] = static_cast<std::int64_t>(cuts.size());
    summary.counts["head_cuts_without_tree"] = static_cast<std::int64_t>(std::count_if(
        matched.begin(), matched.end(), [](const CutTree& cut) { return cut.tree < 0; }));
  }
  std::vector<TreeFall> result;
  for (const auto& [index, fall] : falls) {
    stand.trees[index].missing_since_s = to_seconds(fall.gone_since);
    if (fells) result.push_back(fall);
  }
  summary.counts["trees_missing"] = static_cast<std::int64_t>(falls.size());
  write_tree_falls(folder / "felled.csv", result);
  summary.counts["trees_felled"] = static_cast<std::int64_t>(result.size());
  return result;
}

void write_moved_cuts(const std::filesystem::path& from, const std::filesystem::path& to,
                      const Pose& to_world_from_world) {
  if (!std::filesystem::exists(from)) return;
  CsvReader table(from, {"timestamp", "x", "y", "z", "tree_id", "distance_m"},
                  {.edit = turned_back(from)});
  std::vector<PlacedCut> cuts;
  while (table.next()) {
    PlacedCut cut;
    cut.stamp = stamp_in(table);
    const Eigen::Vector3d head(table.finite("x"), table.finite("y"), table.finite("z"));
    cut.head_in_world = to_world_from_world * head;
    if (!table.text("tree_id").empty()) {
      cut.tree_id = static_cast<int>(table.finite("tree_id"));
      cut.distance_m = table.finite("distance_m");
    }
    cuts.push_back(cut);
  }
  write_cuts(to, cuts);
}

}  // namespace understory
