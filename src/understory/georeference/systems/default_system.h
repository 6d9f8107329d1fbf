#pragma once

#include <string>

#include "understory/georeference/systems/geodetic.h"

namespace understory {

// Whether a place is in Finland, by a coarse outline. It is some kilometres off at the border with
// Norway and Russia, half a kilometre between Tornio and Haparanda. It holds the sea of the
// archipelagos.
[[nodiscard]] bool is_in_finland(const GeodeticPlace& place);

// How heights of layers are counted.
enum class HeightWish {
  kEllipsoid,  // as receivers of satellites measure
  kGeoid       // as maps count them, where PROJ has the grid
};

// The coordinate system that a map gets where the user names none: ETRS-TM35FIN (EPSG:3067) in
// Finland, the UTM zone of WGS 84 elsewhere. With heights above the geoid a vertical part follows:
// N2000 in Finland, else EGM2008 or EGM96, the first whose grid PROJ has. None where it has none.
[[nodiscard]] std::string default_system(const GeodeticPlace& place, HeightWish heights);

// The same vertical part for a system that the user names and that has none.
[[nodiscard]] std::string with_heights(const std::string& definition, const GeodeticPlace& place,
                                       HeightWish heights);

}  // namespace understory
