#pragma once

#include <optional>
#include <string>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/pipeline/mapping/dense/dense_mapping_config.h"
#include "understory/pipeline/mapping/sensor_traits.h"
#include "understory/pipeline/mapping/sparse/sparse_mapping_config.h"
#include "understory/util/config/config_origins.h"
#include "understory/util/files/binary_io.h"

namespace understory {

// Place and clock of an IMU as a run has refined them.
struct RefinedImu {
  Pose body_from_imu;
  double late_s = 0.0;  // its stamps, as the recording has them, less those of the lidar
};

// What else than its sensors decides how a recording is mapped.
struct RunConditions {
  bool realtime = false;      // at the speed of the sensors
  bool imu_doubted = false;   // left out until it is clear whether it is right
  bool imu_cleared = false;   // it was doubted, and it was right: it counts as proven
  std::string imu_refused;    // why it is left out for good; empty: it is not
  double imu_judged_s = 0.0;  // when the last of these was found, seconds since the first scan
  std::optional<RefinedImu> imu_refined = std::nullopt;  // what it is mapped with instead of what
                                                         // is given
  int imu_refinements = 0;                               // how often it was begun anew for that
};
void put_origins(BinaryWriter& writer, const ConfigOrigins& origins);
[[nodiscard]] ConfigOrigins get_origins(BinaryReader& reader);
void put_conditions(BinaryWriter& writer, const RunConditions& conditions);
[[nodiscard]] RunConditions get_conditions(BinaryReader& reader);

// The configuration that runs, and what was changed for it.
template <typename Config>
struct Adapted {
  Config config;
  std::vector<ConfigAdaptation> changes;
};

// From the configuration asked for to the one that runs. A key that was set (`origins`) is never
// changed, with one exception: an IMU that was found to be wrong is left out. Pure.
[[nodiscard]] Adapted<DenseMappingConfig> adapt(const DenseMappingConfig& asked,
                                                const ConfigOrigins& origins,
                                                const SensorTraits& traits,
                                                const RunConditions& conditions);
[[nodiscard]] Adapted<SparseMappingConfig> adapt(const SparseMappingConfig& asked,
                                                 const ConfigOrigins& origins,
                                                 const RunConditions& conditions);

// Every key with its meaning, what set it (`origins`), and what was changed, from what and why.
[[nodiscard]] std::string commented_yaml(const Adapted<DenseMappingConfig>& adapted,
                                         const ConfigOrigins& origins);
[[nodiscard]] std::string commented_yaml(const Adapted<SparseMappingConfig>& adapted,
                                         const ConfigOrigins& origins);

}  // namespace understory
