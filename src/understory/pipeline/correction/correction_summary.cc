#include "understory/pipeline/correction/correction_summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "understory/map/foot_heights.h"
#include "understory/pipeline/correction/correction_evidence.h"

namespace understory {
namespace {

std::size_t count_of(const std::vector<SparseStep>& steps, SparseStepStatus status) {
  return static_cast<std::size_t>(std::count_if(
      steps.begin(), steps.end(), [&](const SparseStep& step) { return step.status == status; }));
}

// Root mean square distance of a tree's sights from their mean: the noise of the map, without
// truth.
double sight_noise_m(const std::vector<MappedStem>& stems) {
  double sum = 0.0;
  double sights = 0.0;
  for (const MappedStem& stem : stems) {
    sum += stem.variance_m2.sum() * (stem.sights - 1);
    sights += stem.sights;
  }
  return sights > 0.0 ? std::sqrt(sum / sights) : std::nan("");
}

// Root mean square angle between the axis of a sight and that of its tree: the vertical angular
// noise of P1 table 1.
double axis_noise_deg(const std::vector<MappedStem>& stems) {
  double sum = 0.0;
  double sights = 0.0;
  for (const MappedStem& stem : stems) {
    if (!std::isfinite(stem.axis_noise_rad)) continue;
    sum += stem.axis_noise_rad * stem.axis_noise_rad * (stem.axis_sights - 1);
    sights += stem.axis_sights - 1;
  }
  return sights > 0.0 ? std::sqrt(sum / sights) * 180.0 / M_PI : std::nan("");
}

void add_sharpness(const std::string& when, const MapSharpness& map, RunSummary& summary) {
  summary.quality["beta_" + when] = map.beta;
  summary.quality["beta_3d_" + when] = map.beta_3d;
  summary.quality["box_dimension_" + when] = map.dimension;
  summary.quality["box_dimension_3d_" + when] = map.dimension_3d;
  summary.quality["cluster_noise_" + when + "_m"] = map.cluster_noise_m;
  summary.quality["cluster_noise_mean_" + when + "_m"] = map.cluster_noise_mean_m;
  summary.quality["registration_noise_" + when + "_m"] = map.noise_m;
  summary.quality["registration_noise_mean_" + when + "_m"] = map.noise_mean_m;
}

// beta, d and e_C of P0 before and after, and how many corrections it took.
void add_self_correction(const CorrectionRun& run, RunSummary& summary) {
  if (run.stopped) return;
  const SelfCorrectionResult& self = run.correction.self;
  add_sharpness("before", self.before, summary);
  add_sharpness("after", self.after, summary);
  summary.quality["beta_change"] = self.blur.ratio - 1.0;
  summary.quality["beta_change_deviations"] = self.blur.deviations;
  summary.counts["corrections"] = self.kept;
  summary.counts["corrections_tried"] = static_cast<std::int64_t>(self.tried.size());
  summary.counts["corrections_by_go_icp"] = self.go_icp_calls;
  summary.counts["promising_pairs"] = static_cast<std::int64_t>(self.promising);
  summary.counts["views_eliminated"] =
      static_cast<std::int64_t>(std::count(self.use.begin(), self.use.end(), 0));
  summary.quality["corrections_share"] =
      static_cast<double>(self.kept) / static_cast<double>(run.views.size());
  summary.quality["correction_ended"] = self.stopped_because;
}

// Means over the steps that found a match, P1 table 1's way of telling how well views fit.
void add_matching(const CorrectionRun& run, RunSummary& summary) {
  double error = 0.0;
  double overlap = 0.0;
  double steps = 0.0;
  for (const SparseStep& step : run.steps) {
    if (step.status == SparseStepStatus::kFirst || step.status == SparseStepStatus::kUnmatched)
      continue;
    error += step.error_m;
    overlap += step.overlap;
    ++steps;
  }
  if (steps == 0.0) return;
  summary.quality["match_error_mean_m"] = error / steps;
  summary.quality["match_outlier_ratio_mean"] = 1.0 - overlap / steps;
}

// Feet that do not lie on the ground bend the heights of the path, and no loop shows it.
void add_carried_height(const CorrectionRun& run, RunDocuments& documents) {
  const auto carried = carried_height(run.views, run.correction.world_from_body);
  if (!carried) return;
  RunSummary& summary = documents.summary();
  summary.quality["carried_height_m"] = carried->middle_m;
  summary.quality["carried_height_low_m"] = carried->low_m;
  summary.quality["carried_height_high_m"] = carried->high_m;
  if (!feet_leave_the_ground(*carried)) return;
  documents.remark(
      "stems.heights",
      fmt::format("the body is {:.1f} to {:.1f} m above the feet of the stems near it. Their "
                  "points do not lie on the ground, so heights of the path and of trees are not "
                  "to be trusted",
                  carried->low_m, carried->high_m));
}

void add_loops(const StemCorrection& correction, RunSummary& summary) {
  summary.counts["loops_found"] = static_cast<std::int64_t>(correction.loops.size());
  summary.counts["loops_verified"] =
      std::count_if(correction.loops.begin(), correction.loops.end(),
                    [](const StemLoop& loop) { return loop.verified; });
  summary.counts["loops_accepted"] = static_cast<std::int64_t>(
      std::count(correction.accepted.begin(), correction.accepted.end(), 1));
}

double duration_s(const CorrectionRun& run) {
  if (!run.path.empty()) return to_seconds(run.path.back().stamp - run.path.front().stamp);
  if (run.views.empty()) return 0.0;
  return to_seconds(run.views.back().stamp - run.views.front().stamp);
}

}  // namespace

double length_through(const std::vector<Pose>& poses) {
  double length = 0.0;
  for (std::size_t i = 1; i < poses.size(); ++i)
    length += (poses[i].translation() - poses[i - 1].translation()).norm();
  return length;
}

void summarise_correction(const CorrectionConfig& config, const CorrectionRun& run,
                          RunDocuments& documents) {
  RunSummary& summary = documents.summary();
  summary.scans = run.path.empty() ? run.views.size() : run.path.size();
  summary.poses = summary.scans;
  summary.recording_s = duration_s(run);
  documents.count("trees", run.stems.size());
  documents.count("steps_searched", count_of(run.steps, SparseStepStatus::kSearched));
  documents.count("steps_weak", count_of(run.steps, SparseStepStatus::kWeak));
  add_loops(run.correction, summary);
  summary.quality["path_length_m"] = length_through(run.correction.world_from_body);
  add_matching(run, summary);
  summary.quality["sight_noise_m"] = sight_noise_m(run.stems);
  summary.quality["axis_noise_deg"] = axis_noise_deg(run.stems);
  add_self_correction(run, summary);
  add_carried_height(run, documents);
  documents.judge(correction_evidence(run), config.judgement);
}

}  // namespace understory
