#pragma once

#include <array>
#include <limits>
#include <string>
#include <string_view>
#include <variant>

namespace understory {

// One tree of a stand, world frame. NaN where unknown: never a guess that looks like a measurement.
struct Tree {
  static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

  int id = 0;
  double x = 0.0;  // centre line of the stem at the ground, metres
  double y = 0.0;
  double z = 0.0;                 // ground at the stem, metres
  double dbh_m = kUnknown;        // diameter 1.3 m above the ground
  double dbh_sd_m = kUnknown;     // its standard deviation
  double height_m = kUnknown;     // highest point above the ground
  double height_sd_m = kUnknown;  // its standard deviation
  // 1 where the top was hardly seen, so that the tree may be higher; 0 where it was seen.
  double height_is_lower_bound = kUnknown;
  double lean_deg = kUnknown;  // from the vertical
  int observations = 0;        // returns (or views, in a sparse map) that support the stem
  double x_sd_m = kUnknown;    // standard deviation of x
  double y_sd_m = kUnknown;
  double stem_volume_m3 = kUnknown;     // over bark, from the ground to the top
  double stem_volume_sd_m3 = kUnknown;  // its standard deviation
  double sweep_m = kUnknown;  // of the centre line from a straight one, between 0.5 and 5 m
  double fork_m = kUnknown;   // above the ground: where a second stem leaves
  // The number of the thickest of the stems that share a foot: its own where it stands alone.
  double foot_id = kUnknown;
  double snag = kUnknown;           // 1: it stands without a crown; 0: it has one
  double crown_base_m = kUnknown;   // above the ground: where the crown begins
  double crown_area_m2 = kUnknown;  // of its outline seen from above
  double crown_volume_m3 = kUnknown;
  // Seconds on the clock of the scans: from then on views that should have seen the tree did not.
  // Unknown while it stands.
  double missing_since_s = kUnknown;
  std::string species;  // empty where unknown
  // How far its diameter is to be trusted, in one word (forest/trees/tree_doubt.h); empty: unknown.
  std::string quality;
  bool felled = false;  // of a truth: cut down while it was scanned, so it may be listed or not
};

// One column of a tree list. trees.csv, trees.gpkg, the truth of simulations and every reader of
// them take their columns from kTreeColumns; docs/reference/outputs.md explains each to the user.
struct TreeColumn {
  const char* name;
  std::variant<int Tree::*, double Tree::*, std::string Tree::*> member;
  int decimals;  // of a real number in trees.csv
  bool place;    // x, y and z: in a GeoPackage they are the point
};
inline constexpr std::array kTreeColumns = {
    TreeColumn{"id", &Tree::id, 0, false},
    TreeColumn{"x", &Tree::x, 3, true},
    TreeColumn{"y", &Tree::y, 3, true},
    TreeColumn{"z", &Tree::z, 3, true},
    TreeColumn{"dbh_m", &Tree::dbh_m, 4, false},
    TreeColumn{"dbh_sd_m", &Tree::dbh_sd_m, 4, false},
    TreeColumn{"height_m", &Tree::height_m, 2, false},
    TreeColumn{"height_sd_m", &Tree::height_sd_m, 2, false},
    TreeColumn{"height_is_lower_bound", &Tree::height_is_lower_bound, 0, false},
    TreeColumn{"lean_deg", &Tree::lean_deg, 2, false},
    TreeColumn{"observations", &Tree::observations, 0, false},
    TreeColumn{"x_sd_m", &Tree::x_sd_m, 4, false},
    TreeColumn{"y_sd_m", &Tree::y_sd_m, 4, false},
    TreeColumn{"stem_volume_m3", &Tree::stem_volume_m3, 4, false},
    TreeColumn{"stem_volume_sd_m3", &Tree::stem_volume_sd_m3, 4, false},
    TreeColumn{"sweep_m", &Tree::sweep_m, 3, false},
    TreeColumn{"fork_m", &Tree::fork_m, 2, false},
    TreeColumn{"foot_id", &Tree::foot_id, 0, false},
    TreeColumn{"snag", &Tree::snag, 0, false},
    TreeColumn{"crown_base_m", &Tree::crown_base_m, 2, false},
    TreeColumn{"crown_area_m2", &Tree::crown_area_m2, 2, false},
    TreeColumn{"crown_volume_m3", &Tree::crown_volume_m3, 2, false},
    TreeColumn{"missing_since", &Tree::missing_since_s, 3, false},
    TreeColumn{"species", &Tree::species, 0, false},
    TreeColumn{"quality", &Tree::quality, 0, false},
};

// The names of the columns, and the cells of one tree, separated by commas, without the end of the
// line. A cell is empty where the value is not known. A truth has `more_decimals`.
[[nodiscard]] std::string tree_csv_header();
[[nodiscard]] std::string tree_csv_row(const Tree& tree, int more_decimals = 0);

}  // namespace understory
