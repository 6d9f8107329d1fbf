#pragma once

#include <istream>
#include <string>
#include <vector>

#include "understory/sensor/gnss_fix.h"
#include "understory/util/log.h"

namespace understory {

// The positions of an RTKLIB solution file (.pos, from rnx2rtkp, rtkpost or rtknavi). They are
// degrees, degrees with minutes and seconds, or earth-centred metres. Times are dates or GPS weeks,
// in GPS time, UTC or JST. Blanks, commas, semicolons or tabs lie between fields. Stamps are UTC,
// heights ellipsoidal (heights of the geoid are told by a warning), covariances those of the
// columns sdn ... sdun. Damaged lines are left out with a warning ("recording.damaged_line").
// Throws InputError for a file of baselines or velocities alone.
[[nodiscard]] std::vector<GnssFix> read_rtklib_solution(std::istream& stream,
                                                        const std::string& source, Log& log);
// The same from a plain file. Throws ReadError where the system cannot read it.
[[nodiscard]] std::vector<GnssFix> read_rtklib_solution(const std::string& file, Log& log);

// Whether a plain file is one: by its header, or by its name ending in .pos.
[[nodiscard]] bool is_rtklib_solution(const std::string& file);

}  // namespace understory
