#pragma once

#include "understory/graph/self_correction/stem_correction.h"
#include "understory/map/stem_map.h"
#include "understory/pipeline/correction/head_cut_log.h"
#include "understory/pipeline/judgement/path_evidence.h"
#include "understory/pipeline/judgement/run_judgement.h"
#include "understory/util/config/config.h"

namespace understory {

// What a correction can be told, by `understory correct` or at the end of `map` by stems.
struct CorrectionConfig {
  StemCorrectionConfig stems;
  StemMapConfig tree_list = tree_list_config();
  HeadCutLogConfig harvester;
  JudgementConfig judgement;
  MotionLimits motion_limits;
};
void describe(ConfigTable& table, CorrectionConfig& config);

}  // namespace understory
