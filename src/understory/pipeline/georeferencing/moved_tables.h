#pragma once

#include <filesystem>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/sensor/tree.h"

namespace understory {

// Brings stem_curves.csv, dead_wood.csv and plots.csv of one run folder into another. Places are
// moved between the world frames; all other columns stay. The axes of the result are east, north,
// up. plot_classes.csv holds no places and is copied. `trees` are those of the run
// before it is moved: they tell the height of rows that have none. A table that is not there is
// left out. Throws InputError or OutputError.
void write_moved_tables(const std::filesystem::path& from, const std::filesystem::path& to,
                        const std::vector<Tree>& trees, const Pose& target_from_world);

}  // namespace understory
