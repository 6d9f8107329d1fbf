#include "understory/registration/vgicp/vgicp_matcher.h"

#include "understory/registration/gaussian/voxel_matcher.h"
#include "understory/registration/icp/icp_map.h"
#include "understory/registration/icp/surface.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

GicpConfig shape_of(const VgicpMatcherConfig& config) {
  GicpConfig shape;
  shape.sigma_m = config.steps.sigma_m;
  shape.along_sigma_m = config.along_sigma_m;
  return shape;
}

std::vector<Eigen::Matrix3f> flat_covariances(const VgicpMatcherConfig& config,
                                              const Points& points) {
  const GicpConfig shape = shape_of(config);
  const std::vector<SurfacePatch> surfaces =
      surfaces_of(points, config.neighbours, config.max_planarity);
  std::vector<Eigen::Matrix3f> covariances(points.size());
  parallel_for(points.size(), 1024, [&](std::size_t i) {
    covariances[i] = surface_covariance(surfaces[i], shape).cast<float>();
  });
  return covariances;
}

}  // namespace

// For internal::VoxelMatcher.
static const std::vector<double>& edges_of(const VgicpMatcherConfig& config) {
  return config.voxel_sizes_m;
}
static GaussianVoxelsConfig grid_of(const VgicpMatcherConfig&, double edge_m) {
  return {edge_m, 1, true};
}
// Thinned by the cubes of ICP's map, whose surfaces span more than the noise of a point. Among the
// nearest few points of a dense cloud normals are at random.
static GaussianSource target_cloud(const VgicpMatcherConfig& config, const Points& points) {
  IcpMapConfig map;
  map.max_planarity = config.max_planarity;
  IcpMapBuilder builder(map);
  builder.insert(points, Pose());
  const GicpConfig shape = shape_of(config);
  GaussianSource cloud;
  builder.snapshot()->for_each([&](const Eigen::Vector3d& at, const SurfacePatch& patch) {
    cloud.means.emplace_back(at.cast<float>());
    cloud.covariances.emplace_back(surface_covariance(patch, shape).cast<float>());
  });
  return cloud;
}

GaussianSource VgicpTarget::source_of(const Points& points) const {
  return {points, flat_covariances(config_, points), {}};
}

void describe(ConfigTable& table, VgicpMatcherConfig& config) {
  table.add("voxel_sizes_m", config.voxel_sizes_m, "m", "voxels of the target, coarse to fine");
  table.add("faces", config.faces,
            "the nearest mean of the voxel and the six beside it; false: of the voxel alone");
  table.add("along_sigma_m", config.along_sigma_m, {0.001, 100.0}, "m",
            "how far along its surface a point may lie from what it matches");
  table.add("neighbours", config.neighbours, {4, 100}, "",
            "points from which the surface of a point is found");
  table.add("max_planarity", config.max_planarity, {0.0, 1.0}, "",
            "smallest through middle variance of a neighbourhood that still has a normal");
  describe(table, config.steps);
}

std::unique_ptr<const Matcher> make_matcher(const VgicpMatcherConfig& config) {
  return std::make_unique<internal::VoxelMatcher<VgicpMatcherConfig, VgicpTarget>>(config,
                                                                                   "voxel_sizes_m");
}

std::vector<SuitedSetting> suited_settings(const VgicpMatcherConfig&, const ScanTraits&) {
  return {};
}

}  // namespace understory
