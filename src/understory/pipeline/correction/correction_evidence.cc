#include "understory/pipeline/correction/correction_evidence.h"

#include <algorithm>
#include <vector>

namespace understory {
namespace {

// Steps that nothing vouches for: those without a match, and those with a weak one that no loop and
// no correction bridges.
std::size_t doubtful_steps(const CorrectionRun& run) {
  std::vector<int> bridges(run.steps.size() + 1, 0);  // begin and end of each, to be summed up
  const auto bridge = [&](int from, int to) {
    ++bridges[static_cast<std::size_t>(std::min(from, to)) + 1];
    --bridges[static_cast<std::size_t>(std::max(from, to)) + 1];
  };
  for (std::size_t k = 0; k < run.correction.loops.size(); ++k) {
    if (run.correction.accepted[k] != 0)
      bridge(run.correction.loops[k].match, run.correction.loops[k].query);
  }
  for (const TriedCorrection& tried : run.correction.self.tried) {
    if (tried.kept) bridge(tried.pair.j, tried.pair.i);
  }
  std::size_t doubtful = 0;
  int bridged = 0;
  for (std::size_t k = 0; k < run.steps.size(); ++k) {
    bridged += bridges[k];
    const SparseStepStatus status = run.steps[k].status;
    doubtful += status == SparseStepStatus::kUnmatched ||
                        (status == SparseStepStatus::kWeak && bridged == 0)
                    ? 1
                    : 0;
  }
  return doubtful;
}

}  // namespace

RunEvidence correction_evidence(const CorrectionRun& run) {
  RunEvidence evidence = run.evidence;
  evidence.by_stems = true;
  evidence.stems.views = run.steps.size();
  evidence.stems.doubtful = doubtful_steps(run);
  evidence.stems.trees = run.trees.size();
  evidence.stems.loops_solved = run.correction.converged;
  evidence.stems.loops_reason = run.correction.reason;
  return evidence;
}

}  // namespace understory
