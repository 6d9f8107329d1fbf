#include "understory/pipeline/correction/correction_tables.h"

#include <fmt/format.h>

#include "understory/graph/self_correction/spread_corrections.h"
#include "understory/output/run_tables.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

// Returns the poses as a reader of the file gets them.
Trajectory write_tum(const fs::path& path, const std::vector<StampedPose>& poses) {
  TumWriter writer(path);
  Trajectory written;
  for (const StampedPose& pose : poses)
    written.push_back(writer.add(pose));
  writer.commit();
  return written;
}

// The chained odometry and the corrected path: of every scan where they are known, else of the
// views.
Trajectory write_paths(const fs::path& folder, const CorrectionRun& run) {
  std::vector<StampedPose> corrected;
  std::vector<StampedPose> chained;
  for (std::size_t i = 0; i < run.views.size(); ++i) {
    corrected.push_back({run.views[i].stamp, run.correction.world_from_body[i]});
    chained.push_back({run.views[i].stamp, run.steps[i].world_from_body});
  }
  if (!run.path.empty()) {
    chained = run.path;
    corrected = spread_corrections(chained, corrected);
  }
  (void)write_tum(folder / "odometry.tum", chained);
  return write_tum(folder / "trajectory.tum", corrected);
}

// How each view was matched to those before it: P0's e and lambda, P1's outlier ratio. Of the first
// one and of those that found too few stems nothing but the status is known.
void write_steps(const fs::path& path, const CorrectionRun& run) {
  AtomicTextFile file(path);
  file.write("frame,timestamp,status,error_m,overlap,outlier_ratio,neighbours_m\n");
  for (std::size_t i = 0; i < run.steps.size(); ++i) {
    const SparseStep& step = run.steps[i];
    file.write(fmt::format("{},{},{},", run.views[i].frame, format_seconds(run.views[i].stamp),
                           to_string(step.status)));
    const bool matched =
        step.status != SparseStepStatus::kFirst && step.status != SparseStepStatus::kUnmatched;
    file.write(matched ? fmt::format("{:.4f},{:.3f},{:.3f},{:.3f}\n", step.error_m, step.overlap,
                                     1.0 - step.overlap, step.spacing_m)
                       : std::string(",,,\n"));
  }
  file.commit();
}

// A row per view for which an earlier place was found, by the views' frame numbers.
void write_loops(const fs::path& path, const CorrectionRun& run) {
  AtomicTextFile file(path);
  file.write("query,match,score,accepted,verified\n");
  for (std::size_t k = 0; k < run.correction.loops.size(); ++k) {
    const StemLoop& loop = run.correction.loops[k];
    file.write(fmt::format("{},{},{:.4f},{},{}\n",
                           run.views[static_cast<std::size_t>(loop.query)].frame,
                           run.views[static_cast<std::size_t>(loop.match)].frame, loop.score,
                           run.correction.accepted[k] != 0 ? 1 : 0, loop.verified ? 1 : 0));
  }
  file.commit();
}

// A row per pair of views that was matched again to correct the map.
void write_corrections(const fs::path& path, const CorrectionRun& run) {
  AtomicTextFile file(path);
  file.write(
      "earlier,later,overlap,expected_gain,error_before_m,error_after_m,overlap_after,moved_m,"
      "go_icp,accepted,kept,beta,reason\n");
  for (const TriedCorrection& tried : run.correction.self.tried) {
    file.write(fmt::format("{},{},{:.3f},{:.4f},{:.4f},{:.4f},{:.3f},{:.4f},{},{},{},{:.5f},{}\n",
                           run.views[static_cast<std::size_t>(tried.pair.j)].frame,
                           run.views[static_cast<std::size_t>(tried.pair.i)].frame,
                           tried.pair.overlap, tried.expected_gain, tried.error_before_m,
                           tried.error_after_m, tried.overlap_after, tried.moved_m,
                           tried.by_go_icp ? 1 : 0, tried.accepted ? 1 : 0, tried.kept ? 1 : 0,
                           tried.beta, tried.reason));
  }
  file.commit();
}

}  // namespace

Trajectory write_correction_tables(const fs::path& folder, const CorrectionRun& run) {
  Trajectory trajectory = write_paths(folder, run);
  write_steps(folder / "steps.csv", run);
  write_loops(folder / "loops.csv", run);
  write_corrections(folder / "corrections.csv", run);
  return trajectory;
}

}  // namespace understory
