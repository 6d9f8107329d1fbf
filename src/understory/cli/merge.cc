#include <memory>
#include <nlohmann/json.hpp>

#include "understory/cli/command.h"
#include "understory/cli/outcome.h"
#include "understory/cli/suggestion.h"
#include "understory/pipeline/merging/tree_map_merging.h"

namespace understory {
namespace {

struct MergeOptions {
  MergeRequest request;
  bool json = false;
};

nlohmann::ordered_json to_json(const MergeOutcome& outcome, double weight) {
  nlohmann::ordered_json json{{"status", to_string(outcome.status)},
                              {"reasons", outcome.reasons},
                              {"trees_a", outcome.trees_a},
                              {"trees_b", outcome.trees_b},
                              {"trees", outcome.trees},
                              {"joined", outcome.joined},
                              {"apart_m", outcome.apart_m},
                              {"deformation_m", outcome.deformation_m},
                              {"felled", outcome.felled},
                              {"weight", weight}};
  const MatchChance& chance = outcome.chance;
  json["chance"] = {{"weight", chance.weight},
                    {"chance_weight", chance.chance_weight},
                    {"chance_sd", chance.chance_sd},
                    {"sigmas", chance.sigmas},
                    {"copies", chance.copies},
                    {"diameters", chance.diameters},
                    {"diameter_correlation", chance.diameter_correlation},
                    {"diameter_sigmas", chance.diameter_sigmas}};
  if (outcome.best)
    json["best"] = {{"weight", outcome.best->weight},
                    {"position_rmse_m", outcome.best->position_rmse_m}};
  return json;
}

int merge(const MergeOptions& options, CommandContext& context) {
  for (const std::string& map : {options.request.a, options.request.b})
    refuse_unmapped(map);
  const MergeOutcome outcome = run_merging(options.request, context.log, context.until_stopped());
  if (!options.json) return report_outcome(outcome);
  return report_outcome(to_json(outcome, options.request.weight).dump(2), outcome.status,
                        outcome.reasons);
}

}  // namespace

void add_merge_command(CLI::App& app, Command& chosen) {
  CLI::App* command =
      app.add_subcommand("merge", "Combine two tree maps of one place, bent against each other");
  const auto options = std::make_shared<MergeOptions>();
  command->add_option("A", options->request.a, "Run folder or trees.csv")->required();
  command->add_option("B", options->request.b, "Run folder or trees.csv")->required();
  command
      ->add_option("-o,--output", options->request.folder,
                   "Folder for trees.csv, felled.csv, deformation.csv, report.html and run.json")
      ->required();
  command
      ->add_option("--weight", options->request.weight,
                   "0: trees stay where A has them, 1: where B has them")
      ->check(CLI::Range(-1.0, 2.0))
      ->capture_default_str();
  command->add_flag(
      "--align", options->request.align,
      "Lay B (and the reference) on A first by the trees alone, turned about the vertical "
      "and shifted");
  command
      ->add_option("--reference", options->request.reference,
                   "Tree list of the truth: prints the weight that comes nearest to it")
      ->check(CLI::ExistingPath);
  command
      ->add_option("--reach-m", options->request.merge.reach_m,
                   "Largest distance of one tree in the two maps")
      ->check(CLI::Range(0.01, 100.0))
      ->capture_default_str();
  command
      ->add_option("--duplicate-m", options->request.merge.duplicate_m,
                   "Trees nearer than this after the move are one")
      ->check(CLI::Range(0.0, 100.0))
      ->capture_default_str();
  command
      ->add_option("--smoothing", options->request.merge.smoothing,
                   "Rounds of smoothing of the difference over neighbouring trees")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str();
  command->add_flag("--overwrite", options->request.overwrite, kOverwriteMeaning);
  command->add_flag("--json", options->json, "One JSON object on stdout");
  command->footer("Example:\n  understory merge monday tuesday --align -o both");
  command->callback([&chosen, options] {
    chosen = [options](CommandContext& context) { return merge(*options, context); };
  });
}

}  // namespace understory
