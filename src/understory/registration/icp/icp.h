#pragma once

#include <memory>

#include "understory/registration/icp/surface.h"
#include "understory/registration/registration.h"
#include "understory/registration/robust_loss.h"
#include "understory/util/config/config.h"

namespace understory {

// Settings of ICP.
struct IcpConfig {
  // kSymmetric: across the mean of the normals of both surfaces (Rusinkiewicz 2019); kTrimmed: as
  // kPointToPoint with the nearest `loss.trim_share` of the pairs (Chetverikov et al. 2002).
  enum class Metric { kPointToPoint, kPointToPlane, kSymmetric, kTrimmed };

  Metric metric = Metric::kPointToPlane;
  double max_distance_m = 1.0;  // farther neighbours are no match
  double kernel_m = 0.1;        // scale of the kernel
  RobustLossConfig loss;
  int normal_neighbours = 16;
  double max_planarity = 0.1;       // smallest / middle eigenvalue; above it a point says nothing
  double sigma_m = 0.03;            // noise of a point, for the cost against the prior
  double independent_share = 0.05;  // share of the points that counts as independent
  int source_neighbours = 12;       // kSymmetric: from which a source point's surface is found
  int max_iterations = 50;
  double max_step_m = 0.5;
  double step_translation_m = 2e-4;
  double step_rotation_rad = 2e-5;
  double degenerate_ratio = 0.003;
  int min_matches = 50;
};
void describe(ConfigTable& table, IcpConfig& config);
// Whether targets have the surface around each point.
[[nodiscard]] bool has_planes(const IcpConfig& config);
// The settings with what the metric implies.
[[nodiscard]] IcpConfig settled(const IcpConfig& config);

// Target of ICP: points with a search tree and normals. Thin the points by a voxel filter first:
// the nearest few of a dense cloud span less than its noise. Immutable, shared between threads.
class IcpTarget {
 public:
  IcpTarget(const Points& points, const IcpConfig& config);
  ~IcpTarget();
  IcpTarget(const IcpTarget&) = delete;
  IcpTarget& operator=(const IcpTarget&) = delete;

  [[nodiscard]] std::size_t size() const;
  // The nearest point within the distance; false if none.
  struct Known {};  // nothing of a search helps the next
  [[nodiscard]] bool nearest(const Eigen::Vector3d& at, double max_distance_m, IcpPair& pair,
                             Known& known) const;

 private:
  struct Tree;
  std::unique_ptr<Tree> tree_;
};

// Iterative closest points with a robust kernel, for the last refinement of loop closures.
// Parallel; same bits for any number of threads. Thread-safe.
[[nodiscard]] RegistrationResult register_icp(const IcpTarget& target, const Points& source,
                                              const Pose& guess, const PoseTerms& terms,
                                              const IcpConfig& config);

}  // namespace understory
