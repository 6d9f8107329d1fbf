#pragma once

#include <cstdint>
#include <vector>

#include "understory/geometry/feature_points.h"
#include "understory/registration/loam/ring_clusters.h"
#include "understory/registration/matcher.h"
#include "understory/util/config/config.h"

namespace understory {

// How edges and planes are found along the rings of a scan.
struct RingFeaturesConfig {
  int half_window = 5;             // theta of P4 (39): points to each side
  double edge_smoothness = 0.02;   // above, a point may be an edge
  double plane_smoothness = 0.01;  // below, a point lies on a plane
  int sectors = 6;                 // of a ring: so that features lie all around
  int edges_per_sector = 20;       // at most
  double jump_m = 0.3;  // a neighbour so much nearer to the lidar hides what a surface does there
  double ground_slope_deg = 12.0;  // loam_ground: steeper ones are no ground
  RingClustersConfig clusters;     // loam_ground: objects whose points count
};
void describe(ConfigTable& table, RingFeaturesConfig& config);

// Smoothness of each point of one ring, P4 (39): |sum over the 2 theta points around it of
// (p_i - p_j)| / (2 theta |p_i|). `ring`: points in the order of measurement, metres from the
// lidar. Infinite within theta points of the ends.
[[nodiscard]] std::vector<double> ring_smoothness(const Points& ring, int half_window);

// Edges and planes by smoothness (Zhang and Singh, LOAM, 2014, section V.A). Edges are the sharpest
// points in each sector of a ring. None lies within theta points of another, and none on a surface
// that something nearer hides. Planes are the smooth ones. With `ground` those of them that lie on
// ground are kGround (Shan and Englot, LeGO-LOAM, 2018, section III.B). There the slope from a ring
// to the next one at the same azimuth is small, below the lidar. Of the others, points of small
// clusters have no features then.
class RingFeatureFinder : public FeatureFinder {
 public:
  RingFeatureFinder(const RingFeaturesConfig& config, bool ground)
      : config_(config), ground_(ground) {}
  [[nodiscard]] std::vector<PointFeature> find(const RingPoints& scan) const override;

 private:
  RingFeaturesConfig config_;
  bool ground_;
};

}  // namespace understory
