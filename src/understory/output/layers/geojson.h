#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

namespace understory {

// Writes a layer of a GeoPackage as GeoJSON (RFC 7946): longitude and latitude of WGS 84, seven
// decimals, without heights. Those of a layer do not count from the ellipsoid in every system. Of
// points they stand in the member `z` as they are. How many features. Throws InputError where there
// is no such layer or it has no place on the globe, OutputError where it cannot be written. The
// file appears whole or not at all.
std::size_t write_geojson(const std::filesystem::path& package, const std::string& layer,
                          const std::filesystem::path& path);

}  // namespace understory
