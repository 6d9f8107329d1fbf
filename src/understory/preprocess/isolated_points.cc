#include "understory/preprocess/isolated_points.h"

#include <array>
#include <limits>

#include "understory/preprocess/preprocess_constants.h"

namespace understory {
namespace {

using namespace preprocess_constants::isolated_points;

// A point of a ring that waits for those after it. Where there is none yet, it lies nowhere:
// neither near another nor near the lidar.
struct Seen {
  float x = std::numeric_limits<float>::infinity();
  float y = std::numeric_limits<float>::infinity();
  float z = std::numeric_limits<float>::infinity();
  float range2 = std::numeric_limits<float>::infinity();  // squared
  std::uint32_t index = 0;
  bool alone = true;
};

}  // namespace

void describe(ConfigTable& table, IsolatedPointsConfig& config) {
  table.add("within_m", config.within_m, {0.0, 100.0}, "m",
            "returns nearer than this that stand alone on their ring are dropped (flakes, rain); "
            "0: none");
  table.add(
      "gap_m", config.gap_m, {0.01, 10.0}, "m",
      "a return farther than this from the two before and the two after it on its ring stands "
      "alone");
}

std::size_t drop_isolated(const Scan& scan, const IsolatedPointsConfig& config,
                          std::vector<std::uint8_t>& keep) {
  if (config.within_m <= 0.0 || scan.ring_count < 2) return 0;
  const auto reach = static_cast<float>(config.within_m * config.within_m);
  const auto gap = static_cast<float>(config.gap_m * config.gap_m);
  // The last two points of each ring: of two beams, or of the one before with two returns.
  std::vector<std::array<Seen, 2>> rings;
  std::vector<std::uint32_t> alone_near;
  std::size_t near = 0;
  const auto judge = [&](const Seen& point) {
    const bool is_near = point.range2 < reach;
    near += is_near ? 1 : 0;
    if (is_near && point.alone) alone_near.push_back(point.index);
  };
  for (std::uint32_t i = 0; i < scan.points.size(); ++i) {
    const ScanPoint& p = scan.points[i];
    if (p.ring >= rings.size()) rings.resize(std::size_t{p.ring} + 1);
    std::array<Seen, 2>& before = rings[p.ring];
    Seen self{p.x, p.y, p.z, p.x * p.x + p.y * p.y + p.z * p.z, i, true};
    for (Seen& other : before) {
      const float dx = p.x - other.x;
      const float dy = p.y - other.y;
      const float dz = p.z - other.z;
      const bool apart = !(dx * dx + dy * dy + dz * dz <= gap);
      other.alone = other.alone && apart;
      self.alone = self.alone && apart;
    }
    judge(before[0]);
    before[0] = before[1];
    before[1] = self;
  }
  for (const auto& last : rings) {
    judge(last[0]);
    judge(last[1]);
  }
  if (static_cast<double>(alone_near.size()) > kMostAlone * static_cast<double>(near)) return 0;
  if (alone_near.empty()) return 0;
  if (keep.empty()) keep.assign(scan.points.size(), 1);
  for (const std::uint32_t index : alone_near)
    keep[index] = 0;
  return alone_near.size();
}

}  // namespace understory
