#include "understory/pipeline/mapping/dense/memory_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "understory/map/map_constants.h"
#include "understory/pipeline/pipeline_constants.h"
#include "understory/util/error.h"
#include "understory/util/timing.h"

namespace understory {
namespace {

using namespace pipeline_constants::memory_plan;

// What a run takes whatever is cached.
double fixed_bytes(const SensorTraits& traits) {
  const auto points =
      static_cast<double>(traits.scan_points > 0 ? traits.scan_points : kPointsOfUnknown);
  return kProgramBytes + kBytesPerScanPoint * points;
}

double keyframe_bytes(const SensorTraits& traits) {
  const auto points =
      static_cast<double>(traits.scan_points > 0 ? traits.scan_points : kPointsOfUnknown);
  return kBytesPerKeyframePoint * points;
}

}  // namespace

double least_memory_mb(const DenseMappingConfig& config, const SensorTraits& traits) {
  double bytes =
      fixed_bytes(traits) + kFewestKeyframes * keyframe_bytes(traits) + kLeastLocalMapBytes;
  if (config.map_enabled && config.copc) bytes = std::max(bytes, kProgramBytes + kCopcBytes);
  return 10.0 * std::ceil(bytes / 1e7);
}

void expect_memory(const DenseMappingConfig& config, const SensorTraits& traits) {
  if (config.max_memory_mb == 0.0) return;
  const double least = least_memory_mb(config, traits);
  if (config.max_memory_mb >= least) return;
  const std::string of = traits.scan_points > 0
                             ? fmt::format("of {} points a scan", traits.scan_points)
                             : std::string("that no first scan shows");
  throw ConfigError(
      {fmt::format("run.max_memory_mb (--max-memory-mb): expected {:.0f} at least "
                   "for a lidar {}{}; given is {:.0f}",
                   least, of, config.copc ? " and map.copc.laz" : "", config.max_memory_mb)});
}

void keep_within_memory(DenseMappingConfig& config, const SensorTraits& traits) {
  if (config.max_memory_mb == 0.0) return;
  const double limit = 1e6 * config.max_memory_mb;
  const double left = std::max(limit - fixed_bytes(traits),
                               kLeastLocalMapBytes + kFewestKeyframes * keyframe_bytes(traits));
  KeyframeMap::Config& map = config.keyframe_map;
  const double for_keyframes = kShareOfKeyframes * left / keyframe_bytes(traits);
  map.cached_keyframes = static_cast<std::size_t>(
      std::clamp(for_keyframes, static_cast<double>(kFewestKeyframes),
                 static_cast<double>(map_constants::keyframe_map::kCachedKeyframes)));
  map.one_local_map = true;
  map.local_map.most_bytes =
      std::max(kLeastLocalMapBytes,
               left - static_cast<double>(map.cached_keyframes) * keyframe_bytes(traits));
  const double for_map = std::max(limit - kProgramBytes, kLeastLocalMapBytes);
  config.map.most_bytes = std::min(kMostTileBytes, kShareOfTiles * for_map);
  config.inventory_bytes = std::max(for_map - kFinishBytes, kLeastLocalMapBytes);
}

bool memory_is_short(double max_memory_mb) {
  return max_memory_mb > 0.0 && resident_memory_mb() > kShortShare * max_memory_mb;
}

void tell_memory(double max_memory_mb, Log& log) {
  const double peak = peak_memory_mb();
  if (max_memory_mb == 0.0 || peak <= max_memory_mb) return;
  log.warn("memory.exceeded",
           fmt::format("the run had {:.0f} MB resident, more than run.max_memory_mb={:.0f}", peak,
                       max_memory_mb));
}

}  // namespace understory
