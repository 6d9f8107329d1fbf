#include "understory/forest/stand/stand_config.h"

#include <string>
#include <utility>
#include <vector>

namespace understory {

void describe(ConfigTable& table, StandTableConfig& config) {
  table.add("plots", config.plots,
            "sample plots: X,Y,R, a .csv with id,x,y,radius_m, or a GeoPackage with polygons (or "
            "points with a column radius_m)");
  table.add("grid_m", config.grid_m, {0.0, 1'000.0}, "m",
            "side of grid cells that get figures of their own; 0: none");
  table.add_enum("radius", config.radius,
                 {{"horizontal", PlotRadius::kHorizontal}, {"slope", PlotRadius::kSlope}},
                 "along what the radius of a circular plot was measured: the map, or the ground");
  table.add("min_dbh_m", config.min_dbh_m, {0.01, 1.0}, "m",
            "trees with a smaller diameter do not count");
  table.add("class_m", config.class_m, {0.005, 0.5}, "m", "width of a class of diameters");
  table.add("reach_m", config.reach_m, {1.0, 100.0}, "m",
            "farther from the path nothing counts as seen; of a cloud alone the path is not known");
  table.add("least_seen", config.least_seen, {0.01, 1.0}, "",
            "share of a plot that has to be seen, or it has no figures");
  table.add("missed_share", config.missed_share, {0.0, 0.9}, "",
            "share of the trees that are missed where stems could be seen: it widens standard "
            "deviations and corrects nothing");
  std::vector<std::pair<std::string, TaperSpecies>> names;
  for (const TaperSpecies species :
       {TaperSpecies::kUnknown, TaperSpecies::kPine, TaperSpecies::kSpruce, TaperSpecies::kBirch})
    names.emplace_back(taper_species_name(species), species);
  table.add_enum("species", config.species, names,
                 "species of all trees: volumes by the national function of Finland as well");
}

}  // namespace understory
