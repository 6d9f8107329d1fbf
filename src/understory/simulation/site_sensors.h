#pragma once

#include "understory/simulation/site.h"
#include "understory/util/config/config.h"

namespace understory {

// Sections of a site's table, one for each sensor. Keys, units and ranges are those of the Config
// structs in site.h.
void describe_lidar(ConfigTable& table, LidarConfig& config);
void describe_second_lidar(ConfigTable& table, SecondLidarConfig& config);
void describe_imu(ConfigTable& table, ImuConfig& config);
void describe_gnss(ConfigTable& table, GnssConfig& config);
void describe_mag(ConfigTable& table, MagnetometerConfig& config);
void describe_total_station(ConfigTable& table, TotalStationConfig& config);

}  // namespace understory
