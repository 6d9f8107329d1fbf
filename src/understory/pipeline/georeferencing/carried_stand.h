#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "understory/forest/stand/stand_table.h"
#include "understory/output/run_summary.h"
#include "understory/util/log.h"

namespace understory {

// What a run tells of its stand, and what to distrust in it, as far as a motion changes nothing.
struct CarriedStand {
  double area_m2 = 0.0;             // squares with points; 0: unknown
  std::optional<StandTable> table;  // without classes; nothing where no area was seen
  std::map<std::string, Figure> counts;
  std::map<std::string, Figure> quality;
  std::vector<std::string> notes;
  std::vector<Log::Warning> warnings;  // but those of its place on the globe
};

// Of run.json, and of plots.csv where there is one. Throws InputError where that is damaged.
[[nodiscard]] CarriedStand read_carried_stand(const std::filesystem::path& run);

}  // namespace understory
