#include "understory/registration/stems/go_icp.h"

#include <algorithm>
#include <cmath>
#include <queue>
#include <vector>

#include "understory/registration/registration_constants.h"
#include "understory/registration/stems/go_icp_bounds.h"
#include "understory/util/angles.h"
#include "understory/util/median.h"

namespace understory {
namespace {

using namespace registration_constants::go_icp;

struct Later {
  bool operator()(const GoIcpBox& a, const GoIcpBox& b) const {
    if (a.bound_m != b.bound_m) return a.bound_m > b.bound_m;
    return a.number > b.number;
  }
};

bool in_space(const GoIcpConfig& config) {
  return config.motion == GoIcpConfig::Motion::kSpace;
}

// All that is searched.
GoIcpBox whole_box(const GoIcpConfig& config) {
  GoIcpBox box;
  box.half[GoIcpBox::kYaw] = config.yaw_range_deg * kDegree;
  box.half.segment<2>(GoIcpBox::kX).setConstant(config.shift_range_m);
  if (!in_space(config)) return box;
  box.half.segment<2>(GoIcpBox::kTiltX).setConstant(config.tilt_range_deg * kDegree);
  box.half[GoIcpBox::kZ] = config.height_range_m;
  return box;
}

class Search {
 public:
  Search(const SparseTarget& target, const SparsePoints& source, const Pose& guess,
         const GoIcpConfig& config)
      : target_(target),
        source_(source),
        guess_(guess),
        config_(config),
        whole_(whole_box(config)),
        bounds_(target, source, guess,
                in_space(config) ? GoIcpBounds::Metric::kSpace : GoIcpBounds::Metric::kPlane,
                config.outlier_ratio, config.shift_range_m),
        region_(convergence_region(target.l0_m, bounds_.reach_m(), config.outlier_ratio)) {
    if (config.finest_yaw_deg > 0.0) region_.theta0_rad = config.finest_yaw_deg * kDegree;
    if (config.finest_shift_m > 0.0) region_.delta0_m = config.finest_shift_m;
    if (config.finest_tilt_deg > 0.0) region_.phi0_rad = config.finest_tilt_deg * kDegree;
    icp_.metric =
        in_space(config) ? SparseIcpConfig::Metric::kSpace : SparseIcpConfig::Metric::kPlane;
    icp_.outlier_ratio = config.outlier_ratio;
    icp_.refine = false;
  }

  GoIcpResult run() {
    result_.error_rms_m = 1e300;
    open(whole_);
    double floor = 0.0;
    while (!queue_.empty()) {
      const GoIcpBox box = queue_.top();
      floor = box.bound_m;
      if (result_.error_rms_m - floor <= wanted_gap()) break;
      if (result_.nodes >= config_.max_nodes) {
        result_.status = GoIcpStatus::kNodeLimit;
        result_.reason = "the search was given up before the gap was closed";
        break;
      }
      queue_.pop();
      config_.boxes == GoIcpConfig::Boxes::kCubes ? split_all_sides(box) : split_longest_side(box);
    }
    if (queue_.empty()) floor = result_.error_rms_m;
    return finish(std::min(floor, left_aside_m_));
  }

 private:
  [[nodiscard]] bool paper() const { return config_.mode == GoIcpConfig::Mode::kPaper; }
  [[nodiscard]] double wanted_gap() const { return paper() ? 0.0 : config_.gap_m; }

  // Computes a box's bound; a middle better than all before is improved by ICP.
  void open(GoIcpBox box) {
    box.number = result_.nodes++;
    const GoIcpErrors errors = bounds_.of(box);
    box.bound_m = std::max(errors.bound_m, 0.0);
    const bool leaf =
        paper() && region_.contains(box.half_shift(), box.half_yaw(), box.half_tilt());
    if (box.bound_m >= result_.error_rms_m) return;
    if (leaf || errors.at_middle_m < result_.error_rms_m)
      improve(box.target_from_source(guess_), errors.at_middle_m);
    if (leaf)
      left_aside_m_ = std::min(left_aside_m_, box.bound_m);
    else if (box.bound_m < result_.error_rms_m)
      queue_.push(box);
  }

  void improve(const Pose& from, double error_m) {
    if (error_m < result_.error_rms_m) {
      result_.error_rms_m = error_m;
      result_.optimum = from;
    }
    ++result_.icp_runs;
    const SparseIcpResult icp = register_sparse_icp(target_, source_, from, icp_);
    if (icp.error_rms_m >= result_.error_rms_m || !is_searched(icp.target_from_source)) return;
    result_.error_rms_m = icp.error_rms_m;
    result_.optimum = icp.target_from_source;
  }

  [[nodiscard]] bool is_searched(const Pose& pose) const {
    constexpr double kRounding = 1e-9;
    const GoIcpBox::Sides sides = GoIcpBox::sides_of(pose, guess_);
    return ((sides.cwiseAbs() - whole_.half).array() <= kRounding).all();
  }

  // In space all turns or all shifts, whichever move points more, as the original's two searches,
  // one inside the other, do.
  void split_all_sides(const GoIcpBox& box) {
    const double turns = bounds_.motion_m(GoIcpBox::kYaw, box.half.head<3>().norm());
    const bool turn = turns >= box.half_shift();
    std::vector<GoIcpBox> parts{box};
    for (std::size_t side = 0; side < GoIcpBox::kSides; ++side) {
      const bool other_group = in_space(config_) && (side < GoIcpBox::kX) != turn;
      if (box.half[side] <= 0.0 || other_group) continue;
      for (std::size_t k = parts.size(); k-- > 0;)
        parts.push_back(halve(parts[k], side));
    }
    for (const GoIcpBox& part : parts)
      open(part);
  }

  // Halves the side that can bring points nearest.
  void split_longest_side(GoIcpBox box) {
    std::size_t longest = 0;
    double farthest = -1.0;
    for (std::size_t side = 0; side < GoIcpBox::kSides; ++side) {
      const double motion = bounds_.motion_m(static_cast<GoIcpBox::Side>(side), box.half[side]);
      if (motion <= farthest) continue;
      farthest = motion;
      longest = side;
    }
    const GoIcpBox upper = halve(box, longest);
    open(box);
    open(upper);
  }

  // Leaves the lower half and hands back the upper one.
  static GoIcpBox halve(GoIcpBox& box, std::size_t side) {
    box.half[side] *= 0.5;
    GoIcpBox upper = box;
    box.middle[side] -= box.half[side];
    upper.middle[side] += box.half[side];
    return upper;
  }

  // Boxes of the finest size that the whole range holds.
  [[nodiscard]] double cells() const {
    const auto along = [](double half, double finest) {
      return std::max(1.0, 2.0 * half / finest);
    };
    const auto& half = whole_.half;
    const double plane = 2.0 * half[GoIcpBox::kYaw] / region_.theta0_rad *
                         std::pow(2.0 * half[GoIcpBox::kX] / region_.delta0_m, 2.0);
    return plane * std::pow(along(half[GoIcpBox::kTiltX], region_.phi0_rad), 2.0) *
           along(half[GoIcpBox::kZ], region_.delta0_m);
  }

  GoIcpResult finish(double floor) {
    result_.gap_m = std::max(0.0, result_.error_rms_m - floor);
    if (result_.status != GoIcpStatus::kNodeLimit)
      result_.status = paper() ? GoIcpStatus::kConverged : GoIcpStatus::kCertified;
    result_.cells = cells();
    result_.target_from_source = in_space(config_) ? result_.optimum : lift(result_.optimum);
    SparseIcpConfig space;
    space.outlier_ratio = config_.outlier_ratio;
    const SparseIcpResult icp =
        register_sparse_icp(target_, source_, result_.target_from_source, space);
    result_.overlap = icp.overlap;
    if (config_.refine && stays_near(icp.target_from_source))
      result_.target_from_source = icp.target_from_source;
    return result_;
  }

  // Whether the refined motion is still the one that was found. Where nothing matches, ICP goes
  // anywhere.
  [[nodiscard]] bool stays_near(const Pose& refined) const {
    const GoIcpBox::Sides off = GoIcpBox::sides_of(refined, result_.target_from_source);
    return off.segment<2>(GoIcpBox::kX).norm() <= region_.delta0_m &&
           std::abs(off[GoIcpBox::kYaw]) <= region_.theta0_rad;
  }

  // Moves to the median height of the pairs that match in the plane.
  [[nodiscard]] Pose lift(const Pose& pose) const {
    std::vector<double> heights;
    for (const Eigen::Vector3d& point : source_) {
      const Eigen::Vector3d at = pose * point;
      const auto found = target_.grid.nearest(at, kHeightPairL0 * target_.l0_m, 0.0);
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
  GoIcpBox whole_;
  GoIcpBounds bounds_;
  ConvergenceRegion region_;
  SparseIcpConfig icp_;
  std::priority_queue<GoIcpBox, std::vector<GoIcpBox>, Later> queue_;
  double left_aside_m_ = 1e300;  // least bound of the boxes handed over to ICP (paper)
  GoIcpResult result_;
};

}  // namespace

void describe(ConfigTable& table, GoIcpConfig& config) {
  table.add_enum("motion", config.motion,
                 {{"plane", GoIcpConfig::Motion::kPlane}, {"space", GoIcpConfig::Motion::kSpace}},
                 "plane: yaw and horizontal shift; space: all six degrees of freedom");
  table.add_enum(
      "mode", config.mode,
      {{"certified", GoIcpConfig::Mode::kCertified}, {"paper", GoIcpConfig::Mode::kPaper}},
      "certified: until the gap is closed; paper: down to ICP's convergence region, as published");
  table.add_enum(
      "boxes", config.boxes,
      {{"elongated", GoIcpConfig::Boxes::kElongated}, {"cubes", GoIcpConfig::Boxes::kCubes}},
      "elongated: halved where points move most; cubes: on all sides at once");
  table.add("yaw_range_deg", config.yaw_range_deg, {0.0, 180.0}, "deg",
            "searched heading to each side of the guess");
  table.add("shift_range_m", config.shift_range_m, {0.01, 1000.0}, "m",
            "searched shift to each side of the guess, per horizontal axis");
  table.add("tilt_range_deg", config.tilt_range_deg, {0.0, 180.0}, "deg",
            "motion space: searched tilt to each side of the guess, about each level axis");
  table.add("height_range_m", config.height_range_m, {0.0, 1000.0}, "m",
            "motion space: searched height to each side of the guess");
  table.add("outlier_ratio", config.outlier_ratio, {0.0, 0.95}, "",
            "share of the source points left out, those with the largest distances");
  table.add("gap_m", config.gap_m, {0.001, 100.0}, "m",
            "certified: no other place in the range has an error smaller by more than this");
  table.add(
      "finest_yaw_deg", config.finest_yaw_deg, {0.0, 180.0}, "deg",
      "mode paper: half side of the boxes at which the search stops; 0: as far as ICP converges");
  table.add("finest_shift_m", config.finest_shift_m, {0.0, 1000.0}, "m",
            "mode paper: the same of the shift; 0: as far as ICP converges");
  table.add("finest_tilt_deg", config.finest_tilt_deg, {0.0, 180.0}, "deg",
            "mode paper: the same of the tilt; 0: 8.2 degrees");
  table.add("max_nodes", config.max_nodes, {1, 2'000'000'000}, "",
            "most boxes that are looked at; beyond, the search gives up");
  table.add("refine", config.refine, "refine all six degrees of freedom by ICP at the end");
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
