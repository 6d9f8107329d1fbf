#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "understory/cli/command.h"
#include "understory/cli/file_in_folder.h"
#include "understory/cli/outcome.h"
#include "understory/evaluation/tree_errors.h"
#include "understory/evaluation/tree_falls.h"
#include "understory/evaluation/tree_match_chance.h"
#include "understory/evaluation/tree_merge.h"
#include "understory/output/run_summary.h"
#include "understory/output/run_tables.h"
#include "understory/pipeline/judgement/inherited_trust.h"
#include "understory/pipeline/run_folder/run_folder.h"
#include "understory/util/error.h"
#include "understory/util/files/atomic_file.h"
#include "understory/util/files/output_guard.h"
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

// What two maps came to.
struct Merge {
  std::vector<Tree> s;
  std::vector<Tree> l;  // beside s
  DeformationField field;
  MergedTrees merged;
  std::vector<TreeFall> falls;
  std::optional<BestWeight> best;
  MatchChance chance;
};

Merge merge_maps(const MergeOptions& options) {
  Merge m;
  m.s = read_trees(file_in_folder(options.s, "trees.csv"));
  m.l = beside(options.l, m.s, options);
  m.field = deformation_field(m.l, m.s, options.merge);
  m.merged = merge_trees(m.s, m.l, options.weight, options.merge);
  m.falls = merged_falls(m.merged, m.s, falls_in(options.s), m.l, falls_in(options.l));
  if (!options.reference.empty())
    m.best = best_weight(m.s, m.l, beside(options.reference, m.s, options), options.merge);
  m.chance = match_chance(m.s, m.l, m.merged, options.weight, options.merge, options.align);
  return m;
}

nlohmann::ordered_json to_json(const Merge& m, const MergeOptions& options,
                               const RunSummary& summary) {
  nlohmann::ordered_json json{{"status", to_string(summary.status)},
                              {"reasons", summary.reasons},
                              {"trees_a", m.s.size()},
                              {"trees_b", m.l.size()},
                              {"trees", m.merged.trees.size()},
                              {"joined", m.merged.joined},
                              {"apart_m", m.merged.apart_m},
                              {"deformation_m", m.field.mean_m},
                              {"felled", m.falls.size()},
                              {"weight", options.weight}};
  json["chance"] = {{"weight", m.chance.weight},
                    {"chance_weight", m.chance.chance_weight},
                    {"chance_sd", m.chance.chance_sd},
                    {"sigmas", m.chance.sigmas},
                    {"copies", m.chance.copies},
                    {"diameters", m.chance.diameters},
                    {"diameter_correlation", m.chance.diameter_correlation},
                    {"diameter_sigmas", m.chance.diameter_sigmas}};
  if (m.best) json["best"] = {{"weight", m.best->weight}, {"position_rmse_m", m.best->rmse_m}};
  return json;
}

std::string to_text(const Merge& m) {
  std::string text = fmt::format(
      "{} trees of {} and {}, {} seen in both ({:.3f} m apart once moved; {:.3f} m before)\n",
      m.merged.trees.size(), m.s.size(), m.l.size(), m.merged.joined, m.merged.apart_m,
      m.field.mean_m);
  if (m.merged.joined > 0)
    text += fmt::format("weight of these pairs {:.1f}; of pairs by chance {:.1f} +- {:.1f}\n",
                        m.chance.weight, m.chance.chance_weight, m.chance.chance_sd);
  if (std::isfinite(m.chance.diameter_correlation))
    text += fmt::format("diameters of {} pairs agree with a correlation of {:.2f}\n",
                        m.chance.diameters, m.chance.diameter_correlation);
  if (m.best)
    text += fmt::format("nearest to the reference with a weight of {:.2f}: {:.3f} m\n",
                        m.best->weight, m.best->rmse_m);
  return text;
}

// run.json, so that whoever goes on from the merged map knows what it is worth.
RunSummary summary_of(const Merge& m, const MergeOptions& options, const Log& log) {
  RunSummary summary;
  summary.command = "merge";
  summary.version = kVersion;
  if (m.merged.joined == 0) {
    summary.status = RunStatus::kUntrusted;
    summary.reasons.emplace_back(
        "no tree of one map lies near one of the other: they may have different world frames "
        "(--align)");
  } else if (const std::string complaint = chance_complaint(m.chance); !complaint.empty()) {
    summary.status = RunStatus::kUntrusted;
    summary.reasons.push_back(complaint);
  }
  for (const std::string& map : {options.l, options.s}) {
    inherit(trust_of_run(map), summary.status, summary.reasons);
    summary.inputs.insert(summary.inputs.begin(), hash_input(file_in_folder(map, "trees.csv")));
  }
  summary.warnings = log.warnings();
  summary.config_yaml = fmt::format(
      "weight: {}\nalign: {}\nreach_m: {}\nduplicate_m: {}\nsmoothing: {}\n", options.weight,
      options.align, options.merge.reach_m, options.merge.duplicate_m, options.merge.smoothing);
  summary.counts["trees"] = static_cast<std::int64_t>(m.merged.trees.size());
  summary.counts["trees_seen_in_both"] = static_cast<std::int64_t>(m.merged.joined);
  summary.counts["trees_felled"] = static_cast<std::int64_t>(m.falls.size());
  summary.quality["apart_m"] = m.merged.apart_m;
  summary.quality["deformation_m"] = m.field.mean_m;
  summary.quality["pair_weight"] = m.chance.weight;
  summary.quality["pair_weight_by_chance"] = m.chance.chance_weight;
  summary.quality["pair_weight_by_chance_sd"] = m.chance.chance_sd;
  summary.quality["diameter_correlation"] = m.chance.diameter_correlation;
  summary.cpu_s = process_cpu_seconds();
  summary.peak_memory_mb = peak_memory_mb();
  return summary;
}

int merge(const MergeOptions& options, CommandContext& context) {
  const auto start = std::chrono::steady_clock::now();
  refuse_input_as_output(options.folder, {options.s, options.l, options.reference});
  const RunFolder place = RunFolder::claim(options.folder, options.overwrite);
  const Merge m = merge_maps(options);
  RunSummary summary = summary_of(m, options, context.log);
  const fs::path results = place.begin_results();
  write_trees_csv(results / "trees.csv", m.merged.trees);
  write_tree_falls(results / "felled.csv", m.falls);
  write_field(results / "deformation.csv", m.l, m.field);
  summary.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  write_run_json(results / "run.json", summary);
  place.commit(context.log);
  place.forget_state();
  std::string text = to_text(m);
  text.pop_back();  // the line end, which is printed
  return report_outcome(options.json ? to_json(m, options, summary).dump(2) : text, summary.status,
                        summary.reasons);
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
                   "0: trees stay where A has them, 1: where B has them")
      ->check(CLI::Range(-1.0, 2.0))
      ->capture_default_str();
  command->add_flag(
      "--align", options->align,
      "Lay B (and the reference) on A first by the trees alone, turned about the vertical "
      "and shifted");
  command
      ->add_option("--reference", options->reference,
                   "Tree list of the truth: prints the weight that comes nearest to it")
      ->check(CLI::ExistingPath);
  command
      ->add_option("--reach-m", options->merge.reach_m,
                   "Largest distance of one tree in the two maps")
      ->check(CLI::Range(0.01, 100.0))
      ->capture_default_str();
  command
      ->add_option("--duplicate-m", options->merge.duplicate_m,
                   "Trees nearer than this after the move are one")
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
