#include "understory/cli/evaluate/evaluate_map.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <system_error>

#include "understory/cli/evaluate/evaluate_crispness.h"
#include "understory/cli/suggestion.h"
#include "understory/evaluation/map_entropy.h"
#include "understory/evaluation/strip_roads.h"
#include "understory/evaluation/trajectory.h"
#include "understory/graph/self_correction/stem_correction.h"
#include "understory/recording/clouds/stems_file.h"
#include "understory/util/error.h"
#include "understory/util/files/file_in_folder.h"
#include "understory/util/shell_word.h"

namespace understory {
namespace {

struct EvaluateMapOptions {
  std::string stems;
  std::string trajectory;
  double tolerance_s = 0.01;
  MapEntropyConfig entropy{.thin_m = 0.05};
  bool json = false;
};

// Views that have a pose within the tolerance of their time, and these poses.
struct Placed {
  std::vector<StemView> views;
  std::vector<Pose> world_from_body;
  std::size_t without = 0;
};

Placed place(std::vector<StemView> views, const Trajectory& trajectory, double tolerance_s) {
  Placed placed;
  for (StemView& view : views) {
    auto after =
        std::lower_bound(trajectory.begin(), trajectory.end(), view.stamp,
                         [](const StampedPose& pose, TimeNs stamp) { return pose.stamp < stamp; });
    if (after == trajectory.end() ||
        (after != trajectory.begin() &&
         view.stamp - std::prev(after)->stamp < after->stamp - view.stamp))
      --after;
    if (std::abs(to_seconds(after->stamp - view.stamp)) > tolerance_s) {
      ++placed.without;
      continue;
    }
    placed.views.push_back(std::move(view));
    placed.world_from_body.push_back(after->world_from_body);
  }
  return placed;
}

nlohmann::ordered_json to_json(const Placed& placed, const MapSharpness& map,
                               const MapSharpness& all, const std::vector<RoadConsistency>& roads) {
  nlohmann::ordered_json json;
  json["views"] = placed.views.size();
  json["views_without_pose"] = placed.without;
  json["beta"] = map.beta;
  json["beta_3d"] = map.beta_3d;
  json["box_dimension"] = map.dimension;
  json["box_dimension_3d"] = map.dimension_3d;
  json["cluster_noise_m"] = map.cluster_noise_m;
  json["cluster_noise_mean_m"] = map.cluster_noise_mean_m;
  json["registration_noise_m"] = map.noise_m;
  json["registration_noise_mean_m"] = map.noise_mean_m;
  json["trees"] = map.trees;
  json["joined_trees"] = map.joined;
  json["all_stems"] = {{"beta", all.beta},
                       {"box_dimension", all.dimension},
                       {"cluster_noise_m", all.cluster_noise_m},
                       {"cluster_noise_mean_m", all.cluster_noise_mean_m},
                       {"registration_noise_m", all.noise_m},
                       {"registration_noise_mean_m", all.noise_mean_m},
                       {"trees", all.trees},
                       {"joined_trees", all.joined}};
  json["roads"] = nlohmann::ordered_json::array();
  for (const RoadConsistency& road : roads) {
    json["roads"].push_back({{"road", road.road},
                             {"other", road.other},
                             {"trees", road.trees},
                             {"trees_other", road.trees_other},
                             {"consistency", road.as_placed},
                             {"consistency_moved", road.moved},
                             {"consistency_in_parts", road.in_parts},
                             {"match_rms_m", road.match_rms_m}});
  }
  return json;
}

std::string noise_text(double pooled_m, double mean_m, std::size_t count, const char* of_what) {
  if (!std::isfinite(pooled_m)) return "unknown: no tree was seen often enough";
  return fmt::format("{:.4f} m over all sights, {:.4f} m mean over {} {}", pooled_m, mean_m, count,
                     of_what);
}

// e_C as P0 (33) prints it.
std::string cluster_noise(const MapSharpness& map) {
  return noise_text(map.cluster_noise_m, map.cluster_noise_mean_m, map.trees + map.joined,
                    "clusters");
}

std::string tree_noise(const MapSharpness& map) {
  return noise_text(map.noise_m, map.noise_mean_m, map.trees, "trees");
}

std::string to_text(const Placed& placed, const MapSharpness& map, const MapSharpness& all,
                    const std::vector<RoadConsistency>& roads) {
  std::string text = fmt::format(
      "views               {} placed, {} without a pose\n"
      "blurred area        {:.4f} of the map from above, {:.6f} in space (beta)\n"
      "box dimension       {:.2f} from above, {:.2f} in space (d)\n"
      "spread of sights    {} (e_C)\n"
      "of single trees     {} (without clusters of several trees)\n"
      "with far and doubtful stems: beta {:.4f}, d {:.2f}, e_C {}; of single trees {}\n",
      placed.views.size(), placed.without, map.beta, map.beta_3d, map.dimension, map.dimension_3d,
      cluster_noise(map), tree_noise(map), all.beta, all.dimension, cluster_noise(all),
      tree_noise(all));
  for (const RoadConsistency& road : roads) {
    text += fmt::format(
        "roads {} and {}       {} and {} trees, {:.1f} % the same; {:.1f} % after one motion, "
        "{:.1f} % in parts\n",
        road.road, road.other, road.trees, road.trees_other, 100.0 * road.as_placed,
        100.0 * road.moved, 100.0 * road.in_parts);
  }
  return text;
}

int evaluate_map(const EvaluateMapOptions& options, CommandContext& context) {
  const Placed placed = place(
      read_stem_views(file_in_folder(options.stems, "stems.csv.gz"), context.log),
      read_trajectory(file_in_folder(options.trajectory, "trajectory.tum")), options.tolerance_s);
  if (placed.views.empty())
    throw InputError(options.trajectory, "",
                     "expected poses at the times of the views in " + options.stems);
  if (placed.without > placed.views.size())
    context.log.warn("evaluate.map",
                     fmt::format("{} of {} views have no pose: the figures are of "
                                 "the others alone",
                                 placed.without, placed.without + placed.views.size()));
  const std::vector<StemView> sights = map_sights(placed.views, {});
  const MapSharpness map = stem_sharpness(sights, placed.world_from_body, {});
  const MapSharpness all = stem_sharpness(placed.views, placed.world_from_body, {});
  const std::vector<RoadConsistency> roads =
      road_consistencies(placed.views, placed.world_from_body, {});
  const std::string text = options.json ? to_json(placed, map, all, roads).dump(2) + "\n"
                                        : to_text(placed, map, all, roads);
  std::fputs(text.c_str(), stdout);
  return placed.without > placed.views.size() ? kExitUntrusted : kExitDone;
}

// A run by stems has no cloud: its stems are placed by its own path. So is a file of stems that
// lies beside a path.
void place_by_own_path(EvaluateMapOptions& options) {
  namespace fs = std::filesystem;
  std::error_code ignored;
  if (!options.trajectory.empty()) return;
  const fs::path given(options.stems);
  const bool folder = fs::is_directory(given, ignored);
  const bool stems = folder ? !fs::exists(given / "map.laz", ignored) &&
                                  fs::exists(given / "stems.csv.gz", ignored)
                            : is_stems_name(options.stems);
  if (!stems) return;
  const fs::path path = (folder ? given : given.parent_path()) / "trajectory.tum";
  if (!fs::exists(path, ignored))
    throw InputError(options.stems, "",
                     "holds stems, which a trajectory places: `understory evaluate map " +
                         shell_word(options.stems) + " TRAJECTORY`");
  options.trajectory = path.string();
}

}  // namespace

void add_evaluate_map_command(CLI::App& evaluate, Command& chosen) {
  auto* command = evaluate.add_subcommand(
      "map", "Sharpness of a map without truth: of a cloud, or of stems placed by any trajectory");
  const auto options = std::make_shared<EvaluateMapOptions>();
  command
      ->add_option("RUN", options->stems,
                   "Run folder, cloud (.laz, .las), or the stems of the views (stems.csv.gz)")
      ->required();
  command->add_option(
      "TRAJECTORY", options->trajectory,
      "Of stems: the run folder or trajectory (TUM) that places them, their own if not "
      "given");
  command
      ->add_option("--thin-m", options->entropy.thin_m,
                   "Of a cloud: one point counts in each cube of this edge, so that maps of other "
                   "densities compare; 0: all count")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  command
      ->add_option("--radius-m", options->entropy.radius_m,
                   "Of a cloud: neighbours of a point lie within it")
      ->check(CLI::Range(0.01, 5.0));
  command->add_option("--tolerance-s", options->tolerance_s, "Largest difference of times")
      ->check(CLI::NonNegativeNumber);
  command->add_flag("--json", options->json, "Print one JSON object");
  command->footer(
      "Of a cloud: the mean map entropy. It is small for a crisp map.\n"
      "Of stems: three figures, all small for a sharp map. They are the share of its area that is\n"
      "blurred, its box dimension (0 points, 1 lines, 2 areas), and how far the sights of a tree\n"
      "lie from their mean.\n\nExamples:\n  understory evaluate map forest\n"
      "  understory evaluate map stems.csv.gz forest");
  command->callback([&chosen, options] {
    chosen = [options](CommandContext& context) {
      refuse_unmapped(options->stems);
      context.stop_at_once();
      place_by_own_path(*options);
      return options->trajectory.empty()
                 ? evaluate_crispness(options->stems, options->entropy, options->json, context)
                 : evaluate_map(*options, context);
    };
  });
}

}  // namespace understory
