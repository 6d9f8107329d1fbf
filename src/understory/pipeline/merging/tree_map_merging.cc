#include "understory/pipeline/merging/tree_map_merging.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "understory/evaluation/trajectory.h"
#include "understory/evaluation/trees/tree_errors.h"
#include "understory/evaluation/trees/tree_falls.h"
#include "understory/evaluation/trees/tree_list_check.h"
#include "understory/output/run_tables.h"
#include "understory/pipeline/judgement/inherited_trust.h"
#include "understory/pipeline/run_folder/run_documents.h"
#include "understory/pipeline/run_folder/run_folder.h"
#include "understory/util/config/config.h"
#include "understory/util/error.h"
#include "understory/util/files/atomic_file.h"
#include "understory/util/files/csv.h"
#include "understory/util/files/file_in_folder.h"
#include "understory/util/files/output_guard.h"
#include "understory/util/fixed_text.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

constexpr const char* kTrees = "trees.csv";
constexpr const char* kFelled = "felled.csv";
constexpr const char* kTrajectory = "trajectory.tum";

// By steps of 0.05 (P1 found the best weight at -0.15).
BestWeight best_weight(const std::vector<Tree>& a, const std::vector<Tree>& b,
                       const std::vector<Tree>& reference, const TreeMergeConfig& config,
                       const ProgressSink& progress) {
  BestWeight best{0.0, std::numeric_limits<double>::infinity()};
  for (int k = -10; k <= 30; ++k) {
    progress.poll();
    const double w = 0.05 * k;
    const double rmse =
        compare_trees(merge_trees(a, b, w, config).trees, reference, 1.0).position_rmse_m;
    if (rmse < best.position_rmse_m) best = {w, rmse};
  }
  return best;
}

// The field of B towards A, P1 figure 7.
void write_field(const fs::path& path, const std::vector<Tree>& b, const DeformationField& field) {
  AtomicTextFile file(path);
  file.write("x,y,dx,dy,smoothed_dx,smoothed_dy,paired\n");
  for (std::size_t i = 0; i < b.size(); ++i)
    file.write(fmt::format("{},{},{},{},{},{},{}\n", csv_cell(b[i].x, 3), csv_cell(b[i].y, 3),
                           csv_cell(field.raw[i].x(), 3), csv_cell(field.raw[i].y(), 3),
                           csv_cell(field.smoothed[i].x(), 3), csv_cell(field.smoothed[i].y(), 3),
                           static_cast<int>(field.paired[i])));
  file.commit();
}

// A tree list, and the motion that laid it on the trees of A if that was asked for.
struct Beside {
  std::vector<Tree> trees;
  Pose a_from_these;
};
Beside beside(const std::string& file, const std::vector<Tree>& a, const MergeRequest& request,
              const ProgressSink& progress) {
  std::vector<Tree> trees = read_trees(file_in_folder(file, kTrees));
  if (!request.align) return {std::move(trees), {}};
  const auto a_from_these = align_trees(trees, a, Alignment::kYaw, request.merge.reach_m, progress);
  if (!a_from_these)
    throw InputError(file, "", "expected trees of which three lie like trees of " + request.a);
  return {moved(trees, *a_from_these), *a_from_these};
}

// The path of a map in the plane after a motion; empty where only a tree list is given.
std::vector<Eigen::Vector2d> path_of(const std::string& map, const Pose& a_from_map) {
  std::vector<Eigen::Vector2d> path;
  const fs::path file = fs::path(map) / kTrajectory;
  if (!fs::exists(file)) return path;
  for (const StampedPose& pose : read_trajectory(file))
    path.emplace_back((a_from_map * pose.world_from_body.translation()).head<2>());
  return path;
}

// What a map knows of felled trees; nothing where only a tree list is given.
std::vector<TreeFall> falls_in(const std::string& map) {
  const fs::path file = fs::path(map) / kFelled;
  return fs::exists(file) ? read_tree_falls(file) : std::vector<TreeFall>();
}

// What two maps came to.
struct Merge {
  std::vector<Tree> a;
  std::vector<Tree> b;  // beside a
  bool same = false;    // a copy of a
  DeformationField field;
  std::vector<Eigen::Vector2d> path_of_a;
  std::vector<Eigen::Vector2d> path_of_b;  // beside a
  MergedTrees merged;
  std::vector<TreeFall> falls;
  std::optional<BestWeight> best;
  MatchChance chance;
};

Merge merge_maps(const MergeRequest& request, const ProgressSink& progress, StageTimes& times) {
  Merge m;
  std::vector<Tree> reference;
  {
    const ScopedTimer timer(times, "reading");
    m.a = read_trees(file_in_folder(request.a, kTrees));
    m.same = are_copies(m.a, read_trees(file_in_folder(request.b, kTrees)));
    Beside b = beside(request.b, m.a, request, progress);
    m.b = std::move(b.trees);
    m.path_of_a = path_of(request.a, {});
    m.path_of_b = path_of(request.b, b.a_from_these);
    if (!request.reference.empty())
      reference = beside(request.reference, m.a, request, progress).trees;
  }
  const ScopedTimer timer(times, "merging");
  progress.poll();
  m.field = deformation_field(m.b, m.a, request.merge);
  progress.poll();
  m.merged = merge_trees(m.a, m.b, request.weight, request.merge);
  m.falls = merged_falls(m.merged, m.a, falls_in(request.a), m.b, falls_in(request.b));
  if (!request.reference.empty())
    m.best = best_weight(m.a, m.b, reference, request.merge, progress);
  m.chance =
      match_chance(m.a, m.b, m.merged, request.weight, request.merge, request.align, progress);
  return m;
}

void write_tables(const fs::path& results, const Merge& m, StageTimes& times) {
  const ScopedTimer timer(times, "writing");
  write_trees_csv(results / kTrees, m.merged.trees);
  write_tree_falls(results / kFelled, m.falls);
  write_field(results / "deformation.csv", m.b, m.field);
}

// The options of the command, by their names.
std::string yaml_of(MergeRequest request) {
  ConfigTable table;
  table.add("weight", request.weight, {}, "", "");
  table.add("align", request.align, "");
  table.add("reference", request.reference, "");
  table.add("reach_m", request.merge.reach_m, {}, "m", "");
  table.add("duplicate_m", request.merge.duplicate_m, {}, "m", "");
  table.add("smoothing", request.merge.smoothing, {}, "", "");
  return table.to_yaml(false);
}

std::string name_of(const std::string& map) {
  const fs::path path = fs::path(map).lexically_normal();
  return (path.has_filename() ? path : path.parent_path()).filename().string();
}

void add_inputs(const MergeRequest& request, RunDocuments& documents) {
  std::vector<std::string> maps = {request.a, request.b};
  if (!request.reference.empty()) maps.push_back(request.reference);
  for (const std::string& map : maps)
    documents.add_input(file_in_folder(map, kTrees));
  for (const std::string& map : {request.a, request.b}) {
    if (const fs::path felled = fs::path(map) / kFelled; fs::exists(felled))
      documents.add_input(felled);
  }
}

// What is wrong with the lists themselves.
void judge_lists(const MergeRequest& request, const Merge& m, RunDocuments& documents) {
  const auto lower = [&](const std::string& complaint) {
    if (!complaint.empty()) documents.lower(RunStatus::kUntrusted, complaint);
  };
  for (const auto& [trees, name] : {std::pair(&m.a, request.a), std::pair(&m.b, request.b)}) {
    for (const std::string& complaint : {diameter_complaint(*trees), doubles_complaint(*trees)})
      lower(complaint.empty() ? "" : name + ": " + complaint);
  }
  std::vector<TreePair> pairs;
  for (std::size_t i = 0; i < m.merged.trees.size(); ++i) {
    if (m.merged.index_in_s[i] >= 0 && m.merged.index_in_l[i] >= 0)
      pairs.emplace_back(m.merged.index_in_s[i], m.merged.index_in_l[i]);
  }
  lower(diameter_complaint(m.a, m.b, pairs));
}

void judge(const MergeRequest& request, const Merge& m, RunDocuments& documents) {
  if (m.merged.joined == 0) {
    documents.lower(RunStatus::kUntrusted,
                    "no tree of one map lies near one of the other: they may have different world "
                    "frames (--align)");
  } else if (const std::string complaint = chance_complaint(m.chance); !complaint.empty()) {
    const char* frames = ", or in different frames: --align lays one on the other first";
    documents.lower(RunStatus::kUntrusted, complaint + (request.align ? "" : frames));
  }
  if (m.same)
    documents.lower(RunStatus::kUntrusted,
                    "both maps hold the same trees: each of their observations counts twice");
  judge_lists(request, m, documents);
  documents.inherit(trust_of_run(request.b));
  documents.inherit(trust_of_run(request.a));
}

ReportDeformation deformation_of(const Merge& m) {
  ReportDeformation report;
  for (std::size_t i = 0; i < m.b.size(); ++i)
    report.arrows.push_back({{m.b[i].x, m.b[i].y}, m.field.smoothed[i]});
  report.path_of_first = m.path_of_a;
  report.path_of_second = report.moved_path_of_second = m.path_of_b;
  const std::vector<Eigen::Vector2d> by = field_at(m.b, m.field, m.path_of_b);
  for (std::size_t k = 0; k < by.size(); ++k)
    report.moved_path_of_second[k] += by[k];
  report.mean_m = m.field.mean_m;
  return report;
}

void describe(const MergeRequest& request, const Merge& m, RunDocuments& documents) {
  add_inputs(request, documents);
  judge(request, m, documents);
  documents.count("trees", m.merged.trees.size());
  documents.count("trees_seen_in_both", m.merged.joined);
  documents.count("trees_felled", m.falls.size());
  std::map<std::string, Figure>& quality = documents.summary().quality;
  quality["apart_m"] = m.merged.apart_m;
  quality["deformation_m"] = m.field.mean_m;
  quality["pair_weight"] = m.chance.weight;
  quality["pair_weight_by_chance"] = m.chance.chance_weight;
  quality["pair_weight_by_chance_sd"] = m.chance.chance_sd;
  quality["diameter_correlation"] = m.chance.diameter_correlation;
  ReportInput& report = documents.report();
  report.title = name_of(request.a) + " and " + name_of(request.b);
  report.made_from = fmt::format("two tree maps of one place, {} and {} trees, merged into one",
                                 m.a.size(), m.b.size());
  report.trees = &m.merged.trees;
  report.falls = m.falls;
  if (m.merged.joined > 0) report.deformation = deformation_of(m);
}

std::string text_of(const Merge& m) {
  std::string text = fmt::format(
      "{} trees of {} and {}, {} seen in both ({:.3f} m apart once moved; {:.3f} m before)",
      m.merged.trees.size(), m.a.size(), m.b.size(), m.merged.joined, m.merged.apart_m,
      m.field.mean_m);
  if (m.merged.joined > 0)
    text += fmt::format("\nweight of these pairs {:.1f}; of pairs by chance {:.1f} +- {:.1f}",
                        m.chance.weight, m.chance.chance_weight, m.chance.chance_sd);
  if (std::isfinite(m.chance.diameter_correlation))
    text += fmt::format("\ndiameters of {} pairs agree with a correlation of {}",
                        m.chance.diameters, fixed_text(m.chance.diameter_correlation, 2));
  if (m.best)
    text += fmt::format("\nnearest to the reference with a weight of {:.2f}: {:.3f} m",
                        m.best->weight, m.best->position_rmse_m);
  return text;
}

}  // namespace

MergeOutcome run_merging(const MergeRequest& request, Log& log, const ProgressSink& progress) {
  refuse_input_as_output(request.folder, {request.a, request.b, request.reference});
  const RunFolder place = RunFolder::claim(request.folder, request.overwrite);
  StageTimes times;
  RunDocuments documents("merge", {yaml_of(request), {}, "", {}}, times, log);
  const Merge m = merge_maps(request, progress, times);
  const fs::path results = place.begin_results();
  write_tables(results, m, times);
  describe(request, m, documents);
  progress.poll();
  documents.write(results);
  place.commit(log);
  place.forget_state();
  return {documents.outcome(text_of(m)),
          m.a.size(),
          m.b.size(),
          m.merged.trees.size(),
          m.merged.joined,
          m.merged.apart_m,
          m.field.mean_m,
          m.falls.size(),
          m.chance,
          m.best};
}

}  // namespace understory
