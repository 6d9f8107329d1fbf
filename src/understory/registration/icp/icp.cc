#include "understory/registration/icp/icp.h"

#include <array>

#include "understory/geometry/kd_tree.h"
#include "understory/registration/describe_steps.h"
#include "understory/registration/icp/icp_match.h"
#include "understory/registration/registration_constants.h"
#include "understory/util/parallel.h"

namespace understory {

void describe(ConfigTable& table, IcpConfig& config) {
  table.add_enum("metric", config.metric,
                 {{"point_to_point", IcpConfig::Metric::kPointToPoint},
                  {"point_to_plane", IcpConfig::Metric::kPointToPlane},
                  {"symmetric", IcpConfig::Metric::kSymmetric},
                  {"trimmed", IcpConfig::Metric::kTrimmed}},
                 "distance that is minimised");
  table.add("max_distance_m", config.max_distance_m, {0.05, 20.0}, "m",
            "farther neighbours are no match");
  table.add("kernel_m", config.kernel_m, {0.005, 10.0}, "m",
            "scale of the kernel: matches much farther apart hardly count");
  describe(table, config.loss);
  table.add("normal_neighbours", config.normal_neighbours, {4, 100}, "",
            "points from which a normal is estimated");
  table.add("max_planarity", config.max_planarity, {0.0, 1.0}, "",
            "smallest through middle variance of a neighbourhood that still has a normal");
  table.add("sigma_m", config.sigma_m, {0.001, 1.0}, "m", "noise of a point");
  table.add("source_neighbours", config.source_neighbours, {4, 100}, "",
            "metric symmetric: points from which the surface of a source point is found");
  internal::describe_steps(table, config);
}

bool has_planes(const IcpConfig& config) {
  return config.metric == IcpConfig::Metric::kPointToPlane ||
         config.metric == IcpConfig::Metric::kSymmetric;
}

IcpConfig settled(const IcpConfig& config) {
  IcpConfig steps = config;
  if (config.metric == IcpConfig::Metric::kTrimmed) steps.loss.kind = LossKind::kTrimmed;
  return steps;
}

namespace {

using namespace registration_constants::icp;

}  // namespace

struct IcpTarget::Tree {
  Points points;
  std::vector<SurfacePatch> patches;
  KdTreePoints adaptor;
  std::unique_ptr<KdTree> kd;

  void find_surface(std::size_t i, const IcpConfig& config) {
    std::array<std::uint32_t, kMaxNeighbours> index;
    std::array<float, kMaxNeighbours> squared;
    const std::size_t n =
        kd->knnSearch(points[i].data(), static_cast<std::size_t>(config.normal_neighbours),
                      index.data(), squared.data());
    SurfaceSums sums;
    for (std::size_t k = 0; k < n; ++k)
      sums.add(points[index[k]] - points[i]);
    patches[i] = surface_of(sums, config.max_planarity);
  }
};

IcpTarget::IcpTarget(const Points& points, const IcpConfig& config)
    : tree_(std::make_unique<Tree>()) {
  const bool planes = has_planes(config);
  tree_->points = points;
  tree_->adaptor.points = &tree_->points;
  tree_->patches.assign(points.size(), {planes ? SurfaceKind::kNothing : SurfaceKind::kPoint,
                                        Eigen::Vector3f::Zero()});
  if (points.empty()) return;
  tree_->kd =
      std::make_unique<KdTree>(3, tree_->adaptor, nanoflann::KDTreeSingleIndexAdaptorParams(10));
  if (planes)
    parallel_for(points.size(), 256, [&](std::size_t i) { tree_->find_surface(i, config); });
}

IcpTarget::~IcpTarget() = default;

std::size_t IcpTarget::size() const {
  return tree_->points.size();
}

bool IcpTarget::nearest(const Eigen::Vector3d& at, double max_distance_m, IcpPair& pair,
                        Known& /*known*/) const {
  const Eigen::Vector3f query = at.cast<float>();
  std::uint32_t index = 0;
  const bool found = tree_->kd->knnSearch(query.data(), 1, &index, &pair.squared_m2) == 1;
  if (!found || pair.squared_m2 > static_cast<float>(max_distance_m * max_distance_m)) return false;
  pair.offset = at - tree_->points[index].cast<double>();
  pair.patch = tree_->patches[index];
  return true;
}

RegistrationResult register_icp(const IcpTarget& target, const Points& source, const Pose& guess,
                                const PoseTerms& terms, const IcpConfig& config) {
  return internal::icp_match(target, source, guess, terms, settled(config));
}

}  // namespace understory
