#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "understory/cli/command.h"
#include "understory/cli/file_in_folder.h"
#include "understory/evaluation/tree_errors.h"
#include "understory/evaluation/tree_falls.h"
#include "understory/evaluation/tree_merge.h"
#include "understory/output/run_summary.h"
#include "understory/output/run_tables.h"
#include "understory/pipeline/run_folder.h"
#include "understory/util/atomic_file.h"
#include "understory/util/error.h"
#include "understory/util/output_guard.h"
#include "understory/util/version.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

struct MergeOptions {
  std::string s;
  std::string l;
  std::string folder;
  std::string reference;
  double weight = 0.5;
  bool align = false;
  bool json = false;
  bool overwrite = false;
  TreeMergeConfig merge;
};

struct BestWeight {
  double weight = 0.0;
  double rmse_m = std::numeric_limits<double>::infinity();
};

// The weight at which the merged trees lie nearest to a reference, by steps of 0.05 (P1 found the
// best one at -0.15).
BestWeight best_weight(const std::vector<Tree>& s, const std::vector<Tree>& l,
                       const std::vector<Tree>& reference, const TreeMergeConfig& config) {
  BestWeight best;
  for (int k = -10; k <= 30; ++k) {
    const double w = 0.05 * k;
    const double rmse =
        compare_trees(merge_trees(s, l, w, config).trees, reference, 1.0).position_rmse_m;
    if (rmse < best.rmse_m) best = {w, rmse};
  }
  return best;
}

// The field of L towards S, P1 figure 7.
void write_field(const fs::path& path, const std::vector<Tree>& l, const DeformationField& field) {
  AtomicTextFile file(path);
  file.write("x,y,dx,dy,smoothed_dx,smoothed_dy,paired\n");
  for (std::size_t i = 0; i < l.size(); ++i)
    file.write(fmt::format("{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{}\n", l[i].x, l[i].y,
                           field.raw[i].x(), field.raw[i].y(), field.smoothed[i].x(),
                           field.smoothed[i].y(), static_cast<int>(field.paired[i])));
  file.commit();
}

// A tree list, laid on the trees of A if that was asked for.
std::vector<Tree> beside(const std::string& file, const std::vector<Tree>& a,
                         const MergeOptions& options) {
  std::vector<Tree> trees = read_trees(file_in_folder(file, "trees.csv"));
  if (!options.align) return trees;
  const auto a_from_these = align_trees(trees, a, Alignment::kYaw, options.merge.reach_m);
  if (!a_from_these)
    throw InputError(file, "", "expected trees of which three lie like trees of " + options.s);
  return moved(trees, *a_from_these);
}

// What a map knows of felled trees; nothing where only a tree list is given.
std::vector<TreeFall> falls_in(const std::string& map) {
  const fs::path file = fs::path(map) / "felled.csv";
  return fs::exists(file) ? read_tree_falls(file) : std::vector<TreeFall>();
}

// What the folder has to say of itself.
void write_summary(const fs::path& path, const MergeOptions& options, const MergedTrees& merged,
                   const DeformationField& field, const Log& log) {
  RunSummary summary;
  summary.command = "merge";
  summary.version = kVersion;
  summary.config_yaml = fmt::format("weight: {}\nalign: {}\n", options.weight, options.align);
  for (const std::string& map : {options.s, options.l})
    summary.inputs.push_back(hash_input(file_in_folder(map, "trees.csv")));
  if (merged.joined == 0) {
    summary.status = RunStatus::kUntrusted;
    summary.reasons.emplace_back("no tree of one map lies near one of the other");
  }
  summary.warnings = log.warnings();
  summary.counts["trees"] = static_cast<std::int64_t>(merged.trees.size());
  summary.counts["joined"] = static_cast<std::int64_t>(merged.joined);
  summary.quality["apart_m"] = merged.apart_m;
  summary.quality["deformation_m"] = field.mean_m;
  write_run_json(path, summary);
}

int merge(const MergeOptions& options, CommandContext& context) {
  refuse_input_as_output(options.folder, {options.s, options.l, options.reference});
  const RunFolder place = RunFolder::claim(options.folder, options.overwrite);
  const std::vector<Tree> s = read_trees(file_in_folder(options.s, "trees.csv"));
  const std::vector<Tree> l = beside(options.l, s, options);
  const DeformationField field = deformation_field(l, s, options.merge);
  const MergedTrees merged = merge_trees(s, l, options.weight, options.merge);
  const std::vector<TreeFall> falls =
      merged_falls(merged, s, falls_in(options.s), l, falls_in(options.l));
  std::optional<BestWeight> best;
  if (!options.reference.empty())
    best = best_weight(s, l, beside(options.reference, s, options), options.merge);
  if (merged.joined == 0)
    context.log.warn("merge",
                     "no tree of one map lies near one of the other: they may have "
                     "different world frames (--align)");
  const fs::path results = place.begin_results();
  write_trees_csv(results / "trees.csv", merged.trees);
  write_tree_falls(results / "felled.csv", falls);
  write_field(results / "deformation.csv", l, field);
  write_summary(results / "run.json", options, merged, field, context.log);
  place.commit(context.log);
  place.forget_state();
  nlohmann::ordered_json json{{"trees_a", s.size()},          {"trees_b", l.size()},
                              {"trees", merged.trees.size()}, {"joined", merged.joined},
                              {"apart_m", merged.apart_m},    {"deformation_m", field.mean_m},
                              {"felled", falls.size()},       {"weight", options.weight}};
  if (best) json["best"] = {{"weight", best->weight}, {"position_rmse_m", best->rmse_m}};
  std::string text = fmt::format(
      "{} trees of {} and {}, {} seen in both ({:.3f} m apart once moved; {:.3f} m before)\n",
      merged.trees.size(), s.size(), l.size(), merged.joined, merged.apart_m, field.mean_m);
  if (best)
    text += fmt::format("nearest to the reference with a weight of {:.2f}: {:.3f} m\n",
                        best->weight, best->rmse_m);
  std::fputs((options.json ? json.dump(2) + "\n" : text).c_str(), stdout);
  return merged.joined == 0 ? kExitUntrusted : kExitDone;
}

}  // namespace

void add_merge_command(CLI::App& app, Command& chosen) {
  CLI::App* command =
      app.add_subcommand("merge", "Combine two tree maps of one place, bent against each other");
  const auto options = std::make_shared<MergeOptions>();
  command->add_option("A", options->s, "Run folder or trees.csv")->required();
  command->add_option("B", options->l, "Run folder or trees.csv")->required();
  command
      ->add_option("-o,--output", options->folder,
                   "Folder for trees.csv, felled.csv, deformation.csv and run.json")
      ->required();
  command
      ->add_option("--weight", options->weight,
                   "0: trees stay where A has them, 1: where B has them (P1 (9))")
      ->check(CLI::Range(-1.0, 2.0))
      ->capture_default_str();
  command->add_flag(
      "--align", options->align,
      "Lay B (and the reference) on A first by the trees alone, turned about the vertical "
      "and shifted");
  command
      ->add_option("--reference", options->reference,
                   "Tree list to be near to: tells the best weight")
      ->check(CLI::ExistingPath);
  command->add_option("--reach-m", options->merge.reach_m, "The same tree lies that near in both")
      ->check(CLI::Range(0.01, 100.0))
      ->capture_default_str();
  command
      ->add_option("--duplicate-m", options->merge.duplicate_m,
                   "Trees that near once moved are one")
      ->check(CLI::Range(0.0, 100.0))
      ->capture_default_str();
  command
      ->add_option("--smoothing", options->merge.smoothing,
                   "Rounds of smoothing of the difference over neighbouring trees")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str();
  command->add_flag("--overwrite", options->overwrite, kOverwriteMeaning);
  command->add_flag("--json", options->json, "One JSON object on stdout");
  command->footer("Example:\n  understory merge monday tuesday --align -o both");
  command->callback([&chosen, options] {
    chosen = [options](CommandContext& context) { return merge(*options, context); };
  });
}

}  // namespace understory
