#include "understory/pipeline/run_folder/run_truth.h"

#include <fmt/format.h>

#include "understory/evaluation/trajectory_errors.h"
#include "understory/simulation/simulator.h"

namespace understory {
namespace {

std::vector<std::pair<double, double>> errors_over_time(const Trajectory& estimate,
                                                        const Trajectory& truth,
                                                        const TrajectoryErrors& errors,
                                                        double tolerance_s) {
  std::vector<std::pair<double, double>> series;
  for (const PosePair& pair : associate(estimate, truth, tolerance_s)) {
    const StampedPose& pose = estimate[pair.first];
    const Eigen::Vector3d moved = errors.truth_from_estimate * pose.world_from_body.translation();
    const Eigen::Vector3d target = truth[pair.second].world_from_body.translation();
    series.emplace_back(to_seconds(pose.stamp - estimate.front().stamp), (moved - target).norm());
  }
  return series;
}

}  // namespace

std::optional<Trajectory> write_truth(const std::filesystem::path& run_folder,
                                      const Recording& source) {
  const auto* simulator = dynamic_cast<const Simulator*>(&source);
  if (simulator == nullptr) return std::nullopt;
  const std::filesystem::path folder = run_folder.string() + ".truth";
  simulator->write_truth(folder.string());
  return read_trajectory(folder / "trajectory.tum");
}

std::optional<ReportTruth> compare_with_truth(const Trajectory& estimate, const Trajectory& truth) {
  EvaluationOptions options;
  options.alignment = Alignment::kFirst;  // the two world frames differ by the first pose
  const auto errors = evaluate_trajectory(estimate, truth, options);
  if (!errors) return std::nullopt;
  ReportTruth report;
  report.alignment = "first pose";
  report.ape_rmse_m = errors->ape_rmse_m;
  report.ape_max_m = errors->ape_max_m;
  report.drift_end_m = errors->drift_end_m;
  report.drift_percent = errors->drift_percent;
  report.ape_over_time = errors_over_time(estimate, truth, *errors, options.tolerance_s);
  options.alignment = Alignment::kSe3;
  if (const auto aligned = evaluate_trajectory(estimate, truth, options)) {
    report.more.emplace_back("position error after the best alignment (SE(3))",
                             fmt::format("{:.3f} m", aligned->ape_rmse_m));
  }
  report.more.emplace_back("rotation error, root mean square",
                           fmt::format("{:.2f} deg", errors->ape_rotation_rmse_deg));
  return report;
}

}  // namespace understory
