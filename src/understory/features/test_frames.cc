#include "understory/features/test_frames.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

namespace understory {
namespace {

constexpr double kBand = 5.0;
constexpr double kMatch = 0.4;

StemBand& band_of(std::vector<StemBand>& bands, double range) {
  const auto at = static_cast<std::size_t>(range / kBand);
  return bands[std::min(at, bands.size() - 1)];
}

// The tree whose centre line passes nearest to a place, and how near.
std::pair<const GrownTree*, double> nearest_tree(const Stand& stand, const Eigen::Vector3d& at) {
  const GrownTree* best = nullptr;
  double least = kMatch;
  for (const GrownTree& tree : stand.trees) {
    if ((tree.foot - at).head<2>().squaredNorm() > 9.0) continue;
    const double off = (tree.centre(at.z() - tree.foot.z()) - at).head<2>().norm();
    if (off >= least) continue;
    least = off;
    best = &tree;
  }
  return {best, least};
}

void write_traits(std::FILE* file, bool right, double range, const StemSegment& stem) {
  std::fprintf(file, "%d,%.2f,%d,%.3f", right ? 1 : 0, range, stem.levels, stem.radius_m);
  for (const double trait : stem.traits)
    std::fprintf(file, ",%.4f", trait);
  std::fprintf(file, "\n");
}

void add_right(StemBand& band, const StemSegment& stem, const GrownTree& tree,
               const Eigen::Vector3d& at, const Eigen::Vector3d& foot,
               const Eigen::Vector3d& sight) {
  ++band.right;
  const double height = at.z() - tree.foot.z();
  const Eigen::Vector2d off = (at - tree.centre(height)).head<2>();
  band.squares += off.squaredNorm();
  band.along += off.dot(sight.head<2>().normalized());
  const double radius = stem.radius_m - 0.5 * tree.diameter(height);
  band.radius += radius;
  band.radius_squares += radius * radius;
  if (!stem.foot_on_ground) return;
  ++band.feet;
  band.foot_squares += (foot - tree.foot).head<2>().squaredNorm();
  band.foot_height += foot.z() - tree.foot.z();
  band.foot_height_squares += std::pow(foot.z() - tree.foot.z(), 2);
}

}  // namespace

Pose TestFrames::world_from_lidar(const Scan& scan, double after_s) const {
  return plan.path.pose(to_seconds(scan.stamp) + after_s) * scanner.body_from_lidar();
}

StemBand& StemBand::operator+=(const StemBand& other) {
  seen += other.seen;
  seen_found += other.seen_found;
  clear += other.clear;
  clear_found += other.clear_found;
  segments += other.segments;
  right += other.right;
  squares += other.squares;
  along += other.along;
  feet += other.feet;
  foot_squares += other.foot_squares;
  foot_height_squares += other.foot_height_squares;
  foot_height += other.foot_height;
  radius_squares += other.radius_squares;
  radius += other.radius;
  return *this;
}

double StemBand::centre_rmse_m() const {
  return right > 0 ? std::sqrt(squares / right) : 0.0;
}

void compare_stems(const TestFrames& site, const SimulatedScan& frame, const StemSegments& found,
                   std::vector<StemBand>& bands, std::FILE* traits) {
  std::set<int> hit;
  for (const StemSegment& stem : found.stems) {
    const Pose now = site.world_from_lidar(*frame.scan, 1e-9 * stem.t_ns);
    const Eigen::Vector3d at =
        now * (stem.foot + 0.5 * (stem.lowest_m + stem.highest_m) * stem.axis);
    const Eigen::Vector3d sight = at - now.translation();
    const double range = sight.head<2>().norm();
    const auto [tree, off] = nearest_tree(site.stand, at);
    StemBand& band = band_of(bands, range);
    ++band.segments;
    if (traits != nullptr) write_traits(traits, tree != nullptr && off < 0.2, range, stem);
    if (tree == nullptr) continue;
    hit.insert(tree->id);
    add_right(band, stem, *tree, at, now * stem.foot, sight);
  }
  std::map<int, const GrownTree*> trees;
  for (const GrownTree& tree : site.stand.trees)
    trees[tree.id] = &tree;
  const Eigen::Vector3d lidar = site.world_from_lidar(*frame.scan, 0.0).translation();
  for (const StemReturns& returns : frame.stems) {
    if (returns.rings < 2) continue;
    const GrownTree& tree = *trees.at(returns.tree);
    StemBand& band = band_of(bands, (tree.foot - lidar).head<2>().norm());
    const int was_found = hit.count(tree.id) > 0 ? 1 : 0;
    ++band.seen;
    band.seen_found += was_found;
    if (returns.rings_with_3 < 2) continue;
    ++band.clear;
    band.clear_found += was_found;
  }
}

}  // namespace understory
