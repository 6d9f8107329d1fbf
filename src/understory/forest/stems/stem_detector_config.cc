#include "understory/forest/stems/stem_detector.h"

namespace understory {

void describe(ConfigTable& table, StemDetectorConfig& config) {
  table.add("lowest_m", config.lowest_m, {0.1, 5.0}, "m",
            "lowest height above the ground at which stems are searched");
  table.add("highest_m", config.highest_m, {1.5, 20.0}, "m",
            "highest height above the ground at which stems are searched");
  table.add("slice_m", config.slice_m, {0.05, 1.0}, "m", "thickness of a slice");
  table.add("thin_m", config.thin_m, {0.0, 0.1}, "m",
            "one point is kept in each cube of this size");
  table.add(
      "min_dbh_m", config.min_dbh_m, {0.0, 1.0}, "m",
      "smallest diameter that is searched, 0.02 at least; 0: 0.02 in a full inventory, 0.05 in "
      "a basic one and in a slice");
  table.add("max_dbh_m", config.max_dbh_m, {0.1, 5.0}, "m", "largest diameter that is searched");
  table.add("min_returns", config.min_returns, {5, 100'000}, "",
            "fewest returns on the surface of a stem");
  table.add("min_arc_deg", config.min_arc_deg, {20.0, 360.0}, "deg",
            "smallest part of the circumference that must be seen");
  table.add("min_slices", config.min_slices, {2, 50}, "",
            "fewest slices in which the surface must be seen");
  table.add("max_lean_deg", config.max_lean_deg, {0.0, 60.0}, "deg",
            "largest lean of a stem from the vertical");
}

}  // namespace understory
