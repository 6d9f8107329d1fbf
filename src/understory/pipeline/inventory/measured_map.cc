#include "understory/pipeline/inventory/measured_map.h"

#include <cstddef>
#include <utility>
#include <vector>

#include "understory/output/clouds/las_writer.h"

namespace understory {
namespace {

constexpr std::size_t kPointsPerVisit = 65'536;

ScannerPath path_of(const Trajectory& trajectory) {
  std::vector<TimedPoint> places;
  places.reserve(trajectory.size());
  for (const StampedPose& pose : trajectory)
    places.push_back({pose.world_from_body.translation(), las_time(pose.stamp)});
  return ScannerPath(std::move(places));
}

TimedBlocks timed_blocks_of(const PointCloudFile& cloud) {
  return [&cloud](const TimedVisitor& visit) {
    std::vector<TimedPoint> block;
    for (std::size_t i = 0; i < cloud.points.size(); ++i) {
      block.push_back({cloud.origin + cloud.points[i].cast<double>(), cloud.gps_time[i]});
      if (block.size() < kPointsPerVisit && i + 1 < cloud.points.size()) continue;
      visit(block);
      block.clear();
    }
  };
}

TimedBlocks timed_blocks_of(const CloudTiles& tiles) {
  return [&tiles](const TimedVisitor& visit) {
    std::vector<TimedPoint> block;
    tiles.all_records([&](std::span<const TilePoint> points) {
      block.clear();
      for (const TilePoint& point : points)
        block.push_back({tiles.world(point), point.gps_time});
      visit(block);
    });
  };
}

}  // namespace

MeasuredCloud measured_map(MapTiles& tiles, const Trajectory& path) {
  MeasuredCloud measured;
  measured.path = path_of(path);
  measured.points = [&tiles](const TimedVisitor& visit) {
    std::vector<TimedPoint> block;
    tiles.for_each_block([&](MapTiles::TileIndex, std::span<const MapPoint> points) {
      block.clear();
      for (const MapPoint& point : points)
        block.push_back({{point.x, point.y, point.z}, las_time(point.stamp)});
      visit(block);
    });
  };
  return measured;
}

MeasuredCloud measured_in_run(const std::filesystem::path& run, const StandCloud& map) {
  const std::filesystem::path trajectory = run / "trajectory.tum";
  if (!std::filesystem::exists(trajectory)) return {};
  MeasuredCloud measured;
  if (map.streamed) {
    if (!map.streamed->has_times) return {};
    measured.points = timed_blocks_of(*map.streamed->tiles);
  } else {
    if (map.cloud.gps_time.size() != map.cloud.points.size()) return {};
    measured.points = timed_blocks_of(map.cloud);
  }
  measured.path = path_of(read_trajectory(trajectory));
  return measured;
}

}  // namespace understory
