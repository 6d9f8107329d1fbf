#include "understory/registration/icp/surface.h"

#include <array>
#include <cmath>

#include "understory/geometry/kd_tree.h"
#include "understory/geometry/symmetric_eigen.h"
#include "understory/registration/registration_constants.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

using namespace registration_constants::surface;

Eigen::Matrix3f plain_covariance(const SurfaceSums& sums) {
  const auto count = static_cast<float>(sums.count);
  return sums.products / count - sums.sum * sums.sum.transpose() / (count * count);
}

// Calls act(i, sums of the nearest `neighbours` points of point i, from it).
template <typename Act>
void for_each_neighbourhood(const Points& points, int neighbours, const Act& act) {
  if (points.empty()) return;
  const KdTreePoints adaptor{&points};
  const KdTree tree(3, adaptor, nanoflann::KDTreeSingleIndexAdaptorParams(10));
  parallel_for(points.size(), 256, [&](std::size_t i) {
    std::array<std::uint32_t, kMaxNeighbours> index;
    std::array<float, kMaxNeighbours> squared;
    const std::size_t n = tree.knnSearch(points[i].data(), static_cast<std::size_t>(neighbours),
                                         index.data(), squared.data());
    SurfaceSums sums;
    for (std::size_t k = 0; k < n; ++k)
      sums.add(points[index[k]] - points[i]);
    act(i, sums);
  });
}

}  // namespace

SurfacePatch surface_of(const SurfaceSums& sums, double max_planarity) {
  if (sums.count < kFewestPoints) return {};
  const Eigen::Matrix3f covariance = plain_covariance(sums);
  const SymmetricEigen3 eigen = fast_symmetric_eigen(covariance.cast<double>());
  const Eigen::Vector3d& variance = eigen.values;
  // A line that is not steep is what a ring of the lidar left on the ground: it says nothing.
  if (variance[1] < kLineRatio * variance[2]) {
    const Eigen::Vector3d axis = eigen.vectors.col(2);
    if (std::abs(axis.z()) < kPoleCosine) return {};
    return {SurfaceKind::kPole, axis.cast<float>()};
  }
  if (variance[0] < max_planarity * variance[1])
    return {SurfaceKind::kPlane, eigen.vectors.col(0).cast<float>()};
  return {};
}

std::optional<Eigen::Matrix3f> covariance_of(const SurfaceSums& sums) {
  if (sums.count < kFewestPoints) return std::nullopt;
  const Eigen::Matrix3f covariance = plain_covariance(sums);
  const SymmetricEigen3 eigen = fast_symmetric_eigen(covariance.cast<double>());
  const bool line = eigen.values[1] < kLineRatio * eigen.values[2];
  if (line && std::abs(eigen.vectors(2, 2)) < kPoleCosine) return std::nullopt;
  return covariance;
}

std::vector<SurfacePatch> surfaces_of(const Points& points, int neighbours, double max_planarity) {
  std::vector<SurfacePatch> surfaces(points.size());
  for_each_neighbourhood(points, neighbours, [&](std::size_t i, const SurfaceSums& sums) {
    surfaces[i] = surface_of(sums, max_planarity);
  });
  return surfaces;
}

std::vector<Eigen::Matrix3f> covariances_of(const Points& points, int neighbours) {
  std::vector<Eigen::Matrix3f> covariances(points.size());
  for_each_neighbourhood(points, neighbours, [&](std::size_t i, const SurfaceSums& sums) {
    covariances[i] = plain_covariance(sums);
  });
  return covariances;
}

}  // namespace understory
