#pragma once

#include <filesystem>
#include <vector>

#include "understory/sensor/stem_view.h"
#include "understory/util/log.h"

namespace understory {

// Reads a sparse recording, stems.csv.gz (plain or gzip by its content). The columns `frame,x,y,z`
// are needed. Others are used where there: `timestamp` (seconds, or any increasing number; else the
// frame's number counts as seconds), `axis_x,axis_y,axis_z`, `length_m`, `dbh_m`, `score`,
// `radius_m`, `radius_sd_m`. So is the covariance `xx,xy,yy,zz` (m^2, body frame). Unknown columns
// are passed over with a note in the log. The rows of a frame stand together, frames and times
// ascend. Axes are brought to unit length.
//
// Throws InputError with the line where a cell is no number, a position is missing or absurd, or an
// axis is no direction. So it does where a size or a variance is negative, or order is broken. The
// same holds for a damaged gzip stream and a file without rows.
[[nodiscard]] std::vector<StemView> read_stem_views(const std::filesystem::path& path, Log& log);

}  // namespace understory
