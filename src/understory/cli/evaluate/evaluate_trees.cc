#include "understory/cli/evaluate/evaluate_trees.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>

#include "understory/cli/evaluate/evaluate_epochs.h"
#include "understory/cli/evaluate/evaluate_trees_text.h"
#include "understory/cli/suggestion.h"
#include "understory/evaluation/trees/tree_errors.h"
#include "understory/evaluation/trees/tree_list_check.h"
#include "understory/evaluation/trees/tree_rates.h"
#include "understory/util/error.h"
#include "understory/util/files/file_in_folder.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

// Detection over the distance from the path, and the consistency of two runs.
void compare_along_paths(const TreeOptions& options, const std::vector<Tree>& a,
                         const std::vector<Tree>& b, const std::vector<TreePair>& pairs,
                         TreeComparison& result) {
  std::vector<std::string> problems;
  if (options.bin_m > 0.0 && options.path.empty()) problems.emplace_back("--bin-m needs --path");
  if (!options.other_path.empty() && options.path.empty())
    problems.emplace_back("--other-path needs --path");
  if (!problems.empty()) throw ConfigError(problems);
  if (options.path.empty()) return;
  const Trajectory path = read_trajectory(file_in_folder(options.path, "trajectory.tum"));
  result.agreement = compare_maps(a, b, pairs, path, options.within_m);
  if (options.bin_m > 0.0)
    result.by_distance = rates_over_distance(a, b, pairs, path, options.bin_m, options.reach_m);
  if (!options.other_path.empty())
    result.consistency = map_consistency(
        a, b, path, read_trajectory(file_in_folder(options.other_path, "trajectory.tum")),
        options.consistency);
}

std::optional<VisibleTreeErrors> compare_visible(const TreeOptions& options,
                                                 const std::vector<Tree>& a,
                                                 const std::vector<Tree>& b,
                                                 const std::vector<TreePair>& pairs) {
  if (options.returns.empty()) return std::nullopt;
  if (options.path.empty()) throw ConfigError({"--truth-returns needs --path"});
  Visibility visibility;
  visibility.returns_by_tree = read_returns(file_in_folder(options.returns, "returns.csv.gz"));
  visibility.path = read_trajectory(file_in_folder(options.path, "trajectory.tum"));
  visibility.min_returns = options.min_returns;
  visibility.within_m = options.within_m;
  return compare_visible_trees(a, b, pairs, visibility);
}

// Whether the list can be compared as it stands.
bool warn_of_list(const std::string& name, const std::vector<Tree>& trees, Log& log) {
  const std::string unit = diameter_complaint(trees);
  for (const std::string& complaint : {unit, doubles_complaint(trees)})
    if (!complaint.empty()) log.warn("evaluate.trees", name + ": " + complaint);
  return unit.empty();
}

int evaluate_trees(const TreeOptions& options, CommandContext& context) {
  for (const std::string& list : {options.a, options.b})
    refuse_unmapped(list);
  if (options.epochs) return evaluate_epochs(options, context);
  if (!options.output.empty()) throw ConfigError({"-o needs --epochs"});
  std::vector<Tree> a = read_trees(file_in_folder(options.a, "trees.csv"));
  const std::vector<Tree> b = read_trees(file_in_folder(options.b, "trees.csv"));
  const bool units_a = warn_of_list(options.a, a, context.log);
  const bool units_b = warn_of_list(options.b, b, context.log);
  const bool in_metres = units_a && units_b;
  const Alignment alignment = alignment_from_name(options.alignment);
  bool aligned = true;
  TreeComparison result;
  if (alignment != Alignment::kNone) {
    result.b_from_a = align_trees(a, b, alignment, options.assignment.radius_m);
    aligned = result.b_from_a.has_value();
    if (aligned) a = moved(a, *result.b_from_a);
  }
  if (!aligned) {
    context.log.warn("evaluate.trees",
                     "no motion lays three trees of A on trees of B; compared "
                     "where they are");
  }
  const std::vector<TreePair> pairs = options.matching == "optimal"
                                          ? assign_trees(a, b, options.assignment)
                                          : match_trees(a, b, options.assignment.radius_m);
  result.all = errors_of_pairs(a, b, pairs);
  if (in_metres) result.by_diameter = errors_by_diameter(a, b, pairs, options.class_m);
  result.visible = compare_visible(options, a, b, pairs);
  compare_along_paths(options, a, b, pairs, result);
  const std::string text = options.json ? comparison_json(result, options).dump(2) + "\n"
                                        : comparison_text(result, options);
  std::fputs(text.c_str(), stdout);
  const std::string few = few_pairs_complaint(result.all, options);
  if (aligned && !few.empty()) context.log.warn("evaluate.trees", few);
  return aligned && in_metres && few.empty() ? kExitDone : kExitUntrusted;
}

void add_path_options(CLI::App& command, TreeOptions& options) {
  command.add_option("--truth-returns", options.returns,
                     "returns.csv.gz of the truth: expect only trees that gave returns");
  command
      .add_option("--min-returns", options.min_returns,
                  "Fewest returns of a tree that counts as visible")
      ->capture_default_str();
  command.add_option("--path", options.path,
                     "The scanner's trajectory in B's frame: also the agreement of both maps near "
                     "it");
  command.add_option("--within-m", options.within_m, "Trees further from the path do not count")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
  command
      .add_option("--bin-m", options.bin_m,
                  "Also the detection over the distance from --path, in rings of this width")
      ->check(CLI::Range(0.1, 1000.0));
  command.add_option("--reach-m", options.reach_m, "How far these rings reach")
      ->check(CLI::Range(0.1, 10000.0))
      ->capture_default_str();
  command.add_option(
      "--other-path", options.other_path,
      "The trajectory of the other map, in B's frame. Adds how well both maps agree on the trees "
      "near both paths, as a whole and in parts of 50 m");
  command
      .add_option("--pairing-m", options.consistency.pairing_m,
                  "Trees that near count as the same for the consistency")
      ->check(CLI::Range(0.01, 100.0))
      ->capture_default_str();
  command
      .add_option("--near-both-m", options.consistency.within_m,
                  "Trees farther from either path do not count for the consistency")
      ->check(CLI::Range(0.1, 10000.0))
      ->capture_default_str();
}

}  // namespace

void add_evaluate_trees_command(CLI::App& evaluate, Command& chosen) {
  CLI::App* command =
      evaluate.add_subcommand("trees", "Compare a tree list A with another one B (the truth)");
  const auto options = std::make_shared<TreeOptions>();
  command->add_option("A", options->a, "Run folder or trees.csv")->required();
  command->add_option("B", options->b, "Truth folder or trees.csv")->required();
  command
      ->add_option("--radius-m", options->assignment.radius_m, "Largest distance of a matched pair")
      ->check(CLI::Range(1e-3, 100.0))
      ->capture_default_str();
  command
      ->add_option("--matching", options->matching,
                   "Pairs: of least cost together in position and diameter, or the nearest first")
      ->check(CLI::IsMember({"optimal", "nearest"}))
      ->capture_default_str();
  command
      ->add_option("--class-m", options->class_m, "Width of the classes of diameter in the table")
      ->check(CLI::Range(0.01, 10.0))
      ->capture_default_str();
  command
      ->add_option("--align", options->alignment,
                   "Move A onto B first, found from the trees alone (unaligned by default)")
      ->check(CLI::IsMember({"none", "yaw", "se3"}));
  add_path_options(*command, *options);
  command->add_flag("--epochs", options->epochs,
                    "A is an older list of the stand, B a newer one: trees that are gone, new and "
                    "grown");
  command->add_option("-o,--output", options->output,
                      "With --epochs: the trees and their changes, .csv or .gpkg");
  command->add_flag("--overwrite", options->overwrite, "Replace a file of -o that is there");
  command->add_flag("--json", options->json, "One JSON object on stdout");
  command->footer(
      "Example:\n  understory evaluate trees run walk.truth --align yaw\n"
      "  understory evaluate trees run walk.truth --align yaw --truth-returns walk.truth --path "
      "walk.truth\n"
      "  understory evaluate trees run2020 run2025 --epochs -o changes.gpkg");
  command->callback([&chosen, options] {
    chosen = [options](CommandContext& context) {
      context.stop_at_once();
      return evaluate_trees(*options, context);
    };
  });
}

}  // namespace understory
