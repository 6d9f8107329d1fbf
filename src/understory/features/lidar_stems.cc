#include "understory/features/lidar_stems.h"

#include <algorithm>
#include <cstddef>

#include "understory/features/features_constants.h"
#include "understory/features/scan_rings.h"
#include "understory/sensor/lidar_parts.h"

namespace understory {
namespace {

// Whether the rings of one scan belong to several lidars.
bool holds_several(const Rig& rig) {
  return !rig.further_lidars.empty() && rig.further_lidars.front().first_ring > 0;
}

double place_variance(const Stem& stem) {
  return static_cast<double>(stem.xx + stem.yy);
}

}  // namespace

std::vector<LidarStems> find_stems_of_lidars(const Scan& scan, const Rig& rig,
                                             const StemSegmentConfig& config,
                                             const std::vector<std::uint8_t>& use) {
  if (!holds_several(rig)) return {{rig.body_from_lidar, find_stem_segments(scan, config, use)}};
  std::vector<LidarStems> lidars;
  for (const LidarPart& part : lidar_parts(scan, rig)) {
    StemSegmentConfig own = config;
    own.up =
        part.body_from_lidar.rotation().conjugate() * (rig.body_from_lidar.rotation() * config.up);
    std::vector<std::uint8_t> own_use;
    if (!use.empty()) {
      for (const std::size_t i : part.from)
        own_use.push_back(use[i]);
    }
    lidars.push_back({part.body_from_lidar, find_stem_segments(part.scan, own, own_use)});
  }
  return lidars;
}

Eigen::Vector3d up_by_stems(const std::vector<LidarStems>& lidars, const Eigen::Vector3d& given) {
  const auto most =
      std::max_element(lidars.begin(), lidars.end(), [](const LidarStems& a, const LidarStems& b) {
        return a.found.stems.size() < b.found.stems.size();
      });
  if (most == lidars.end() || most->found.stems.empty()) return given;
  if (most == lidars.begin()) return most->found.up;
  return lidars.front().body_from_lidar.rotation().conjugate() *
         (most->body_from_lidar.rotation() * most->found.up);
}

bool all_have_level_rings(const Scan& scan, const Rig& rig) {
  if (!holds_several(rig)) return has_level_rings(scan);
  const std::vector<LidarPart> parts = lidar_parts(scan, rig);
  return std::all_of(parts.begin(), parts.end(),
                     [](const LidarPart& part) { return has_level_rings(part.scan); });
}

void drop_double_stems(const std::vector<std::size_t>& from, std::vector<Stem>& stems) {
  if (from.size() < 2) return;
  const auto lidar_of = [&](std::size_t stem) {
    return std::upper_bound(from.begin(), from.end(), stem) - from.begin();
  };
  std::vector<char> doubled(stems.size(), 0);
  for (std::size_t a = 0; a < stems.size(); ++a) {
    for (std::size_t b = a + 1; b < stems.size(); ++b) {
      if (lidar_of(a) == lidar_of(b) || doubled[a] != 0 || doubled[b] != 0) continue;
      const double apart = static_cast<double>((stems[a].point - stems[b].point).head<2>().norm());
      if (apart > features_constants::lidar_stems::kSameStem) continue;
      doubled[place_variance(stems[a]) <= place_variance(stems[b]) ? b : a] = 1;
    }
  }
  std::size_t kept = 0;
  for (std::size_t i = 0; i < stems.size(); ++i) {
    if (doubled[i] == 0) stems[kept++] = stems[i];
  }
  stems.resize(kept);
}

}  // namespace understory
