#include "understory/graph/loops/loop_closure.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <optional>

#include "understory/geometry/pose.h"
#include "understory/geometry/rotation_between.h"
#include "understory/geometry/symmetric_solver.h"
#include "understory/graph/graph_constants.h"
#include "understory/graph/self_correction/structure.h"
#include "understory/util/angles.h"
#include "understory/util/parallel.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

using namespace graph_constants::loop_closure;

// A side of the loop, turned so that z is up.
struct Side {
  Points points;
  Pose body_from_level;
  MatchTargetPtr target;
};

Points move_points(const Points& points, const Pose& pose) {
  const Eigen::Matrix3f rotation = pose.rotation_matrix().cast<float>();
  const Eigen::Vector3f translation = pose.translation().cast<float>();
  Points moved;
  moved.reserve(points.size());
  for (const Eigen::Vector3f& p : points)
    moved.emplace_back(rotation * p + translation);
  return moved;
}

Side make_side(const Points& points, const Eigen::Vector3d& up, const Matcher& matcher) {
  const Pose level(rotation_between(up.normalized(), Eigen::Vector3d::UnitZ()),
                   Eigen::Vector3d::Zero());
  Side side;
  side.points = move_points(points, level);
  side.body_from_level = level.inverse();
  side.target = matcher.make_target(side.points);
  return side;
}

// The estimated pose first, then around it.
std::vector<Pose> make_starts(const Pose& guess, const LoopInput& input,
                              const LoopClosureConfig& config) {
  double step = config.search_step_m;
  double yaw_step = config.search_yaw_step_deg * kDegree;
  const double reach = config.search_sigmas * input.sigma_translation_m;
  const double yaw_reach =
      std::min(config.search_sigmas * input.sigma_rotation_rad, std::numbers::pi);
  int n = 0;
  int turns = 0;
  for (;;) {
    n = static_cast<int>(std::floor(reach / step + 0.5));
    turns = static_cast<int>(std::floor(yaw_reach / yaw_step + 0.5));
    if ((2 * n + 1) * (2 * n + 1) * (2 * turns + 1) <= std::max(config.max_starts, 1)) break;
    step *= kStepGrowth;
    yaw_step *= kYawStepGrowth;
  }
  std::vector<Pose> starts{guess};
  for (int x = -n; x <= n; ++x) {
    for (int y = -n; y <= n; ++y) {
      if (x * x + y * y > n * n + 1) continue;
      for (int turn = -turns; turn <= turns; ++turn) {
        if (x == 0 && y == 0 && turn == 0) continue;
        const Eigen::Quaterniond yaw = so3_exp({0.0, 0.0, turn * yaw_step});
        // The turn is about the place itself, not about the origin of the target.
        starts.emplace_back(yaw * guess.rotation(),
                            guess.translation() + Eigen::Vector3d(x * step, y * step, 0.0));
      }
    }
  }
  return starts;
}

Points every_nth(const Points& points, std::size_t count) {
  const std::size_t step = std::max<std::size_t>(1, points.size() / count);
  Points some;
  for (std::size_t i = 0; i < points.size(); i += step)
    some.push_back(points[i]);
  return some;
}

// Starts by their coarse cost, best first; neighbours of better ones left out.
std::vector<Pose> best_starts(const Side& target, const Side& source,
                              const std::vector<Pose>& starts, const LoopClosureConfig& config) {
  const Points some = every_nth(source.points, kScoringPoints);
  const auto coarse = target.target->cost(some, MatchStart::kFar);
  if (starts.size() == 1 || coarse == nullptr) return {starts.front()};
  std::vector<double> cost(starts.size());
  parallel_for(starts.size(), 1, [&](std::size_t i) { cost[i] = coarse->at(starts[i]).cost; });
  std::vector<std::size_t> order(starts.size());
  for (std::size_t i = 0; i < order.size(); ++i)
    order[i] = i;
  sort_stably(order, [&](std::size_t a, std::size_t b) { return cost[a] < cost[b]; });
  std::vector<Pose> best{starts.front()};
  for (const std::size_t i : order) {
    if (static_cast<int>(best.size()) >= std::max(config.refined_starts, 1)) break;
    const auto near = [&](const Pose& other) {
      const Pose difference = other.inverse() * starts[i];
      return (other.translation() - starts[i].translation()).norm() <
                 config.search_step_m * kNeighbourSteps &&
             difference.angle() < config.search_yaw_step_deg * kDegree * kNeighbourYawSteps;
    };
    if (std::none_of(best.begin(), best.end(), near)) best.push_back(starts[i]);
  }
  return best;
}

// Null if the first method has the last word.
std::unique_ptr<const Matcher> refining_matcher(const LoopClosureConfig& config) {
  if (config.refine == LoopClosureConfig::kNoRefinement) return nullptr;
  return make_matcher(config.matcher, config.refine);
}

struct Match {
  RegistrationResult result;
  double overlap = 0.0;
};

bool same_place(const Pose& a, const Pose& b) {
  return (a.translation() - b.translation()).norm() < kSamePlaceM &&
         (a.inverse() * b).angle() < kSamePlaceRad;
}

double chance_overlap(const Structure& target, const Points& source, const Pose& pose,
                      const LoopClosureConfig& config) {
  double sum = 0.0;
  for (int i = 0; i < kChanceShifts; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / kChanceShifts;
    const Pose shifted(
        pose.rotation(),
        pose.translation() +
            config.contrast_shift_m * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.0));
    sum += target.overlap(source, shifted, static_cast<std::size_t>(config.min_structure_points));
  }
  return sum / kChanceShifts;
}

// Matched from the best starts, judged by the structure found again; refined at the best.
std::optional<Match> match_sides(const Side& target, const Side& source,
                                 const Structure& target_structure,
                                 const Structure& source_structure, const std::vector<Pose>& starts,
                                 const LoopClosureConfig& config, LoopVerification& report) {
  std::vector<Match> matches;
  const auto least = static_cast<std::size_t>(config.min_structure_points);
  for (const Pose& start : best_starts(target, source, starts, config)) {
    Match match;
    match.result = target.target->match(source.points, start, {}, MatchStart::kFar);
    if (!match.result.usable()) continue;
    match.overlap =
        target_structure.overlap(source_structure.points(), match.result.target_from_source, least);
    matches.push_back(match);
  }
  if (matches.empty()) return std::nullopt;
  Match best = *std::max_element(matches.begin(), matches.end(), [](const auto& a, const auto& b) {
    return a.overlap < b.overlap;
  });
  for (const Match& other : matches) {
    if (!same_place(other.result.target_from_source, best.result.target_from_source))
      report.runner_up = std::max(report.runner_up, other.overlap);
  }
  const auto refine = refining_matcher(config);
  if (refine == nullptr) return best;
  best.result = refine->make_target(target.points)
                    ->match(source.points, best.result.target_from_source, {}, MatchStart::kNear);
  if (!best.result.usable()) return std::nullopt;
  best.overlap =
      target_structure.overlap(source_structure.points(), best.result.target_from_source, least);
  return best;
}

// The way back, from where the way there ended.
void measure_asymmetry(const Side& target, const Side& source, const Pose& target_from_source,
                       const LoopClosureConfig& config, LoopVerification& report) {
  RegistrationResult back =
      source.target->match(target.points, target_from_source.inverse(), {}, MatchStart::kNear);
  if (const auto refine = refining_matcher(config)) {
    const Pose start = back.usable() ? back.target_from_source : target_from_source.inverse();
    back = refine->make_target(source.points)->match(target.points, start, {}, MatchStart::kNear);
  }
  if (!back.usable()) {
    report.asymmetry_m = std::numeric_limits<double>::infinity();
    return;
  }
  const Pose circle = target_from_source * back.target_from_source;
  // At the middle of the source's points, where the lever of a small turn is not counted twice.
  const Eigen::Vector3d& middle = target_from_source.translation();
  report.asymmetry_m = (circle * middle - middle).norm();
  report.asymmetry_deg = circle.angle() / kDegree;
}

std::string judge(const LoopVerification& report, const RegistrationResult& result,
                  const LoopClosureConfig& config) {
  if (result.degenerate_directions.cols() > 0) return "the match is undetermined in a direction";
  if (report.fitness_m2 > config.max_fitness_m2)
    return "mean squared distance " + std::to_string(report.fitness_m2) + " m^2";
  if (report.overlap < config.min_overlap)
    return "only " + std::to_string(report.overlap) + " of the structure is found again";
  if (report.overlap - report.chance_overlap < config.min_contrast)
    return "structure overlaps hardly more than by chance";
  if (report.runner_up > config.max_runner_up * report.overlap)
    return "another place matches as well";
  if (report.asymmetry_m > config.max_asymmetry_m ||
      report.asymmetry_deg > config.max_asymmetry_deg)
    return "the match backwards differs by " + std::to_string(report.asymmetry_m) + " m";
  return "";
}

Matrix6d loop_covariance(const RegistrationResult& result, const LoopClosureConfig& config) {
  Matrix6d information = result.information;
  information.diagonal().array() += 1e-6;
  const Matrix6d inverse = SymmetricSolver<6>(information).inverse();
  Matrix6d covariance = 0.5 * (inverse + inverse.transpose());
  const double rotation = config.sigma_rotation_deg * kDegree;
  covariance.diagonal().head<3>().array() += rotation * rotation;
  const double translation =
      std::hypot(config.sigma_translation_m,
                 config.sigma_translation_per_m * result.target_from_source.translation().norm());
  covariance.diagonal().tail<3>().array() += translation * translation;
  return covariance;
}

}  // namespace

LoopVerification verify_loop(const LoopInput& input, const LoopClosureConfig& config) {
  LoopVerification report;
  report.target_from_source = input.target_from_source;
  const std::unique_ptr<const Matcher> matcher = make_matcher(config.matcher);
  const Side target = make_side(input.target_points, input.up_in_target, *matcher);
  const Side source = make_side(input.source_points, input.up_in_source, *matcher);
  const Structure target_structure(target.points, config.structure_low_m, config.structure_high_m,
                                   config.structure_cell_m);
  const Structure source_structure(source.points, config.structure_low_m, config.structure_high_m,
                                   config.structure_cell_m);
  const auto least = static_cast<std::size_t>(config.min_structure_points);
  if (target_structure.points().size() < least || source_structure.points().size() < least) {
    report.reason = "too little above the ground";
    return report;
  }
  const Pose guess =
      target.body_from_level.inverse() * input.target_from_source * source.body_from_level;
  const std::vector<Pose> starts = make_starts(guess, input, config);
  report.starts = static_cast<int>(starts.size());
  const std::optional<Match> match =
      match_sides(target, source, target_structure, source_structure, starts, config, report);
  if (!match) {
    report.reason = "no match";
    return report;
  }
  const Pose& levelled = match->result.target_from_source;
  report.target_from_source = target.body_from_level * levelled * source.body_from_level.inverse();
  // The perturbation of the body is that of the levelled frame, turned.
  const Matrix6d turn = source.body_from_level.adjoint();
  report.covariance = turn * loop_covariance(match->result, config) * turn.transpose();
  report.fitness_m2 = match->result.fitness_m2;
  report.overlap = match->overlap;
  report.chance_overlap =
      chance_overlap(target_structure, source_structure.points(), levelled, config);
  if (config.check_symmetry) measure_asymmetry(target, source, levelled, config, report);
  report.reason = judge(report, match->result, config);
  report.accepted = report.reason.empty();
  return report;
}

void describe(ConfigTable& table, LoopClosureConfig& config) {
  describe(table, config.matcher);
  std::vector<std::string> last = matcher_names();
  last.insert(last.begin(), LoopClosureConfig::kNoRefinement);
  table.add_choice(
      "refine", config.refine, last,
      "method that computes the final relative pose; none: the pose of the search is kept");
  table.add("search_sigmas", config.search_sigmas, {0.0, 10.0}, "",
            "half width of the search, in standard deviations of the predicted relative pose; 0: "
            "one start at the prediction");
  table.add("search_step_m", config.search_step_m, {0.1, 20.0}, "m",
            "distance between two starts of the search");
  table.add("search_yaw_step_deg", config.search_yaw_step_deg, {0.1, 90.0}, "deg",
            "heading between two starts of the search");
  table.add("max_starts", config.max_starts, {1, 100000}, "",
            "most starts of the search; beyond that number the steps grow");
  table.add("refined_starts", config.refined_starts, {1, 100}, "",
            "number of best starts that are matched coarse to fine");
  table.add("max_fitness_m2", config.max_fitness_m2, {0.0, 100.0}, "m^2",
            "largest mean squared distance of an accepted loop");
  table.add("structure_low_m", config.structure_low_m, {0.0, 50.0}, "m",
            "height above ground from which structure is compared");
  table.add("structure_high_m", config.structure_high_m, {0.0, 100.0}, "m",
            "height above ground up to which structure is compared");
  table.add("structure_cell_m", config.structure_cell_m, {0.05, 5.0}, "m",
            "largest distance at which structure counts as found again");
  table.add("min_structure_points", config.min_structure_points, {0, 1000000}, "",
            "with fewer points above the ground a loop is not judged");
  table.add("min_overlap", config.min_overlap, {0.0, 1.0}, "",
            "share of the structure that has to be found again");
  table.add("min_contrast", config.min_contrast, {-1.0, 1.0}, "",
            "least excess of that share over the share found by chance");
  table.add("contrast_shift_m", config.contrast_shift_m, {0.1, 20.0}, "m",
            "shift of the clouds with which the share by chance is measured");
  table.add("max_runner_up", config.max_runner_up, {0.0, 1.0}, "",
            "overlap at the second best place, as a share of the best, above which the loop is "
            "ambiguous");
  table.add("max_asymmetry_m", config.max_asymmetry_m, {0.0, 10.0}, "m",
            "largest shift between the match and the match backwards");
  table.add("max_asymmetry_deg", config.max_asymmetry_deg, {0.0, 90.0}, "deg",
            "largest turn between the match and the match backwards");
  table.add("check_symmetry", config.check_symmetry, "match also backwards, from target to source");
  table.add("sigma_rotation_deg", config.sigma_rotation_deg, {1e-4, 10.0}, "deg",
            "least standard deviation of the rotation of a loop");
  table.add("sigma_translation_m", config.sigma_translation_m, {1e-5, 10.0}, "m",
            "least standard deviation of the translation of a loop");
  table.add("sigma_translation_per_m", config.sigma_translation_per_m, {0.0, 1.0}, "",
            "growth of that standard deviation with the distance between the two places");
}

}  // namespace understory
