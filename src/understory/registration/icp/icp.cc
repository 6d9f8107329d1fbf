#include "understory/registration/icp/icp.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>

#include "understory/geometry/kd_tree.h"
#include "understory/registration/judged_match.h"
#include "understory/util/parallel.h"

namespace understory {

void describe(ConfigTable& table, IcpConfig& config) {
  table.add_enum("metric", config.metric,
                 {{"point_to_point", IcpConfig::Metric::kPointToPoint},
                  {"point_to_plane", IcpConfig::Metric::kPointToPlane}},
                 "distance that is made small");
  table.add("max_distance_m", config.max_distance_m, {0.05, 20.0}, "m",
            "farther neighbours are no match");
  table.add("kernel_m", config.kernel_m, {0.005, 10.0}, "m",
            "scale of the Geman-McClure kernel: matches much farther apart hardly count");
  table.add("normal_neighbours", config.normal_neighbours, {4, 100}, "",
            "points from which a normal is estimated");
  table.add("max_planarity", config.max_planarity, {0.0, 1.0}, "",
            "smallest through middle variance of a neighbourhood that still has a normal");
  table.add("sigma_m", config.sigma_m, {0.001, 1.0}, "m", "noise of a point");
  table.add("independent_share", config.independent_share, {1e-4, 1.0}, "",
            "share of matched points that counts as independent");
  table.add("max_iterations", config.max_iterations, {1, 1000}, "", "most steps of one match");
  table.add("max_step_m", config.max_step_m, {0.01, 10.0}, "m", "longest step");
  table.add("step_translation_m", config.step_translation_m, {1e-7, 0.1}, "m",
            "converged when a step is shorter");
  table.add("step_rotation_rad", config.step_rotation_rad, {1e-8, 0.1}, "rad",
            "converged when a step turns less");
  table.add("degenerate_ratio", config.degenerate_ratio, {0.0, 0.5}, "",
            "a direction with less of the strongest direction's information is undetermined");
  table.add("min_matches", config.min_matches, {6, 100000}, "",
            "fewer matched points are no match");
}

namespace {

constexpr std::size_t kMostNeighbours = 100;
constexpr double kLineRatio = 0.05;  // middle through largest variance
constexpr double kPoleCosine = 0.7;  // 45 degrees

// What the neighbourhood of a target point constrains.
enum class Surface : std::uint8_t {
  kPoint,    // all three directions (point to point)
  kPlane,    // along the normal
  kPole,     // across the axis
  kNothing,  // the trace of a ring, or foliage
};

}  // namespace

struct IcpTarget::Tree {
  Points points;
  Points directions;  // normal or axis
  std::vector<Surface> surfaces;
  KdTreePoints adaptor;
  std::unique_ptr<KdTree> kd;

  // Index and squared distance of the nearest point within the radius; false if none.
  bool nearest(const Eigen::Vector3f& at, float squared_radius, std::uint32_t& index,
               float& squared) const {
    return kd->knnSearch(at.data(), 1, &index, &squared) == 1 && squared <= squared_radius;
  }

  void find_surface(std::size_t i, const IcpConfig& config) {
    std::array<std::uint32_t, kMostNeighbours> index;
    std::array<float, kMostNeighbours> squared;
    const std::size_t n =
        kd->knnSearch(points[i].data(), static_cast<std::size_t>(config.normal_neighbours),
                      index.data(), squared.data());
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    Eigen::Matrix3f products = Eigen::Matrix3f::Zero();
    for (std::size_t k = 0; k < n; ++k) {
      const Eigen::Vector3f d = points[index[k]] - points[i];
      sum += d;
      products += d * d.transpose();
    }
    const auto count = static_cast<float>(n);
    const Eigen::Matrix3f covariance = products / count - sum * sum.transpose() / (count * count);
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
    solver.computeDirect(covariance.cast<double>());
    const Eigen::Vector3d& variance = solver.eigenvalues();
    const Eigen::Vector3d axis = solver.eigenvectors().col(2);
    if (n < 4) return;
    // A line that is not steep is what a ring of the lidar left on the ground: it says nothing.
    if (variance[1] < kLineRatio * variance[2]) {
      if (std::abs(axis.z()) < kPoleCosine) return;
      surfaces[i] = Surface::kPole;
      directions[i] = axis.cast<float>();
    } else if (variance[0] < config.max_planarity * variance[1]) {
      surfaces[i] = Surface::kPlane;
      directions[i] = solver.eigenvectors().col(0).cast<float>();
    }
  }
};

IcpTarget::IcpTarget(const Points& points, const IcpConfig& config)
    : tree_(std::make_unique<Tree>()) {
  const bool planes = config.metric == IcpConfig::Metric::kPointToPlane;
  tree_->points = points;
  tree_->adaptor.points = &tree_->points;
  tree_->directions.assign(points.size(), Eigen::Vector3f::Zero());
  tree_->surfaces.assign(points.size(), planes ? Surface::kNothing : Surface::kPoint);
  if (points.empty()) return;
  tree_->kd =
      std::make_unique<KdTree>(3, tree_->adaptor, nanoflann::KDTreeSingleIndexAdaptorParams(10));
  if (planes)
    parallel_for(points.size(), 256, [&](std::size_t i) { tree_->find_surface(i, config); });
}

IcpTarget::~IcpTarget() = default;

namespace {

class Accumulator {
 public:
  Accumulator(const IcpTarget::Tree& target, const Points& source, const Pose& pose,
              const IcpConfig& config)
      : target_(target),
        source_(source),
        pose_(pose),
        rotation_(pose.rotation_matrix()),
        squared_radius_(static_cast<float>(config.max_distance_m * config.max_distance_m)),
        precision_(1.0 / (config.sigma_m * config.sigma_m)),
        kernel_(config.kernel_m * config.kernel_m) {}

  void operator()(MatchSums& sums, std::size_t i) const {
    const Eigen::Vector3d point = source_[i].cast<double>();
    const Eigen::Vector3d placed = pose_ * point;
    std::uint32_t index = 0;
    float squared = 0.0F;
    if (!target_.nearest(placed.cast<float>(), squared_radius_, index, squared)) {
      sums.cost += 0.5 * kernel_ * precision_;  // as much as the worst match: leaving is no gain
      return;
    }
    ++sums.matched;
    sums.nearest_squared += static_cast<double>(squared);
    const Eigen::Vector3d offset = placed - target_.points[index].cast<double>();
    const Eigen::Vector3d direction = target_.directions[index].cast<double>();
    Eigen::Matrix<double, 3, 6> jacobian;
    jacobian << -rotation_ * skew(point), rotation_;
    switch (target_.surfaces[index]) {
      case Surface::kPlane:
        add<1>(direction.transpose() * jacobian, Eigen::Matrix<double, 1, 1>(direction.dot(offset)),
               sums);
        break;
      case Surface::kPole: {
        const Eigen::Matrix3d across =
            Eigen::Matrix3d::Identity() - direction * direction.transpose();
        add<3>(across * jacobian, across * offset, sums);
        break;
      }
      case Surface::kPoint:
        add<3>(jacobian, offset, sums);
        break;
      case Surface::kNothing:
        break;
    }
  }

 private:
  template <int Rows>
  void add(const Eigen::Matrix<double, Rows, 6>& jacobian,
           const Eigen::Matrix<double, Rows, 1>& residual, MatchSums& sums) const {
    const double squared = residual.squaredNorm();
    const double share = kernel_ / (kernel_ + squared);  // Geman-McClure
    const double weight = share * share;
    sums.cost += 0.5 * share * squared * precision_;
    sums.hessian += (weight * precision_) * jacobian.transpose() * jacobian;
    sums.gradient += (weight * precision_) * jacobian.transpose() * residual;
    sums.weight += weight;
    sums.weighted_residual += weight * squared * precision_;
    sums.weighted_rows += weight * Rows;
    sums.surface_squared += weight * squared;
  }

  const IcpTarget::Tree& target_;
  const Points& source_;
  const Pose& pose_;
  Eigen::Matrix3d rotation_;
  float squared_radius_;
  double precision_;
  double kernel_;
};

}  // namespace

RegistrationResult register_icp(const IcpTarget& target, const Points& source, const Pose& guess,
                                const PoseTerms& terms, const IcpConfig& config) {
  const IcpTarget::Tree& tree = target.tree();
  const auto least = static_cast<std::size_t>(config.min_matches);
  if (tree.points.size() < least || source.size() < least) {
    return internal::refused(RegistrationStatus::kTooFewPoints,
                             "only " + std::to_string(source.size()) + " source and " +
                                 std::to_string(tree.points.size()) + " target points",
                             guess);
  }
  MatchSums at;
  const auto evaluate = [&](const Pose& pose) {
    const Accumulator accumulator(tree, source, pose, config);
    at = ordered_sum(source.size(), 64, MatchSums{}, accumulator);
    const double share = config.independent_share;
    PoseCost sum{share * at.cost, share * at.gradient, share * at.hessian};
    internal::add_terms(terms, pose, sum);
    return sum;
  };
  const double range = internal::mean_range(source);
  const internal::Minimum minimum =
      internal::minimise(evaluate, guess,
                         {config.max_iterations, config.step_translation_m,
                          config.step_rotation_rad, config.max_step_m, range});
  (void)evaluate(minimum.pose);
  return internal::judged_match(minimum, at, source, range, guess, internal::Judgement(config));
}

}  // namespace understory
