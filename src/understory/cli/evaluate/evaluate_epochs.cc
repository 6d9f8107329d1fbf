#include "understory/cli/evaluate/evaluate_epochs.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "understory/evaluation/trees/tree_changes.h"
#include "understory/evaluation/trees/tree_list_check.h"
#include "understory/evaluation/trees/tree_match_chance.h"
#include "understory/output/change_files.h"
#include "understory/pipeline/georeferencing/run_place.h"
#include "understory/util/error.h"
#include "understory/util/files/file_in_folder.h"
#include "understory/util/files/output_guard.h"
#include "understory/util/fixed_text.h"

namespace understory {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// One list, with what its run folder tells.
struct Epoch {
  std::string name;
  std::vector<Tree> trees;
  Trajectory path;    // empty: not known
  LayerFrame layers;  // of a run folder on the globe; else the frame of the list
};

Epoch read_epoch(const std::string& given, const std::string& path) {
  Epoch epoch;
  epoch.name = given;
  epoch.trees = read_trees(file_in_folder(given, "trees.csv"));
  if (!fs::is_directory(given)) {
    if (!path.empty()) epoch.path = read_trajectory(file_in_folder(path, "trajectory.tum"));
    return epoch;
  }
  if (fs::exists(fs::path(given) / "run.json")) epoch.layers = read_layer_frame(given);
  const fs::path own = fs::path(given) / "trajectory.tum";
  if (!path.empty()) {
    epoch.path = read_trajectory(file_in_folder(path, "trajectory.tum"));
  } else if (fs::exists(own)) {
    epoch.path = read_trajectory(own);
  }
  return epoch;
}

// Where both runs lie on the globe, OLD goes into the frame of NEW by way of it.
void lay_by_globe(Epoch& before, const Epoch& after, bool moves_path) {
  if (before.layers.system() == nullptr || after.layers.system() == nullptr) return;
  if (before.layers.wkt() != after.layers.wkt())
    throw InputError(before.name, "",
                     "is in " + before.layers.code() + ", and " + after.name + " in " +
                         after.layers.code() +
                         "; expected one coordinate system: lay one of them into that of the other "
                         "by `understory georeference RUN --method auto --crs EPSG:CODE -o RUN2`");
  const auto into_new = [&](const Eigen::Vector3d& point) {
    return after.layers.to_world(before.layers.from_world(point));
  };
  for (Tree& tree : before.trees) {
    const Eigen::Vector3d at = into_new({tree.x, tree.y, tree.z});
    tree.x = at.x();
    tree.y = at.y();
    tree.z = at.z();
  }
  if (!moves_path) return;
  for (StampedPose& pose : before.path)
    pose.world_from_body =
        Pose(pose.world_from_body.rotation(), into_new(pose.world_from_body.translation()));
}

// Moves OLD onto NEW by the trees alone. False where nothing fits.
bool lay_by_trees(Epoch& before, const Epoch& after, const TreeOptions& options, bool moves_path) {
  const Alignment alignment = alignment_from_name(options.alignment);
  if (alignment == Alignment::kNone) return true;
  const std::optional<Pose> motion =
      align_trees(before.trees, after.trees, alignment, options.assignment.radius_m);
  if (!motion) return false;
  before.trees = moved(before.trees, *motion);
  if (moves_path)
    for (StampedPose& pose : before.path)
      pose.world_from_body = *motion * pose.world_from_body;
  return true;
}

// Why the lists do not show two epochs of one stand; empty if they do.
std::string stand_complaint(const Epoch& before, const Epoch& after,
                            const std::vector<TreePair>& pairs, const TreeOptions& options) {
  for (const Epoch* epoch : {&before, &after})
    if (std::string unit = diameter_complaint(epoch->trees); !unit.empty())
      return epoch->name + ": " + unit;
  if (are_copies(before.trees, after.trees)) return "one list is a copy of the other";
  const bool searched = options.alignment != "none";
  const MatchChance chance =
      match_chance(before.trees, after.trees, pairs, options.assignment.radius_m, searched);
  if (std::string complaint = chance_complaint(chance); !complaint.empty())
    return complaint + (searched ? "" : ", or in different frames: try --align yaw");
  return diameter_complaint(before.trees, after.trees, pairs);
}

EpochArea area_of(const Epoch& epoch) {
  return epoch.path.empty() ? EpochArea::from_trees(epoch.trees)
                            : EpochArea::from_path(epoch.trees, epoch.path);
}

struct EpochResult {
  TreeChanges changes;
  std::string old_area;  // in words
  std::string new_area;
};

Json increments_json(const IncrementSummary& s) {
  return {{"known", s.known}, {"mean", s.mean},     {"mean_sd", s.mean_sd},
          {"grown", s.grown}, {"shrunk", s.shrunk}, {"stand_in_sd", s.stand_in_sd}};
}

std::string epochs_json(const Epoch& before, const Epoch& after, const EpochResult& result,
                        const TreeOptions& options) {
  const TreeChanges& c = result.changes;
  Json json = {{"trees_old", before.trees.size()},
               {"trees_new", after.trees.size()},
               {"alignment", options.alignment},
               {"seen_by_old", result.old_area},
               {"seen_by_new", result.new_area}};
  for (std::size_t fate = 0; fate < c.counts.size(); ++fate)
    json[to_string(static_cast<TreeFate>(fate))] = c.counts[fate];
  json["ingrowth_limit_m"] = c.ingrowth_limit_m;
  json["missed_share"] = c.missed_share;
  json["gone_but_missed"] = c.expected_missed;
  json["gone_but_missed_sd"] = c.expected_missed_sd;
  json["dbh_increment_m"] = increments_json(c.dbh);
  json["height_increment_m"] = increments_json(c.height);
  json["stem_volume_increment_m3"] = increments_json(c.volume);
  return json.dump(2) + "\n";
}

std::string increments_text(const char* name, const char* unit, const IncrementSummary& s) {
  if (s.known == 0) return {};
  std::string text = fmt::format("{:<20}mean {} {}", name, signed_text(s.mean, 4), unit);
  if (std::isfinite(s.mean_sd)) text += fmt::format(" +- {:.4f}", s.mean_sd);
  text += fmt::format(" over {} trees; {} grew and {} shrank beyond 1.96 sd", s.known, s.grown,
                      s.shrunk);
  if (std::isfinite(s.stand_in_sd))
    text += fmt::format(" (sd {:.4f} {} from the spread of all, where the lists tell none)",
                        s.stand_in_sd, unit);
  return text + "\n";
}

std::string epochs_text(const Epoch& before, const Epoch& after, const EpochResult& result) {
  const TreeChanges& c = result.changes;
  std::string text = fmt::format(
      "trees               {} in OLD, {} in NEW\n"
      "stay                {}\n"
      "gone                {} in the area that NEW saw",
      before.trees.size(), after.trees.size(), c.count(TreeFate::kStays), c.count(TreeFate::kGone));
  if (std::isfinite(c.expected_missed))
    text += fmt::format("; of these about {:.1f} +- {:.1f} stand, but NEW missed them",
                        c.expected_missed, c.expected_missed_sd);
  text +=
      fmt::format("\nnew                 {} in the area that OLD saw\n", c.count(TreeFate::kNew));
  if (std::isfinite(c.ingrowth_limit_m))
    text += fmt::format(
        "missed before       {}: too thick to be new (over {:.3f} m), so OLD missed them ({:.1f} % "
        "of such trees)\n",
        c.count(TreeFate::kMissedBefore), c.ingrowth_limit_m, 100.0 * c.missed_share);
  text += fmt::format(
      "not seen            {} of OLD where NEW did not look, {} of NEW where OLD did not\n",
      c.count(TreeFate::kOutsideNew), c.count(TreeFate::kOutsideOld));
  text += increments_text("diameter", "m", c.dbh) + increments_text("height", "m", c.height) +
          increments_text("stem volume", "m3", c.volume);
  return text + fmt::format("area seen           by OLD: {}; by NEW: {}\n", result.old_area,
                            result.new_area);
}

void check_output(const TreeOptions& options) {
  if (options.output.empty()) return;
  const std::string ending = fs::path(options.output).extension().string();
  if (ending != ".csv" && ending != ".gpkg")
    throw ConfigError({options.output + ": expected a name that ends in .csv or .gpkg"});
  refuse_input_as_output(options.output, {options.a, options.b});
  (void)place_of_file(options.output, options.overwrite);
}

}  // namespace

int evaluate_epochs(const TreeOptions& options, CommandContext& context) {
  check_output(options);
  Epoch before = read_epoch(options.a, options.other_path);
  const Epoch after = read_epoch(options.b, options.path);
  const bool moves_path = options.other_path.empty();
  lay_by_globe(before, after, moves_path);
  if (!lay_by_trees(before, after, options, moves_path)) {
    context.log.warn(
        "evaluate.stands",
        "no motion lays three trees of OLD on trees of NEW: they are not of one stand");
    return kExitUntrusted;
  }
  const std::vector<TreePair> pairs = assign_trees(before.trees, after.trees, options.assignment);
  if (const std::string complaint = stand_complaint(before, after, pairs, options);
      !complaint.empty()) {
    context.log.warn("evaluate.stands", "nothing was compared: " + complaint);
    return kExitUntrusted;
  }
  const EpochArea old_area = area_of(before);
  const EpochArea new_area = area_of(after);
  const EpochResult result{tree_changes(before.trees, after.trees, pairs, old_area, new_area),
                           old_area.meaning(), new_area.meaning()};
  if (!options.output.empty())
    write_changes(place_of_file(options.output, options.overwrite),
                  changes_table(before.trees, after.trees, result.changes), after.layers);
  const std::string text = options.json ? epochs_json(before, after, result, options)
                                        : epochs_text(before, after, result);
  std::fputs(text.c_str(), stdout);
  if (!result.changes.misfit()) return kExitDone;
  context.log.warn(
      "evaluate.misfit",
      fmt::format("the lists do not fit together as they lie: {:.0f} % of the thick trees of NEW "
                  "are missing from OLD{}",
                  100.0 * result.changes.missed_share,
                  options.alignment == "none" ? "; try --align yaw" : ""));
  return kExitUntrusted;
}

}  // namespace understory
