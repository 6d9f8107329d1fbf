#include "understory/registration/go_icp.h"

#include <algorithm>
#include <cmath>
#include <queue>
#include <vector>

#include "understory/registration/nearest_table.h"
#include "understory/util/median.h"

namespace understory {
namespace {

// A box of yaws and shifts about the guess: middle and half sizes.
struct Box {
  double yaw, x, y;
  double half_yaw, half_x, half_y;
  double bound_m = 0.0;  // no place in it has a smaller error
  std::int64_t number = 0;
};
struct Later {
  bool operator()(const Box& a, const Box& b) const {
    if (a.bound_m != b.bound_m) return a.bound_m > b.bound_m;
    return a.number > b.number;
  }
};

struct Errors {
  double at_middle_m;  // trimmed root mean square error at the middle of the box
  double bound_m;
};

// The trimmed error over boxes, P0 (22): every point's distance at the middle, less what turning
// and shifting within the box can bring it nearer.
class Bounds {
 public:
  Bounds(const SparseTarget& target, const SparsePoints& source, const Pose& guess,
         const GoIcpConfig& config)
      : table_(target.grid, config.shift_range_m),
        keep_(trimmed_count(source.size(), config.outlier_ratio)),
        origin_(guess.translation()) {
    for (const Eigen::Vector3d& point : source) {
      const Eigen::Vector3d turned = guess.rotation() * point;
      points_.emplace_back(turned.head<2>());
      radii_.push_back(turned.head<2>().norm());
      reach_m_ = std::max(reach_m_, radii_.back());
      mean_radius_m_ += radii_.back() / static_cast<double>(source.size());
    }
    middle_.resize(points_.size());
    lower_.resize(points_.size());
  }

  [[nodiscard]] Errors of(const Box& box) {
    const double c = std::cos(box.yaw);
    const double s = std::sin(box.yaw);
    const double x = origin_.x() + box.x;
    const double y = origin_.y() + box.y;
    const double chord = 2.0 * std::sin(std::min(0.5 * box.half_yaw, 0.5 * M_PI));
    const double shift = std::hypot(box.half_x, box.half_y);
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const Eigen::Vector2d& p = points_[i];
      const double squared =
          table_.squared_distance(c * p.x() - s * p.y() + x, s * p.x() + c * p.y() + y);
      middle_[i] = squared;
      const double less = std::max(std::sqrt(squared) - chord * radii_[i] - shift, 0.0);
      lower_[i] = less * less;
    }
    return {trimmed(middle_), trimmed(lower_)};
  }

  [[nodiscard]] double mean_radius_m() const { return mean_radius_m_; }
  [[nodiscard]] double reach_m() const { return reach_m_; }

 private:
  [[nodiscard]] double trimmed(std::vector<double>& squared) const {
    const auto end = squared.begin() + static_cast<std::ptrdiff_t>(keep_);
    if (end < squared.end()) std::nth_element(squared.begin(), end, squared.end());
    double sum = 0.0;
    for (auto value = squared.begin(); value != end; ++value)
      sum += *value;
    return std::sqrt(sum / static_cast<double>(keep_));
  }

  NearestTable table_;
  std::size_t keep_;
  Eigen::Vector3d origin_;
  std::vector<Eigen::Vector2d> points_;
  std::vector<double> radii_;
  double mean_radius_m_ = 0.0;
  double reach_m_ = 0.0;
  std::vector<double> middle_;
  std::vector<double> lower_;
};

class Search {
 public:
  Search(const SparseTarget& target, const SparsePoints& source, const Pose& guess,
         const GoIcpConfig& config)
      : target_(target),
        source_(source),
        guess_(guess),
        config_(config),
        bounds_(target, source, guess, config),
        region_(convergence_region(target.l0_m, bounds_.reach_m(), config.outlier_ratio)) {
    if (config.finest_yaw_deg > 0.0) region_.theta0_rad = config.finest_yaw_deg * M_PI / 180.0;
    if (config.finest_shift_m > 0.0) region_.delta0_m = config.finest_shift_m;
    icp_.metric = SparseIcpConfig::Metric::kPlane;
    icp_.outlier_ratio = config.outlier_ratio;
    icp_.refine = false;
  }

  GoIcpResult run() {
    const double yaw = config_.yaw_range_deg * M_PI / 180.0;
    Box all{0.0, 0.0, 0.0, yaw, config_.shift_range_m, config_.shift_range_m};
    result_.error_rms_m = 1e300;
    open(all);
    double floor = 0.0;
    while (!queue_.empty()) {
      const Box box = queue_.top();
      floor = box.bound_m;
      if (result_.error_rms_m - floor <= wanted_gap()) break;
      if (result_.nodes >= config_.max_nodes) {
        result_.status = GoIcpStatus::kNodeLimit;
        result_.reason = "the search was given up before the gap was closed";
        break;
      }
      queue_.pop();
      split(box);
    }
    if (queue_.empty()) floor = result_.error_rms_m;
    return finish(std::min(floor, left_aside_m_));
  }

 private:
  [[nodiscard]] bool paper() const { return config_.mode == GoIcpConfig::Mode::kPaper; }
  [[nodiscard]] double wanted_gap() const { return paper() ? 0.0 : config_.gap_m; }
  [[nodiscard]] Pose pose_of(const Box& box) const {
    const Eigen::Quaterniond yaw(Eigen::AngleAxisd(box.yaw, Eigen::Vector3d::UnitZ()));
    return Pose(yaw * guess_.rotation(), guess_.translation() + Eigen::Vector3d(box.x, box.y, 0.0));
  }

  // Computes a box's bound; a middle better than all before is improved by ICP.
  void open(Box box) {
    box.number = result_.nodes++;
    const Errors errors = bounds_.of(box);
    box.bound_m = std::max(errors.bound_m, 0.0);
    const bool leaf =
        paper() && region_.contains(std::hypot(box.half_x, box.half_y), box.half_yaw, 0.0);
    if (box.bound_m >= result_.error_rms_m) return;
    if (leaf || errors.at_middle_m < result_.error_rms_m) improve(pose_of(box), errors.at_middle_m);
    if (leaf)
      left_aside_m_ = std::min(left_aside_m_, box.bound_m);
    else if (box.bound_m < result_.error_rms_m)
      queue_.push(box);
  }

  void improve(const Pose& from, double error_m) {
    if (error_m < result_.error_rms_m) {
      result_.error_rms_m = error_m;
      result_.plane_optimum = from;
    }
    ++result_.icp_runs;
    const SparseIcpResult icp = register_sparse_icp(target_, source_, from, icp_);
    const Vector6d moved = right_difference(icp.target_from_source, guess_);
    const double yaw = config_.yaw_range_deg * M_PI / 180.0;
    const Eigen::Vector3d shift = icp.target_from_source.translation() - guess_.translation();
    const bool inside = std::abs(moved.head<3>().norm()) <= yaw + 1e-9 &&
                        shift.head<2>().cwiseAbs().maxCoeff() <= config_.shift_range_m;
    if (!inside || icp.error_rms_m >= result_.error_rms_m) return;
    result_.error_rms_m = icp.error_rms_m;
    result_.plane_optimum = icp.target_from_source;
  }

  void split(const Box& box) {
    config_.boxes == GoIcpConfig::Boxes::kCubes ? split_all_sides(box) : split_longest_side(box);
  }

  void split_all_sides(const Box& box) {
    Box part = box;
    part.half_yaw = 0.5 * box.half_yaw;
    part.half_x = 0.5 * box.half_x;
    part.half_y = 0.5 * box.half_y;
    for (int corner = 0; corner < 8; ++corner) {
      part.yaw = box.yaw + ((corner & 1) != 0 ? part.half_yaw : -part.half_yaw);
      part.x = box.x + ((corner & 2) != 0 ? part.half_x : -part.half_x);
      part.y = box.y + ((corner & 4) != 0 ? part.half_y : -part.half_y);
      open(part);
    }
  }

  // Halves the side that can bring points nearest.
  void split_longest_side(const Box& box) {
    const double turn = box.half_yaw * bounds_.mean_radius_m();
    Box a = box;
    Box b = box;
    const auto halve = [](double& half, double& low, double& high, double& other) {
      half *= 0.5;
      other = half;
      low -= half;
      high += half;
    };
    if (turn >= std::max(box.half_x, box.half_y))
      halve(a.half_yaw, a.yaw, b.yaw, b.half_yaw);
    else if (box.half_x >= box.half_y)
      halve(a.half_x, a.x, b.x, b.half_x);
    else
      halve(a.half_y, a.y, b.y, b.half_y);
    open(a);
    open(b);
  }

  GoIcpResult finish(double floor) {
    result_.gap_m = std::max(0.0, result_.error_rms_m - floor);
    if (result_.status != GoIcpStatus::kNodeLimit)
      result_.status = paper() ? GoIcpStatus::kConverged : GoIcpStatus::kCertified;
    result_.cells = 2.0 * config_.yaw_range_deg * M_PI / 180.0 / region_.theta0_rad *
                    std::pow(2.0 * config_.shift_range_m / region_.delta0_m, 2.0);
    result_.target_from_source = lift(result_.plane_optimum);
    SparseIcpConfig space;
    space.outlier_ratio = config_.outlier_ratio;
    const SparseIcpResult icp =
        register_sparse_icp(target_, source_, result_.target_from_source, space);
    result_.overlap = icp.overlap;
    if (config_.refine) result_.target_from_source = icp.target_from_source;
    return result_;
  }

  // Moves to the median height of the pairs that match in the plane.
  [[nodiscard]] Pose lift(const Pose& pose) const {
    std::vector<double> heights;
    for (const Eigen::Vector3d& point : source_) {
      const Eigen::Vector3d at = pose * point;
      const auto found = target_.grid.nearest(at, 0.15 * target_.l0_m, 0.0);
      if (found.index >= 0)
        heights.push_back(target_.grid.points()[static_cast<std::size_t>(found.index)].z() -
                          at.z());
    }
    const Eigen::Vector3d up(0.0, 0.0, upper_median(std::move(heights)));
    return Pose(pose.rotation(), pose.translation() + up);
  }

  const SparseTarget& target_;
  const SparsePoints& source_;
  Pose guess_;
  const GoIcpConfig& config_;
  Bounds bounds_;
  ConvergenceRegion region_;
  SparseIcpConfig icp_;
  std::priority_queue<Box, std::vector<Box>, Later> queue_;
  double left_aside_m_ = 1e300;  // least bound of the boxes handed over to ICP (paper)
  GoIcpResult result_;
};

}  // namespace

void describe(ConfigTable& table, GoIcpConfig& config) {
  table.add_enum(
      "mode", config.mode,
      {{"certified", GoIcpConfig::Mode::kCertified}, {"paper", GoIcpConfig::Mode::kPaper}},
      "certified: until the gap is closed; paper: down to ICP's convergence region");
  table.add_enum(
      "boxes", config.boxes,
      {{"elongated", GoIcpConfig::Boxes::kElongated}, {"cubes", GoIcpConfig::Boxes::kCubes}},
      "elongated: halved where points move most; cubes: on all sides at once");
  table.add("yaw_range_deg", config.yaw_range_deg, {0.0, 180.0}, "deg", "around the guess");
  table.add("shift_range_m", config.shift_range_m, {0.01, 1000.0}, "m",
            "around the guess, per horizontal axis");
  table.add("outlier_ratio", config.outlier_ratio, {0.0, 0.95}, "",
            "share of the source points left out, the worst; P0's gamma");
  table.add("gap_m", config.gap_m, {0.001, 100.0}, "m",
            "certified when no other place can have an error smaller by more than this");
  table.add("finest_yaw_deg", config.finest_yaw_deg, {0.0, 180.0}, "deg",
            "half side of the boxes at which the paper's mode stops; 0: theta0, P0 (25)");
  table.add("finest_shift_m", config.finest_shift_m, {0.0, 1000.0}, "m",
            "the same of the shift; 0: delta0, P0 (24)");
  table.add("max_nodes", config.max_nodes, {1, 2'000'000'000}, "", "given up beyond");
  table.add("refine", config.refine, "all six degrees of freedom by ICP at the end");
}

std::string to_string(GoIcpStatus status) {
  switch (status) {
    case GoIcpStatus::kCertified:
      return "certified";
    case GoIcpStatus::kConverged:
      return "converged";
    case GoIcpStatus::kNodeLimit:
      return "node_limit";
    case GoIcpStatus::kTooFewPoints:
      break;
  }
  return "too_few_points";
}

GoIcpResult register_go_icp(const SparseTarget& target, const SparsePoints& source,
                            const Pose& guess, const GoIcpConfig& config) {
  if (source.size() < kFewestStems || target.grid.points().size() < kFewestStems ||
      target.l0_m <= 0.0) {
    GoIcpResult result;
    result.target_from_source = guess;
    result.reason = too_few_stems();
    return result;
  }
  return Search(target, source, guess, config).run();
}

}  // namespace understory
