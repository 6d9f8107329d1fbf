#pragma once

#include <vector>

#include "understory/sensor/stem_view.h"
#include "understory/util/config/config.h"

namespace understory {

// Which sights of stems make the map. Matching takes all of them: even false ones are where they
// were a view before. A map is judged, and trees are counted, by sure and near ones.
struct StemSightConfig {
  // Share of the range within which nine of ten stems lie: P1's mapping range of 20 m in views that
  // reach 40 m.
  double range_share = 0.55;
  // Share of the score that one of ten stems exceeds: scores are comparable within a recording,
  // not between detectors. Sights without a score pass.
  double score_share = 0.7;
};
void describe(ConfigTable& table, StemSightConfig& config);

// The views with the sights that pass. A limit is taken from all views together. Deterministic.
[[nodiscard]] std::vector<StemView> map_sights(const std::vector<StemView>& views,
                                               const StemSightConfig& config);

}  // namespace understory
