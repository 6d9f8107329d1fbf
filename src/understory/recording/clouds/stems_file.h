#pragma once

#include <filesystem>
#include <vector>

#include "understory/sensor/stem_view.h"
#include "understory/util/log.h"

namespace understory {

// Reads a sparse recording, stems.csv.gz (plain or gzip by its content): `frame,x,y,z` are needed;
// `timestamp` (seconds, or any increasing number; else the frame's number counts as seconds),
// `axis_x,axis_y,axis_z`, `length_m`, `dbh_m`, `score`, `radius_m`, `radius_sd_m` and the
// covariance `xx,xy,yy,zz` (m^2, body frame) are used where there; unknown columns are passed over
// with a note in the log. The rows of a frame stand together, frames and times ascend. Axes are
// brought to unit length.
//
// Throws InputError with the line where a cell is no number, a position is missing or absurd, an
// axis is no direction, a size is negative, a variance not positive, order is broken, the gzip
// stream is damaged, and if there is no row at all.
[[nodiscard]] std::vector<StemView> read_stem_views(const std::filesystem::path& path, Log& log);

}  // namespace understory
