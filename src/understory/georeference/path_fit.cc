#include "understory/georeference/path_fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "understory/geometry/plane/plane_grid.h"
#include "understory/geometry/symmetric_eigen.h"
#include "understory/georeference/georeference_constants.h"
#include "understory/util/median.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

using namespace georeference_constants::path_fit;

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kNowhere = 1e9;  // no limit to how far a nearest point may be

struct Motion {
  double yaw = 0.0;
  Vector2d shift = Vector2d::Zero();

  [[nodiscard]] Pose pose() const {
    return {Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Vector3d::UnitZ())),
            Vector3d(shift.x(), shift.y(), 0.0)};
  }
};

// Points of a path with the number of those that they stand for.
struct Cloud {
  SparsePoints points;
  std::vector<double> weights;  // sum 1
};

// Who stands still gives thousands of points at one place: those of one small cell become their
// mean, which counts as often.
Cloud gathered(const std::vector<Vector3d>& path, double cell_m) {
  std::map<std::pair<long, long>, std::pair<Vector3d, double>> cells;
  for (const Vector3d& point : path) {
    auto& [sum, count] =
        cells
            .try_emplace({std::lround(point.x() / cell_m), std::lround(point.y() / cell_m)},
                         Vector3d::Zero(), 0.0)
            .first->second;
    sum += Vector3d(point.x(), point.y(), 0.0);
    count += 1.0;
  }
  Cloud cloud;
  for (const auto& [key, cell] : cells) {
    cloud.points.emplace_back(cell.first / cell.second);
    cloud.weights.push_back(cell.second / static_cast<double>(path.size()));
  }
  return cloud;
}

// Every place alike, however long it was stayed at: for the search of a start.
Cloud levelled(Cloud cloud) {
  cloud.weights.assign(cloud.points.size(), 1.0 / static_cast<double>(cloud.points.size()));
  return cloud;
}

struct Pairs {
  std::vector<Vector2d> source;  // in the path's own frame
  std::vector<Vector2d> target;
  std::vector<double> weights;
  std::vector<double> distance_m;

  void add(const Vector3d& s, const Vector3d& t, double weight, double squared) {
    source.emplace_back(s.head<2>());
    target.emplace_back(t.head<2>());
    weights.push_back(weight);
    distance_m.push_back(std::sqrt(squared));
  }
};

class Fitter {
 public:
  Fitter(Cloud path, Cloud fixes)
      : path_(std::move(path)),
        fixes_(std::move(fixes)),
        path_grid_(path_.points),
        fix_grid_(fixes_.points) {}

  // First the fixes with their nearest points of the path, then the other way round.
  [[nodiscard]] Pairs pairs(const Motion& motion) const {
    Pairs result;
    const Pose target_from_source = motion.pose();
    const Pose source_from_target = target_from_source.inverse();
    for (std::size_t k = 0; k < fixes_.points.size(); ++k) {
      const auto found = path_grid_.nearest(source_from_target * fixes_.points[k], kNowhere, 0.0);
      result.add(path_.points[static_cast<std::size_t>(found.index)], fixes_.points[k],
                 0.5 * fixes_.weights[k], found.squared_m2);
    }
    for (std::size_t k = 0; k < path_.points.size(); ++k) {
      const auto found = fix_grid_.nearest(target_from_source * path_.points[k], kNowhere, 0.0);
      result.add(path_.points[k], fixes_.points[static_cast<std::size_t>(found.index)],
                 0.5 * path_.weights[k], found.squared_m2);
    }
    return result;
  }

  // The centres of both laid on each other.
  [[nodiscard]] Motion centred(double yaw) const {
    return {yaw, mean_of(fixes_) - Eigen::Rotation2Dd(yaw) * mean_of(path_)};
  }

  // Nearest points and the motion that fits them best, in turn.
  [[nodiscard]] Motion descend(Motion motion, bool robust, int steps) const;
  // The same with the heading held: only the shift is fitted.
  [[nodiscard]] Motion slide(Motion motion, double width_m, int steps) const;
  // Turned about the middle of the path.
  [[nodiscard]] Motion turned(const Motion& motion, double yaw) const {
    const Vector2d middle = mean_of(path_);
    return {motion.yaw + yaw, motion.shift + Eigen::Rotation2Dd(motion.yaw) * middle -
                                  Eigen::Rotation2Dd(motion.yaw + yaw) * middle};
  }
  [[nodiscard]] double value(const Motion& motion) const {
    return value_of(pairs(motion), std::numeric_limits<double>::infinity());
  }
  // The width of Tukey's biweight from the pairs themselves.
  [[nodiscard]] static double width_of(const Pairs& pairs) {
    std::vector<double> distances = pairs.distance_m;
    // The median of a Rayleigh distribution is 1.18 standard deviations of a coordinate.
    return kBiweightReach * std::max(kLeastWidthM, upper_median(distances) / kRayleighMedian);
  }
  // The mean of (6), or of the biweight's loss.
  [[nodiscard]] static double value_of(const Pairs& pairs, double width_m) {
    double sum = 0.0;
    for (std::size_t k = 0; k < pairs.weights.size(); ++k)
      sum += pairs.weights[k] * loss(pairs.distance_m[k], width_m);
    return sum;
  }

 private:
  [[nodiscard]] static Vector2d mean_of(const Cloud& cloud) {
    Vector2d sum = Vector2d::Zero();
    for (std::size_t k = 0; k < cloud.points.size(); ++k)
      sum += cloud.weights[k] * cloud.points[k].head<2>();
    return sum;
  }
  [[nodiscard]] static double loss(double distance_m, double width_m) {
    if (!std::isfinite(width_m)) return distance_m * distance_m;
    const double u = std::min(1.0, std::pow(distance_m / width_m, 2.0));
    return width_m * width_m / 3.0 * (1.0 - std::pow(1.0 - u, 3.0));
  }

  Cloud path_;
  Cloud fixes_;
  PlaneGrid path_grid_;
  PlaneGrid fix_grid_;
};

// Least squares over weighted pairs, closed form.
Motion best_motion(const Pairs& pairs, double width_m) {
  std::vector<double> weights = pairs.weights;
  double total = 0.0;
  Vector2d source = Vector2d::Zero();
  Vector2d target = Vector2d::Zero();
  for (std::size_t k = 0; k < weights.size(); ++k) {
    const double u = pairs.distance_m[k] / width_m;
    weights[k] *= u < 1.0 ? std::pow(1.0 - u * u, 2.0) : 0.0;
    total += weights[k];
    source += weights[k] * pairs.source[k];
    target += weights[k] * pairs.target[k];
  }
  source /= total;
  target /= total;
  double along = 0.0;
  double across = 0.0;
  for (std::size_t k = 0; k < weights.size(); ++k) {
    const Vector2d s = pairs.source[k] - source;
    const Vector2d t = pairs.target[k] - target;
    along += weights[k] * s.dot(t);
    across += weights[k] * (s.x() * t.y() - s.y() * t.x());
  }
  const double yaw = std::atan2(across, along);
  return {yaw, target - Eigen::Rotation2Dd(yaw) * source};
}

Motion Fitter::descend(Motion motion, bool robust, int steps) const {
  for (int step = 0; step < steps; ++step) {
    const Pairs now = pairs(motion);
    const Motion next =
        best_motion(now, robust ? width_of(now) : std::numeric_limits<double>::infinity());
    const double moved = (next.shift - motion.shift).norm();
    const double turned = std::abs(std::remainder(next.yaw - motion.yaw, 2.0 * M_PI));
    motion = next;
    if (moved < 1e-6 && turned < 1e-9) break;
  }
  return motion;
}

Motion Fitter::slide(Motion motion, double width_m, int steps) const {
  for (int step = 0; step < steps; ++step) {
    const Pairs now = pairs(motion);
    Vector2d sum = Vector2d::Zero();
    double total = 0.0;
    for (std::size_t k = 0; k < now.weights.size(); ++k) {
      const double u = now.distance_m[k] / width_m;
      const double weight = now.weights[k] * (u < 1.0 ? std::pow(1.0 - u * u, 2.0) : 0.0);
      sum += weight * (now.target[k] - Eigen::Rotation2Dd(motion.yaw) * now.source[k]);
      total += weight;
    }
    if (total <= 0.0) break;
    const double moved = (sum / total - motion.shift).norm();
    motion.shift = sum / total;
    if (moved < 1e-3) break;
  }
  return motion;
}

double extent_m(const std::vector<Vector3d>& points) {
  Vector2d low = points.front().head<2>();
  Vector2d high = low;
  for (const Vector3d& point : points) {
    low = low.cwiseMin(point.head<2>());
    high = high.cwiseMax(point.head<2>());
  }
  return (high - low).norm();
}

// The direction in which the fixes reach farthest.
Vector2d main_direction(const std::vector<Vector3d>& points) {
  Vector2d mean = Vector2d::Zero();
  for (const Vector3d& point : points)
    mean += point.head<2>() / static_cast<double>(points.size());
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  for (const Vector3d& point : points)
    scatter += (point.head<2>() - mean) * (point.head<2>() - mean).transpose();
  return symmetric_eigen(scatter).vectors.col(1);
}

double turn_deg(const Motion& a, const Motion& b) {
  return std::abs(std::remainder(a.yaw - b.yaw, 2.0 * M_PI)) * 180.0 / M_PI;
}

// Where the search from every heading ends, the best first.
std::vector<std::pair<double, Motion>> starts(const std::vector<Vector3d>& path,
                                              const std::vector<Vector3d>& fixes, int yaws) {
  const double cell_m =
      std::max(kLeastCoarseM, std::max(extent_m(path), extent_m(fixes)) / kCoarseCells);
  const Fitter coarse(levelled(gathered(path, cell_m)), levelled(gathered(fixes, cell_m)));
  std::vector<std::pair<double, Motion>> ends;
  for (int k = 0; k < yaws; ++k) {
    const Motion end = coarse.descend(coarse.centred(2.0 * M_PI * k / yaws), true, kCoarseSteps);
    const Pairs pairs = coarse.pairs(end);
    ends.emplace_back(Fitter::value_of(pairs, std::numeric_limits<double>::infinity()), end);
  }
  sort_stably(ends, [](const auto& a, const auto& b) { return a.first < b.first; });
  return ends;
}

// Along a nearly straight road nearest points hardly pull, and the descent ends early. It begins
// again from places before and behind, until none is better.
Motion slid(const Fitter& fitter, Motion best, const Vector2d& along, bool robust) {
  const auto width = [&](const Motion& motion) {
    return robust ? Fitter::width_of(fitter.pairs(motion))
                  : std::numeric_limits<double>::infinity();
  };
  for (int round = 0; round < kSlideRounds; ++round) {
    Motion better = best;
    for (const double shift_m : kSlidesM) {
      const Motion end =
          fitter.descend({best.yaw, best.shift + shift_m * along}, robust, kSlideSteps);
      const double width_m = std::min(width(better), width(end));
      if (Fitter::value_of(fitter.pairs(end), width_m) <
          kBetter * Fitter::value_of(fitter.pairs(better), width_m))
        better = end;
    }
    if ((better.shift - best.shift).norm() == 0.0) break;
    best = better;
  }
  return best;
}

// The number of independent fixes that are worth as much as these, in their order. A receiver errs
// slowly, so fixes that follow each other say nearly the same.
double independent_fixes(const std::vector<Vector3d>& path, const std::vector<Vector3d>& fixes,
                         const Motion& motion, double width_m) {
  const PlaneGrid grid(gathered(path, kGatheredM).points);
  const Pose source_from_target = motion.pose().inverse();
  std::vector<Vector2d> errors;
  for (const Vector3d& fix : fixes) {
    const Vector3d at = source_from_target * Vector3d(fix.x(), fix.y(), 0.0);
    const auto found = grid.nearest(at, kNowhere, 0.0);
    if (found.squared_m2 >= width_m * width_m) continue;
    errors.emplace_back(at.head<2>() -
                        grid.points()[static_cast<std::size_t>(found.index)].head<2>());
  }
  const auto product = [&](std::size_t lag) {
    double sum = 0.0;
    for (std::size_t k = lag; k < errors.size(); ++k)
      sum += errors[k].dot(errors[k - lag]);
    return sum;
  };
  const double variance = product(0);
  double time = 1.0;
  for (std::size_t lag = 1; variance > 0.0 && lag < std::min(kLongestLag, errors.size() / 3);
       ++lag) {
    const double correlation = product(lag) / variance;
    if (correlation < kNoMore) break;
    time += 2.0 * correlation;
  }
  return static_cast<double>(errors.size()) / time;
}

// From the profile of the robust sum over the heading, with the best shift for each. The result is
// the turn that costs as much as one standard deviation does. Straight, short and round paths have
// flat profiles. Half of the wider side and the narrower one, at most 90 degrees.
double heading_sd_deg(const Fitter& fitter, const Motion& best, double width_m,
                      double independent) {
  const double value = Fitter::value_of(fitter.pairs(best), width_m);
  const double noise_m2 = std::max(value, kLeastNoiseM * kLeastNoiseM);
  double sum = 0.0;
  for (const double side : {-1.0, 1.0}) {
    double sd = kMostDeg;
    for (double deg = kFirstDeg; deg <= kMostDeg; deg *= 2.0) {
      const Motion turned =
          fitter.slide(fitter.turned(best, side * deg * M_PI / 180.0), width_m, kTurnedSteps);
      const double rise = Fitter::value_of(fitter.pairs(turned), width_m) - value;
      const double sigmas2 = independent * rise / noise_m2;
      if (sigmas2 < 1.0) continue;
      sd = std::min(kMostDeg, deg / std::sqrt(sigmas2));
      break;
    }
    sum += 0.5 * sd;
  }
  return sum;
}

void tell_fixes(const std::vector<Vector3d>& path, const std::vector<Vector3d>& fixes,
                double width_m, PathFit& fit) {
  const PlaneGrid grid(gathered(path, kGatheredM).points);
  const Pose source_from_target = fit.target_from_source.inverse();
  double squares = 0.0;
  double sum = 0.0;
  for (const Vector3d& fix : fixes) {
    const double squared = grid.nearest(source_from_target * fix, kNowhere, 0.0).squared_m2;
    squares += squared;
    sum += std::sqrt(squared);
    fit.fix_distance_m.push_back(std::sqrt(squared));
    fit.fix_used.push_back(std::sqrt(squared) < width_m ? 1 : 0);
  }
  const auto count = static_cast<double>(fixes.size());
  fit.fixes_rms_m = std::sqrt(squares / count);
  fit.fixes_mean_m = sum / count;
  std::vector<double> distances = fit.fix_distance_m;
  fit.fixes_median_m = upper_median(distances);
}

void tell_path(const std::vector<Vector3d>& path, const std::vector<Vector3d>& fixes,
               PathFit& fit) {
  const PlaneGrid grid(gathered(fixes, kGatheredM).points);
  double squares = 0.0;
  double sum = 0.0;
  for (const Vector3d& point : path) {
    const double squared = grid.nearest(fit.target_from_source * point, kNowhere, 0.0).squared_m2;
    squares += squared;
    sum += std::sqrt(squared);
  }
  fit.path_rms_m = std::sqrt(squares / static_cast<double>(path.size()));
  fit.path_mean_m = sum / static_cast<double>(path.size());
}

}  // namespace

PathFit fit_path(const std::vector<Vector3d>& path, const std::vector<Vector3d>& fixes,
                 const PathFitConfig& config) {
  PathFit fit;
  if (path.size() < kFewestPoints || fixes.size() < kFewestPoints ||
      extent_m(path) < kLeastExtentM || extent_m(fixes) < kLeastExtentM) {
    fit.reason = fmt::format(
        "expected two paths of at least {} points and {:g} m; there are {} points and {} fixes",
        kFewestPoints, kLeastExtentM, path.size(), fixes.size());
    return fit;
  }
  const auto ends = starts(path, fixes, config.yaw_starts);
  const Fitter fine(gathered(path, kGatheredM), gathered(fixes, kGatheredM));
  // The best three ends that differ, each refined with everything.
  const Vector2d along = main_direction(fixes);
  std::vector<Motion> refined;
  const auto wanted = [&](const Motion& motion) {
    return !std::isfinite(config.about_yaw_rad) ||
           turn_deg(motion, {config.about_yaw_rad, Vector2d::Zero()}) < 90.0;
  };
  for (const auto& [value, end] : ends) {
    if (!wanted(end)) continue;
    const bool known = std::any_of(refined.begin(), refined.end(), [&, &e = end](const Motion& m) {
      return turn_deg(m, e) < kOtherDeg;
    });
    if (known) continue;
    refined.push_back(slid(fine, fine.descend(end, config.robust, 200), along, config.robust));
    if (refined.size() == 3) break;
  }
  if (refined.empty()) {
    fit.reason = "no motion in the direction asked for lays the paths on each other";
    return fit;
  }
  // One width for all, or the worst motion would forgive itself most.
  double width_m = std::numeric_limits<double>::infinity();
  for (const Motion& motion : refined) {
    if (config.robust) width_m = std::min(width_m, Fitter::width_of(fine.pairs(motion)));
  }
  const auto best =
      std::min_element(refined.begin(), refined.end(), [&](const Motion& a, const Motion& b) {
        return Fitter::value_of(fine.pairs(a), width_m) < Fitter::value_of(fine.pairs(b), width_m);
      });
  fit.found = true;
  fit.target_from_source = best->pose();
  fit.symmetric_rms_m = std::sqrt(fine.value(*best));
  fit.turned_rms_m = std::numeric_limits<double>::infinity();
  for (const Motion& other : refined) {
    const double rms = std::sqrt(fine.value(other));
    if (turn_deg(other, *best) < kOtherDeg || rms >= fit.turned_rms_m) continue;
    fit.turned_rms_m = rms;
    fit.turned_target_from_source = other.pose();
  }
  fit.heading_sd_deg =
      heading_sd_deg(fine, *best, width_m, independent_fixes(path, fixes, *best, width_m));
  tell_fixes(path, fixes, width_m, fit);
  tell_path(path, fixes, fit);
  return fit;
}

}  // namespace understory
