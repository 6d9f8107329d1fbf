#include "understory/forest/dead_wood/dead_wood.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "understory/forest/dead_wood/log_search.h"
#include "understory/forest/dead_wood/stump_search.h"
#include "understory/forest/dead_wood_constants.h"

namespace understory {
namespace {

using namespace forest_constants::dead_wood;

std::vector<SlicePoint> points_around(const TileShelf<SlicePoint>& low, const DeadWoodTask& task,
                                      const GroundArea& area) {
  std::vector<SlicePoint> points;
  for (const std::size_t tile : tiles_touching(task.cloud, area.moved(task.origin.head<2>()))) {
    for (const SlicePoint& point : low.copy(tile)) {
      if (area.contains({static_cast<double>(point.x), static_cast<double>(point.y)}))
        points.push_back(point);
    }
  }
  return points;
}

std::vector<StemFit> stems_around(const std::vector<StemFit>& stems, const GroundArea& area) {
  std::vector<StemFit> near;
  std::copy_if(stems.begin(), stems.end(), std::back_inserter(near),
               [&](const StemFit& stem) { return area.contains(stem.centre); });
  return near;
}

// Of one tile.
std::vector<DeadWood> stumps_in(const DeadWoodTask& task, const TileShelf<SlicePoint>& low,
                                const GroundArea& area) {
  const GroundArea around = area.grown(stump_search_reach());
  std::vector<SlicePoint> points = points_around(low, task, around);
  std::vector<DeadWood> found;
  for (const StumpFit& stump : find_stumps(points, stems_around(task.stems, around),
                                           {area, task.origin.head<2>()}, task.progress)) {
    DeadWood piece;
    piece.kind = DeadWoodKind::kStump;
    piece.from.head<2>() = task.origin.head<2>() + stump.centre;
    piece.from.z() = task.ground.interpolate(piece.from.x(), piece.from.y());
    if (std::isnan(piece.from.z())) continue;
    piece.to.head<2>() = task.origin.head<2>() + stump.top;
    piece.to.z() = piece.from.z() + stump.height_m;
    piece.diameter_m = stump.diameter_m;
    piece.diameter_to_m = stump.diameter_to_m;
    piece.diameter_sd_m = stump.diameter_sd_m;
    piece.observations = stump.returns;
    found.push_back(piece);
  }
  return found;
}

std::vector<DeadWood> logs_in(const DeadWoodTask& task, const TileShelf<SlicePoint>& low,
                              const Raster& ground, const GroundArea& area) {
  const GroundArea around = area.grown(log_search_reach());
  std::vector<SlicePoint> points = points_around(low, task, around);
  std::vector<DeadWood> found;
  for (const LogFit& log :
       find_logs(points, ground, stems_around(task.stems, around), area, task.progress)) {
    DeadWood piece;
    piece.kind = DeadWoodKind::kLog;
    piece.from = task.origin + log.from;
    piece.to = task.origin + log.to;
    piece.diameter_m = log.diameter_m;
    piece.diameter_to_m = log.diameter_to_m;
    piece.diameter_sd_m = log.diameter_sd_m;
    piece.observations = log.returns;
    found.push_back(piece);
  }
  return found;
}

}  // namespace

void describe(ConfigTable& table, DeadWoodConfig& config) {
  table.add("min_diameter_m", config.min_diameter_m, {0.05, 1.0}, "m",
            "stumps and lying stems that are thinner at their thick end are not listed");
}

std::string_view dead_wood_name(DeadWoodKind kind) {
  return kind == DeadWoodKind::kStump ? "stump" : "log";
}

double DeadWood::volume_m3() const {
  const double a = diameter_m;
  const double b = diameter_to_m;
  return M_PI / 12.0 * length_m() * (a * a + a * b + b * b);
}

LowPoints::LowPoints() : thinner_(kCube) {}

bool LowPoints::holds(double height_m) {
  return height_m >= kLowest && height_m < kHighestLow;
}

void LowPoints::add(const Eigen::Vector2d& place, double height_m) {
  thinner_.add(place.x(), place.y(), height_m);
}

Eigen::Vector2d LowPoints::corner_of(const Eigen::Vector2d& place) const {
  return thinner_.corner_of(place.x(), place.y());
}

std::vector<SlicePoint> LowPoints::take() {
  return thinner_.take();
}

std::vector<DeadWood> find_dead_wood(const DeadWoodTask& task, const TileShelf<SlicePoint>& low) {
  Raster ground = task.ground;
  ground.x0 -= task.origin.x();
  ground.y0 -= task.origin.y();
  ground.z0 -= task.origin.z();
  std::vector<DeadWood> found;
  for (const bool logs : {false, true}) {
    std::vector<std::vector<DeadWood>> parts(task.cloud.tiles().size());
    for_tiles(task.cloud, [&](std::size_t tile) {
      const GroundArea area = task.cloud.tiles()[tile].moved(-task.origin.head<2>());
      parts[tile] = logs ? logs_in(task, low, ground, area) : stumps_in(task, low, area);
    });
    const auto first = static_cast<std::ptrdiff_t>(found.size());
    for (const std::vector<DeadWood>& part : parts)
      found.insert(found.end(), part.begin(), part.end());
    std::sort(found.begin() + first, found.end(), [](const DeadWood& a, const DeadWood& b) {
      const double xa = a.from.x() + a.to.x();
      const double xb = b.from.x() + b.to.x();
      return xa != xb ? xa < xb : a.from.y() + a.to.y() < b.from.y() + b.to.y();
    });
  }
  std::erase_if(found, [&](const DeadWood& piece) {
    return std::max(piece.diameter_m, piece.diameter_to_m) < task.config.min_diameter_m;
  });
  return found;
}

}  // namespace understory
