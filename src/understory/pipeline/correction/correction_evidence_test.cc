#include "understory/pipeline/correction/correction_evidence.h"

#include <gtest/gtest.h>

#include "understory/pipeline/judgement/evidence_gathering.h"
#include "understory/pipeline/judgement/run_judgement.h"

namespace understory {
namespace {

// By stems, too: what is 1.3 times too large was complete.
TEST(CorrectionEvidence, AScaleThatTheAccelerometerContradictsCounts) {
  CorrectionRun run;
  run.trees.resize(5);
  ImuTrust trust;
  trust.motion_correlation = 0.99;
  trust.motion_spread_m_s2 = 1.0;
  trust.motion_windows = 200;
  for (const double scale : {1.0, 1.3}) {
    trust.motion_scale = scale;
    gather_imu_trust(trust, run.evidence);
    const RunJudgement judgement = judge_run(correction_evidence(run), JudgementConfig());
    EXPECT_EQ(judgement.status, scale == 1.0 ? RunStatus::kComplete : RunStatus::kUntrusted);
  }
}

}  // namespace
}  // namespace understory
