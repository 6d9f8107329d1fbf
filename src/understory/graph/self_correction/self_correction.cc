#include "understory/graph/self_correction/self_correction.h"

#include <algorithm>
#include <cmath>

#include "understory/graph/self_correction/correction_methods.h"
#include "understory/util/error.h"
#include "understory/util/median.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

std::vector<SparseTarget> targets_of(const std::vector<SparsePoints>& views) {
  std::vector<SparseTarget> targets(views.size(), SparseTarget({}));
  parallel_for(views.size(), 16, [&](std::size_t i) { targets[i] = SparseTarget(views[i]); });
  return targets;
}

void describe_power(ConfigTable& table, PowerConfig& config) {
  table.add_enum("coefficient", config.coefficient,
                 {{"index", PowerCoefficient::kIndex},
                  {"path_length", PowerCoefficient::kPathLength},
                  {"match_error", PowerCoefficient::kMatchError},
                  {"metric", PowerCoefficient::kMetric},
                  {"screw", PowerCoefficient::kScrew}},
                 "how a correction is shared among the views between two ends: by number, path "
                 "length, errors of the matches, a metric, or along a screw");
  table.add("metric_rotation_m2", config.metric_rotation_m2, {0.0, 1e6}, "m^2",
            "coefficient metric: weight of a squared angle");
  table.add("metric_translation", config.metric_translation, {0.0, 1e6}, "",
            "coefficient metric: weight of a squared distance");
}

void describe_gain(ConfigTable& table, GainConfig& config) {
  table.add("pool", config.pool, {1, 1'000'000}, "",
            "number of pairs among which the next is chosen");
  table.add("window_l0", config.window_l0, {0.0, 100.0}, "stem spacings",
            "views within this distance along the path, to each side, are joined for a match");
  table.add("window_views", config.window_views, {1, 1000}, "",
            "most views that are joined to each side");
  table.add("match_sd_m", config.match_sd_m, {1e-4, 10.0}, "m",
            "standard deviation of a match of joined views with full overlap");
  table.add("min_gain", config.min_gain, {0.0, 100.0}, "nats",
            "the correction ends when no pair has a larger expected gain of information");
  table.add("revisits", config.revisits, {0, 100}, "",
            "number of rounds in which accepted pairs are matched again from the better poses");
  table.add("largest_step_l0", config.largest_step_l0, {0.0, 100.0}, "stem spacings",
            "largest motion of a view by one match; larger ones are refused");
}

}  // namespace

SelfCorrectionConfig::SelfCorrectionConfig() {
  // P1 section 2.3: the search of the matches.
  go_icp.yaw_range_deg = 15.0;
  go_icp.shift_range_m = 1.5;
}

void describe(ConfigTable& table, SelfCorrectionConfig& config) {
  table.add_enum("method", config.method,
                 {{"none", CorrectionMethod::kNone},
                  {"powers", CorrectionMethod::kPowers},
                  {"powers_printed", CorrectionMethod::kPowersPrinted},
                  {"lattice", CorrectionMethod::kLattice},
                  {"pose_graph", CorrectionMethod::kPoseGraph},
                  {"gaussian_process", CorrectionMethod::kGaussianProcess},
                  {"expected_gain", CorrectionMethod::kExpectedGain}},
                 "how the map corrects itself; docs/method/sparse.md describes each method");
  table.add_enum("order", config.order,
                 {{"small", CorrectionOrder::kSmallGaps},
                  {"medium", CorrectionOrder::kMediumGaps},
                  {"random", CorrectionOrder::kRandom},
                  {"gain", CorrectionOrder::kGain}},
                 "method powers: small, medium or random gaps first, or the pair with the largest "
                 "expected gain");
  table.section("pairs", [&] { describe(table, config.pairs); });
  table.section("power", [&] { describe_power(table, config.power); });
  table.section("lattice", [&] {
    table.add("spacing", config.lattice.spacing, {1, 1'000'000}, "",
              "method lattice: every so many views");
    table.add("longest_gap", config.lattice.longest_gap, {1, 1'000'000}, "",
              "method lattice: largest number of views between the two of a pair");
    table.add("largest_outlier_ratio", config.lattice.largest_outlier_ratio, {0.0, 1.0}, "",
              "largest outlier ratio of a match; larger ones are refused");
    table.add("largest_error_m", config.lattice.largest_error_m, {0.0, 1e6}, "m",
              "largest distance (RMS) of the matched stems; 0: no limit");
  });
  table.section("gain", [&] { describe_gain(table, config.gain); });
  table.section("icp", [&] { describe(table, config.icp); });
  table.section("go_icp", [&] { describe(table, config.go_icp); });
  table.add("min_final_overlap", config.min_final_overlap, {0.0, 1.0}, "",
            "least overlap of the views' sectors after a match");
  table.add("largest_share", config.largest_share, {0.0, 1.0}, "",
            "most corrections, as a share of the views (the lattice has its own number)");
  table.add("patience", config.patience, {1, 1'000'000}, "",
            "method powers: ends after so many corrections without a sharper map");
  table.add("blurrier_sd", config.blurrier_sd, {0.0, 100.0}, "sd",
            "a solution is refused that is blurrier (beta) by more than this many of beta's own "
            "standard deviations; methods that solve all pairs at once");
  table.add("eliminate_factor", config.eliminate_factor, {0.0, 1e6}, "",
            "views farther from the trees than this times the median (mean square) are left out of "
            "the map; 0: none");
  table.add("eliminate_share", config.eliminate_share, {0.0, 1.0}, "",
            "largest share of views that are left out");
  table.add("seed", config.seed, {0, 1'000'000'000}, "", "seed of the pairs drawn at random");
}

CorrectionViews::CorrectionViews(const SelfCorrectionProblem& given, const ProgressSink& asked)
    : problem(given),
      progress(asked),
      targets(targets_of(given.views)),
      overlap(estimate_view_cone(given.views)) {
  std::vector<double> spacings;
  for (const SparseTarget& target : targets) {
    if (target.l0_m > 0.0) spacings.push_back(target.l0_m);
  }
  l0_m = upper_median(spacings);
}

int correction_budget(std::size_t views, const SelfCorrectionConfig& config) {
  return std::min(config.pairs.chosen,
                  static_cast<int>(config.largest_share * static_cast<double>(views)));
}

PoseGraphProblem chain_problem(const SelfCorrectionProblem& problem,
                               const std::vector<Pose>& world_from_view) {
  PoseGraphProblem graph;
  graph.world_from_keyframe = world_from_view;
  graph.tilts = problem.tilts;
  for (std::size_t i = 1; i < world_from_view.size(); ++i)
    graph.odometry.push_back({static_cast<int>(i) - 1, static_cast<int>(i), problem.steps[i],
                              problem.step_covariances[i]});
  return graph;
}

namespace {

void correct_by_method(const CorrectionViews& views, const SelfCorrectionConfig& config,
                       SelfCorrectionResult& result) {
  switch (config.method) {
    case CorrectionMethod::kNone:
      break;
    case CorrectionMethod::kPowers:
    case CorrectionMethod::kPowersPrinted:
      correct_by_powers(views, config, result);
      break;
    case CorrectionMethod::kLattice:
      correct_by_lattice(views, config, result);
      break;
    case CorrectionMethod::kPoseGraph:
      correct_by_pose_graph(views, config, result);
      break;
    case CorrectionMethod::kGaussianProcess:
      correct_by_gaussian_process(views, config, result);
      break;
    case CorrectionMethod::kExpectedGain:
      correct_by_expected_gain(views, config, result);
      break;
  }
  result.kept = static_cast<int>(std::count_if(result.tried.begin(), result.tried.end(),
                                               [](const auto& t) { return t.kept; }));
  result.go_icp_calls = static_cast<int>(std::count_if(result.tried.begin(), result.tried.end(),
                                                       [](const auto& t) { return t.by_go_icp; }));
}

}  // namespace

SelfCorrectionResult self_correct(const SelfCorrectionProblem& problem,
                                  const SelfCorrectionConfig& config,
                                  const ProgressSink& progress) {
  UNDERSTORY_CHECK(problem.views.size() == problem.world_from_view.size());
  UNDERSTORY_CHECK(problem.views.size() == problem.map_views.size());
  UNDERSTORY_CHECK(problem.views.size() == problem.steps.size());
  UNDERSTORY_CHECK(problem.views.size() == problem.step_errors.size());
  UNDERSTORY_CHECK(problem.views.size() == problem.step_covariances.size());
  SelfCorrectionResult result;
  result.world_from_view = problem.world_from_view;
  result.use.assign(problem.views.size(), 1);
  result.before = map_sharpness(problem.map_views, problem.world_from_view, {}, config.sharpness);
  result.after = result.before;
  const bool corrected = config.method != CorrectionMethod::kNone && problem.views.size() >= 3;
  if (corrected) {
    correct_by_method(CorrectionViews(problem, progress), config, result);
  } else {
    result.stopped_because = "the correction is switched off, or there are too few views";
  }
  if (config.eliminate_factor > 0.0) {
    const RegistrationNoise noise =
        registration_noise(problem.map_views, result.world_from_view, {}, config.sharpness);
    result.use = views_worth_keeping(noise, config.eliminate_factor, config.eliminate_share);
  }
  if (corrected) {
    result.blur =
        blur_change(map_points(problem.map_views, problem.world_from_view, {}),
                    map_points(problem.map_views, result.world_from_view, {}), config.sharpness);
  }
  if (corrected || config.eliminate_factor > 0.0)
    result.after =
        map_sharpness(problem.map_views, result.world_from_view, result.use, config.sharpness);
  return result;
}

}  // namespace understory
