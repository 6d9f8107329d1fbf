#include "understory/pipeline/mapping/dense/dense_trajectory.h"

#include <algorithm>
#include <utility>

#include "understory/output/run_tables.h"
#include "understory/pipeline/judgement/match_course.h"
#include "understory/pipeline/judgement/path_evidence.h"
#include "understory/pipeline/mapping/finished_trajectory.h"
#include "understory/util/median.h"

namespace understory {
namespace {

ReportScan report_scan(const FinishedScan& scan) {
  const ScanRecord& record = *scan.record;
  ReportScan row;
  row.stamp = record.stamp;
  row.position = scan.world_from_body.translation().cast<float>();
  row.wall_ms = record.wall_ms;
  if (record.iterations > 0) {
    row.inlier_ratio = record.inlier_ratio;
    row.fitness_m2 = record.fitness_m2;
  }
  row.weak = record.outcome != ScanOutcome::kMatched || record.degenerate_directions > 0;
  return row;
}

ScanBlock cost_of(const ScanRecord& record, TimeNs first) {
  return {to_seconds(record.stamp - first), 1, static_cast<double>(record.wall_ms),
          static_cast<double>(record.cpu_ms), static_cast<double>(record.map_size)};
}

double median_period_ms(const std::vector<ReportScan>& scans) {
  std::vector<TimeNs> steps;
  for (std::size_t i = 1; i < scans.size(); ++i) {
    steps.push_back(scans[i].stamp - scans[i - 1].stamp);
  }
  return 1e3 * to_seconds(upper_median(std::move(steps)));
}

}  // namespace

TrajectoryFacts write_dense_trajectory(const std::filesystem::path& folder,
                                       const DenseFrontEnd& front_end) {
  const DenseMappingConfig& config = front_end.config();
  TumWriter trajectory(folder / "trajectory.tum");
  StatesWriter states(folder / "states.csv.gz");
  TrajectoryFacts facts;
  double inliers = 0.0;
  double squares = 0.0;
  std::vector<float> inlier_ratios;
  PathEvidence path(config.motion_limits);
  MatchCourse course(make_matcher(config.keyframe_map.local_map.matcher)->reach_m());
  Pose last;
  std::uint64_t empty_in_a_row = 0;
  for_each_finished_scan(
      front_end.journal(), front_end.map().keyframes(), [&](const FinishedScan& scan) {
        const ScanRecord& record = *scan.record;
        facts.trajectory.push_back(trajectory.add({record.stamp, scan.world_from_body}));
        states.add({record.stamp, scan.velocity_in_world,
                    Eigen::Vector3d::Map(record.gyro_bias.data()),
                    Eigen::Vector3d::Map(record.accel_bias.data()), record.pose_covariance()});
        facts.scans.push_back(report_scan(scan));
        path.add({record.stamp, scan.world_from_body});
        course.add(record.stamp, record.outcome == ScanOutcome::kMatched,
                   static_cast<double>(record.inlier_ratio),
                   static_cast<double>(record.fitness_m2));
        facts.cpu_ms.push_back(record.cpu_ms);
        facts.wall_ms.push_back(record.wall_ms);
        facts.costs.push_back(cost_of(record, facts.trajectory.front().stamp));
        empty_in_a_row = record.matched_points < kFewPoints ? empty_in_a_row + 1 : 0;
        const Pose step = last.inverse() * scan.world_from_body;
        if (facts.scans.size() > 1) {
          facts.length_m += step.translation().norm();
          facts.match.smear_m += smear_of(step);
        }
        last = scan.world_from_body;
        if (record.iterations > 0) {
          inlier_ratios.push_back(record.inlier_ratio);
          inliers += static_cast<double>(record.inlier_ratio);
          squares += static_cast<double>(record.fitness_m2);
        }
        if (facts.scans.back().weak) ++facts.weak;
      });
  trajectory.commit();
  states.commit();
  if (!inlier_ratios.empty()) {
    const auto matched = static_cast<double>(inlier_ratios.size());
    facts.match.inliers_mean = inliers / matched;
    facts.match.fitness_rms_m = std::sqrt(squares / matched);
    const auto low = inlier_ratios.begin() + static_cast<std::ptrdiff_t>(inlier_ratios.size() / 10);
    std::nth_element(inlier_ratios.begin(), low, inlier_ratios.end());
    facts.match.inliers_low = static_cast<double>(*low);
  }
  facts.motion = path.evidence();
  course.put(facts.match);
  facts.match.cut = empty_in_a_row == 1 ? 1 : 0;
  if (facts.scans.size() > 1) facts.match.smear_m /= static_cast<double>(facts.scans.size() - 1);
  facts.period_ms = median_period_ms(facts.scans);
  facts.duration_s = to_seconds(facts.scans.back().stamp - facts.scans.front().stamp);
  return facts;
}

}  // namespace understory
