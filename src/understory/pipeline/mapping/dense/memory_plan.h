#pragma once

#include "understory/pipeline/mapping/dense/dense_mapping_config.h"
#include "understory/pipeline/mapping/sensor_traits.h"
#include "understory/util/log.h"

namespace understory {

// The least `run.max_memory_mb` for a lidar, MB of 10^6 bytes. It grows with the returns of a scan;
// of an unknown lidar it is that of a large one.
[[nodiscard]] double least_memory_mb(const DenseMappingConfig& config, const SensorTraits& traits);
// Throws ConfigError, with the least that works, where a run with this limit cannot be.
void expect_memory(const DenseMappingConfig& config, const SensorTraits& traits);

// Shares the limit among what a run holds: keyframes in memory, the local map, the tiles of the
// finished map and their inventory. Without a limit nothing changes. Pure.
void keep_within_memory(DenseMappingConfig& config, const SensorTraits& traits);

// Whether so much is resident that what can be read again should leave the memory; false without a
// limit (0).
[[nodiscard]] bool memory_is_short(double max_memory_mb);

// Warns where the process has had more resident than the limit (0: none).
void tell_memory(double max_memory_mb, Log& log);

}  // namespace understory
