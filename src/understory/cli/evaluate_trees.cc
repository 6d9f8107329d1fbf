#include "understory/cli/evaluate_trees.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "understory/evaluation/tree_errors.h"
#include "understory/evaluation/tree_list_check.h"
#include "understory/evaluation/tree_rates.h"
#include "understory/util/error.h"
#include "understory/util/files/file_in_folder.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

struct TreeOptions {
  std::string a;
  std::string b;
  std::string alignment = "none";
  double radius_m = 0.5;
  std::string returns;
  long min_returns = 30;
  std::string path;
  std::string other_path;
  double within_m = 15.0;
  double bin_m = 0.0;
  double reach_m = 40.0;
  MapConsistencyConfig consistency;
  bool json = false;
};

struct Comparison {
  std::optional<Pose> b_from_a;  // found by --align
  TreeErrors all;
  std::optional<VisibleTreeErrors> visible;
  std::optional<MapAgreement> agreement;
  std::vector<DistanceRate> by_distance;
  std::optional<MapConsistency> consistency;
};

nlohmann::ordered_json to_json(const Comparison& result, const TreeOptions& options) {
  nlohmann::ordered_json json;
  json["alignment"] = options.alignment;
  json["alignment_found"] = nullptr;
  if (result.b_from_a) {
    const Eigen::Vector3d& t = result.b_from_a->translation();
    json["alignment_found"] = {{"translation_m", {t.x(), t.y(), t.z()}},
                               {"yaw_deg", yaw_deg(*result.b_from_a)},
                               {"rotation_deg", result.b_from_a->angle() * 180.0 / M_PI}};
  }
  json["trees_a"] = result.all.trees_a;
  json["trees_b"] = result.all.trees_b;
  json["matched"] = result.all.matched;
  json["recall"] = result.all.recall;
  json["precision"] = result.all.precision;
  json["position_rmse_m"] = result.all.position_rmse_m;
  json["dbh_rmse_m"] = result.all.dbh_rmse_m;
  json["dbh_bias_m"] = result.all.dbh_bias_m;
  json["height_rmse_m"] = result.all.height_rmse_m;
  if (result.visible) {
    json["visible"] = {
        {"min_returns", options.min_returns},   {"within_m", options.within_m},
        {"expected", result.visible->expected}, {"found", result.visible->found},
        {"recall", result.visible->recall},     {"reported", result.visible->reported},
        {"false", result.visible->false_trees}, {"false_share", result.visible->false_share}};
  }
  if (result.agreement) {
    const MapAgreement& m = *result.agreement;
    json["near_path"] = {{"within_m", options.within_m}, {"trees_a", m.trees_a},
                         {"trees_b", m.trees_b},         {"paired_a", m.paired_a},
                         {"paired_b", m.paired_b},       {"agreement", m.agreement}};
  }
  for (const DistanceRate& rate : result.by_distance)
    json["by_distance"].push_back({{"from_m", rate.from_m},
                                   {"to_m", rate.to_m},
                                   {"expected", rate.expected},
                                   {"found", rate.found},
                                   {"recall", rate.recall},
                                   {"reported", rate.reported},
                                   {"right", rate.right},
                                   {"precision", rate.precision}});
  if (result.consistency) {
    const MapConsistency& c = *result.consistency;
    json["consistency"] = {{"within_m", options.consistency.within_m},
                           {"pairing_m", options.consistency.pairing_m},
                           {"trees_a", c.trees_a},
                           {"trees_b", c.trees_b},
                           {"as_placed", c.as_placed},
                           {"moved", c.moved},
                           {"parts", c.parts},
                           {"in_parts", c.in_parts}};
  }
  return json;
}

std::string to_text(const Comparison& result, const TreeOptions& options) {
  const TreeErrors& e = result.all;
  std::string text = fmt::format(
      "alignment           {}\n"
      "trees               {} in A, {} in B, {} matched one to one within {:g} m (nearest first)\n",
      options.alignment + (result.b_from_a ? ": moved by " + motion_text(*result.b_from_a) : ""),
      e.trees_a, e.trees_b, e.matched, options.radius_m);
  // What no tree tells is left out: a map of stems has no heights.
  const auto tell = [&](double figure, const std::string& line) {
    if (std::isfinite(figure)) text += line;
  };
  tell(e.recall, fmt::format("recall              {:.4f} (matched share of B)\n", e.recall));
  tell(e.precision, fmt::format("precision           {:.4f} (matched share of A)\n", e.precision));
  tell(e.position_rmse_m,
       fmt::format("position            rmse {:.4f} m (horizontal)\n", e.position_rmse_m));
  tell(e.dbh_rmse_m, fmt::format("diameter            rmse {:.4f} m, bias {:+.4f} m (A minus B)\n",
                                 e.dbh_rmse_m, e.dbh_bias_m));
  tell(e.height_rmse_m, fmt::format("height              rmse {:.4f} m\n", e.height_rmse_m));
  if (result.visible) {
    const VisibleTreeErrors& v = *result.visible;
    text += fmt::format(
        "visible             {} of {} found ({:.2f} %), {} of {} false ({:.2f} %); within {:g} m "
        "of "
        "the path, at least {} returns\n",
        v.found, v.expected, 100.0 * v.recall, v.false_trees, v.reported, 100.0 * v.false_share,
        options.within_m, options.min_returns);
  }
  if (result.agreement) {
    const MapAgreement& m = *result.agreement;
    text += fmt::format(
        "agreement           {:.2f} % within {:g} m of the path: {} of {} trees of A and {} of {} "
        "of B are paired\n",
        100.0 * m.agreement, options.within_m, m.paired_a, m.trees_a, m.paired_b, m.trees_b);
  }
  for (const DistanceRate& rate : result.by_distance)
    text +=
        fmt::format("{:>3g} to {:>3g} m from the path: {} of {} found ({:.1f} %), {} of {} right\n",
                    rate.from_m, rate.to_m, rate.found, rate.expected, 100.0 * rate.recall,
                    rate.right, rate.reported);
  if (result.consistency) {
    const MapConsistency& c = *result.consistency;
    text += fmt::format(
        "consistency         {:.1f} % of {} and {} trees within {:g} m of both paths are the same; "
        "{:.1f} % after one motion, {:.1f} % in {} parts\n",
        100.0 * c.as_placed, c.trees_a, c.trees_b, options.consistency.within_m, 100.0 * c.moved,
        100.0 * c.in_parts, c.parts);
  }
  return text;
}

// Detection over the distance from the path, and the consistency of two runs.
void compare_along_paths(const TreeOptions& options, const std::vector<Tree>& a,
                         const std::vector<Tree>& b, Comparison& result) {
  std::vector<std::string> problems;
  if (options.bin_m > 0.0 && options.path.empty()) problems.emplace_back("--bin-m needs --path");
  if (!options.other_path.empty() && options.path.empty())
    problems.emplace_back("--other-path needs --path");
  if (!problems.empty()) throw ConfigError(problems);
  if (options.path.empty()) return;
  const Trajectory path = read_trajectory(file_in_folder(options.path, "trajectory.tum"));
  result.agreement = compare_maps(a, b, options.radius_m, path, options.within_m);
  if (options.bin_m > 0.0)
    result.by_distance =
        rates_over_distance(a, b, options.radius_m, path, options.bin_m, options.reach_m);
  if (!options.other_path.empty())
    result.consistency = map_consistency(
        a, b, path, read_trajectory(file_in_folder(options.other_path, "trajectory.tum")),
        options.consistency);
}

std::optional<VisibleTreeErrors> compare_visible(const TreeOptions& options,
                                                 const std::vector<Tree>& a,
                                                 const std::vector<Tree>& b) {
  if (options.returns.empty()) return std::nullopt;
  if (options.path.empty()) throw ConfigError({"--truth-returns needs --path"});
  Visibility visibility;
  visibility.returns_by_tree = read_returns(file_in_folder(options.returns, "returns.csv.gz"));
  visibility.path = read_trajectory(file_in_folder(options.path, "trajectory.tum"));
  visibility.min_returns = options.min_returns;
  visibility.within_m = options.within_m;
  return compare_visible_trees(a, b, options.radius_m, visibility);
}

void warn_of_list(const std::string& name, const std::vector<Tree>& trees, Log& log) {
  for (const std::string& complaint : {diameter_complaint(trees), doubles_complaint(trees)})
    if (!complaint.empty()) log.warn("evaluate.trees", name + ": " + complaint);
}

int evaluate_trees(const TreeOptions& options, CommandContext& context) {
  std::vector<Tree> a = read_trees(file_in_folder(options.a, "trees.csv"));
  const std::vector<Tree> b = read_trees(file_in_folder(options.b, "trees.csv"));
  warn_of_list(options.a, a, context.log);
  warn_of_list(options.b, b, context.log);
  const Alignment alignment = alignment_from_name(options.alignment);
  bool aligned = true;
  Comparison result;
  if (alignment != Alignment::kNone) {
    result.b_from_a = align_trees(a, b, alignment, options.radius_m);
    aligned = result.b_from_a.has_value();
    if (aligned) a = moved(a, *result.b_from_a);
  }
  if (!aligned) {
    context.log.warn("evaluate.trees",
                     "no motion lays three trees of A on trees of B; compared "
                     "where they are");
  }
  result.all = compare_trees(a, b, options.radius_m);
  result.visible = compare_visible(options, a, b);
  compare_along_paths(options, a, b, result);
  const std::string text =
      options.json ? to_json(result, options).dump(2) + "\n" : to_text(result, options);
  std::fputs(text.c_str(), stdout);
  return aligned ? kExitDone : kExitUntrusted;
}

}  // namespace

void add_evaluate_trees_command(CLI::App& evaluate, Command& chosen) {
  CLI::App* command =
      evaluate.add_subcommand("trees", "Compare a tree list A with another one B (the truth)");
  const auto options = std::make_shared<TreeOptions>();
  command->add_option("A", options->a, "Run folder or trees.csv")->required();
  command->add_option("B", options->b, "Truth folder or trees.csv")->required();
  command->add_option("--radius-m", options->radius_m, "Largest distance of a matched pair")
      ->check(CLI::Range(1e-3, 100.0))
      ->capture_default_str();
  command
      ->add_option("--align", options->alignment,
                   "Move A onto B first, found from the trees alone (unaligned by default)")
      ->check(CLI::IsMember({"none", "yaw", "se3"}));
  command->add_option("--truth-returns", options->returns,
                      "returns.csv.gz of the truth: expect only trees that gave returns");
  command
      ->add_option("--min-returns", options->min_returns,
                   "Fewest returns of a tree that counts as visible")
      ->capture_default_str();
  command->add_option("--path", options->path,
                      "The scanner's trajectory in B's frame: also the agreement of both maps near "
                      "it");
  command->add_option("--within-m", options->within_m, "Trees further from the path do not count")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
  command
      ->add_option("--bin-m", options->bin_m,
                   "Also the detection over the distance from --path, in rings of this width")
      ->check(CLI::Range(0.1, 1000.0));
  command->add_option("--reach-m", options->reach_m, "How far these rings reach")
      ->check(CLI::Range(0.1, 10000.0))
      ->capture_default_str();
  command->add_option(
      "--other-path", options->other_path,
      "The trajectory of the other map, in B's frame: also the consistency of both over "
      "the trees near both paths, whole and in parts of 50 m");
  command
      ->add_option("--pairing-m", options->consistency.pairing_m,
                   "Trees that near count as the same for the consistency")
      ->check(CLI::Range(0.01, 100.0))
      ->capture_default_str();
  command
      ->add_option("--near-both-m", options->consistency.within_m,
                   "Trees farther from either path do not count for the consistency")
      ->check(CLI::Range(0.1, 10000.0))
      ->capture_default_str();
  command->add_flag("--json", options->json, "One JSON object on stdout");
  command->footer(
      "Example:\n  understory evaluate trees run walk.truth --align yaw\n"
      "  understory evaluate trees run walk.truth --align yaw --truth-returns walk.truth --path "
      "walk.truth");
  command->callback([&chosen, options] {
    chosen = [options](CommandContext& context) {
      context.stop_at_once();
      return evaluate_trees(*options, context);
    };
  });
}

}  // namespace understory
