#pragma once

#include "understory/forest/form/taper_form.h"

namespace understory {

// Volume of a stem over bark from the stump's height to the top, m3, by the volume functions of
// Finland (J. Laasasenaho, Taper curve and volume functions for pine, spruce and birch,
// Communicationes Instituti Forestalis Fenniae 108, 1982, equation 61.3). `dbh_m` over 0,
// `height_m` over 1.3; NaN for other values and for an unknown species.
[[nodiscard]] double national_volume_m3(TaperSpecies species, double dbh_m, double height_m);

// Standard deviation of a single tree about that function, as a share of the volume; NaN for an
// unknown species.
[[nodiscard]] double national_volume_sd_share(TaperSpecies species);

}  // namespace understory
