// How surely a map of trees is found again in a map of trees from the air, by the trees alone: the
// figures of docs/method/georeference.md. One thread. Prints one JSON object.
//   tree_match FIRST_SEED STANDS TREES KIND [decoys] [sizes]
// KIND: wild, clumped, dense or rows. Each stand is a made-up forest with 100,000 trees in the map
// from the air. That has 65 % of the dominant trees, 10 % of the list false, and 0.7 m of noise
// along each axis. The map to find holds TREES dominant trees; its rough position is up to 200 m
// off. With `decoys` it is of another forest. With `sizes` both maps have heights.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <numbers>
#include <set>
#include <string>
#include <vector>

#include "understory/georeference/trees/forest_test_support.h"
#include "understory/georeference/trees/tree_match.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

constexpr double kTreesFromAir = 100'000.0;
constexpr double kRoughM = 200.0;

struct Tally {
  int stands = 0;
  int trusted = 0;
  int within_fine = 0;    // trusted, 0.3 m and 0.5 degrees
  int within_coarse = 0;  // trusted, 1 m and 1.5 degrees
  int wrong = 0;          // trusted, but farther off than 3 m or 5 degrees
  int right_untrusted = 0;
  double cpu_s = 0.0;
  double most_cpu_s = 0.0;
  double least_chance = 1.0;
  double squared_errors = 0.0;  // normalised by the stated covariance, three degrees of freedom
  std::vector<double> errors_m;
  std::vector<double> errors_deg;
};

ForestPlan plan_of(const std::string& kind) {
  ForestPlan plan;
  if (kind == "clumped") plan.clumping = 1.0;
  if (kind == "dense") plan.per_ha = 800.0;
  if (kind == "rows") {
    plan.row_m = 4.0;
    plan.spacing_m = 3.0;
    plan.per_ha = 600.0;
  }
  const AirView view;
  const double listed = view.complete / (1.0 - view.false_share);
  plan.side_m = std::sqrt(kTreesFromAir / listed / plan.per_ha * 1e4);
  return plan;
}

void judge(const GroundView& view, const TreeMatch& match, bool decoy, Tally& tally) {
  const Eigen::Vector2d at = (match.target_from_source *
                              Eigen::Vector3d(view.centre_in_map.x(), view.centre_in_map.y(), 0.0))
                                 .head<2>();
  const Eigen::Vector2d error = at - view.centre_in_forest;
  const Eigen::Matrix3d rotation = match.target_from_source.rotation_matrix();
  const double turn = std::remainder(std::atan2(rotation(1, 0), rotation(0, 0)) - view.yaw_rad,
                                     2.0 * std::numbers::pi);
  const double turn_deg = std::abs(turn) * 180.0 / std::numbers::pi;
  const bool right = !decoy && error.norm() < 3.0 && turn_deg < 5.0;
  ++tally.stands;
  if (match.trusted) ++tally.trusted;
  if (match.trusted && !right) ++tally.wrong;
  if (!match.trusted && right) ++tally.right_untrusted;
  if (!right) tally.least_chance = std::min(tally.least_chance, match.chance);
  if (!match.trusted || !right) return;
  if (error.norm() < 0.3 && turn_deg < 0.5) ++tally.within_fine;
  if (error.norm() < 1.0 && turn_deg < 1.5) ++tally.within_coarse;
  tally.errors_m.push_back(error.norm());
  tally.errors_deg.push_back(turn_deg);
  // The error at the centre of the match, where the covariance holds.
  const Eigen::Vector3d there(match.centre_in_source.x(), match.centre_in_source.y(), 0.0);
  const Eigen::Vector2d true_there =
      view.centre_in_forest +
      Eigen::Rotation2Dd(view.yaw_rad) * (match.centre_in_source - view.centre_in_map);
  const Eigen::Vector2d off = (match.target_from_source * there).head<2>() - true_there;
  const Eigen::Vector3d all(turn, off.x(), off.y());
  tally.squared_errors += all.dot(match.covariance.inverse() * all) / 3.0;
}

void run(std::uint64_t seed, const std::string& kind, std::size_t trees, bool decoy, bool sizes,
         Tally& tally) {
  const ForestPlan plan = plan_of(kind);
  Random random(seed);
  const std::vector<Tree> forest = make_forest(plan, random);
  std::vector<Tree> from_air = seen_from_air(forest, plan, {}, random);
  GroundView view = seen_from_below(forest, plan, trees, random);
  if (decoy) {
    Random other(seed, 1);
    ForestPlan small = plan;
    small.side_m = 300.0;
    view = seen_from_below(make_forest(small, other), small, trees, other);
    const double room = 0.5 * plan.side_m - 100.0;
    view.centre_in_forest = {random.uniform(-room, room), random.uniform(-room, room)};
  }
  if (!sizes) forget_sizes(view.trees);
  const double away = kRoughM * std::sqrt(random.uniform());
  const double direction = random.uniform(0.0, 2.0 * std::numbers::pi);
  const TreeSearchArea area{
      view.centre_in_map,
      view.centre_in_forest + away * Eigen::Vector2d(std::cos(direction), std::sin(direction)),
      kRoughM};
  const std::clock_t start = std::clock();
  const TreeMatch match = match_tree_maps(view.trees, from_air, area, {});
  const double cpu_s = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
  tally.cpu_s += cpu_s;
  tally.most_cpu_s = std::max(tally.most_cpu_s, cpu_s);
  judge(view, match, decoy, tally);
  if (std::getenv("TREE_MATCH_VERBOSE") != nullptr)
    fmt::print(stderr,
               "{} trusted {} chance {:.2g} score {:.1f} rival {:.1f} log poses {:.1f} noise "
               "{:.2f} sd {:.3f} {}\n",
               seed, match.trusted, match.chance, match.score, match.rival_score,
               std::log(match.poses_tried), match.noise_m, std::sqrt(match.covariance(1, 1)),
               match.reason);
}

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return std::nan("");
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

}  // namespace
}  // namespace understory

int main(int count, char** arguments) {
  using namespace understory;
  const std::vector<std::string> given(arguments + 1, arguments + count);
  if (given.size() < 4) {
    std::fputs("tree_match FIRST_SEED STANDS TREES wild|clumped|dense|rows [decoys] [sizes]\n",
               stderr);
    return 2;
  }
  const std::set<std::string> options(given.begin() + 4, given.end());
  Tally tally;
  const std::uint64_t first = std::stoull(given[0]);
  const std::uint64_t stands = std::stoull(given[1]);
  with_threads(1, [&] {
    for (std::uint64_t seed = first; seed < first + stands; ++seed)
      run(seed, given[3], std::stoull(given[2]), options.contains("decoys"),
          options.contains("sizes"), tally);
  });
  fmt::print(
      "{{\"stands\": {}, \"trusted\": {}, \"wrong\": {}, \"right_but_untrusted\": {}, "
      "\"within_0.3m_0.5deg\": {}, \"within_1m_1.5deg\": {}, \"median_m\": {:.3f}, "
      "\"p95_m\": {:.3f}, \"median_deg\": {:.3f}, \"p95_deg\": {:.3f}, "
      "\"normalised_squared_error\": {:.2f}, \"least_chance_of_wrong\": {:.2g}, "
      "\"mean_cpu_s\": {:.3f}, \"most_cpu_s\": {:.3f}}}\n",
      tally.stands, tally.trusted, tally.wrong, tally.right_untrusted, tally.within_fine,
      tally.within_coarse, quantile(tally.errors_m, 0.5), quantile(tally.errors_m, 0.95),
      quantile(tally.errors_deg, 0.5), quantile(tally.errors_deg, 0.95),
      tally.squared_errors / std::max<double>(1.0, static_cast<double>(tally.errors_m.size())),
      tally.least_chance, tally.cpu_s / std::max(1, tally.stands), tally.most_cpu_s);
  return 0;
}
