#include "understory/pipeline/correction/correction_config.h"

namespace understory {

void describe(ConfigTable& table, CorrectionConfig& config) {
  describe(table, config.stems);
  table.section("tree_list", [&] { describe(table, config.tree_list); });
  table.section("harvester", [&] { describe(table, config.harvester); });
  table.section("judgement", [&] {
    describe(table, config.judgement);
    table.section("motion", [&] { describe(table, config.motion_limits); });
  });
}

}  // namespace understory
