#include "understory/forest/stems/circle_search.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "understory/forest/cell_index.h"
#include "understory/forest/stem_constants.h"
#include "understory/forest/stems/arc_bins.h"
#include "understory/forest/stems/point_groups.h"
#include "understory/geometry/symmetric_solver.h"
#include "understory/util/parallel.h"
#include "understory/util/random.h"

namespace understory {
namespace {

using namespace stem_constants::circle_search;

using PointList = std::vector<Eigen::Vector2f>;

// The circle through three points; false where they lie on a line.
bool circle_through(const Eigen::Vector2f& a, const Eigen::Vector2f& b, const Eigen::Vector2f& c,
                    Circle& circle) {
  const Eigen::Vector2d u = (b - a).cast<double>();
  const Eigen::Vector2d v = (c - a).cast<double>();
  const double d = 2.0 * (u.x() * v.y() - u.y() * v.x());
  if (std::abs(d) < 1e-6) return false;
  const Eigen::Vector2d w((v.y() * u.squaredNorm() - u.y() * v.squaredNorm()) / d,
                          (u.x() * v.squaredNorm() - v.x() * u.squaredNorm()) / d);
  circle.centre = a.cast<double>() + w;
  circle.radius_m = w.norm();
  return true;
}

// A square that holds all points that a fit is given; without a reach it holds the plane.
struct Surroundings {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double reach_m = std::numeric_limits<double>::infinity();

  // Whether all that lies within `reach` of a place is among the points.
  [[nodiscard]] bool hold(const Eigen::Vector2d& place, double reach) const {
    return (place - centre).cwiseAbs().maxCoeff() + reach <= reach_m;
  }
};

// The figures of a circle, counted anew.
void count_points(const PointList& points, double band_m, Circle& circle) {
  ArcBins bins;
  double squares = 0.0;
  circle.on = 0;
  circle.inside = 0;
  for (const Eigen::Vector2f& point : points) {
    const Eigen::Vector2d q = point.cast<double>() - circle.centre;
    const double e = q.norm() - circle.radius_m;
    if (e < -2.0 * band_m) ++circle.inside;
    if (std::abs(e) > band_m) continue;
    ++circle.on;
    squares += e * e;
    bins.add(q.x(), q.y());
  }
  circle.arc_deg = bins.covered_deg();
  circle.even_deg = bins.even_deg();
  circle.rms_m = circle.on > 0 ? std::sqrt(squares / circle.on) : 0.0;
}

// As refine_circle, with the points of the surroundings alone: the same bits as with all. False if
// the circle moved to where points are missing.
bool refine_among(const PointList& points, const Surroundings& around, double band_m,
                  Circle& circle) {
  const double reach = 2.0 * band_m;
  const auto held = [&] { return around.hold(circle.centre, std::abs(circle.radius_m) + reach); };
  for (int iteration = 0; iteration < 12; ++iteration) {
    if (!held()) return false;
    Eigen::Matrix3d normal = 1e-9 * Eigen::Matrix3d::Identity();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    int used = 0;
    for (const Eigen::Vector2f& point : points) {
      const Eigen::Vector2d q = point.cast<double>() - circle.centre;
      const double distance = q.norm();
      const double e = distance - circle.radius_m;
      if (std::abs(e) >= reach || distance < 1e-6) continue;
      const double u = e / reach;
      const double weight = (1.0 - u * u) * (1.0 - u * u);
      const Eigen::Vector3d jacobian(-q.x() / distance, -q.y() / distance, -1.0);
      normal += weight * jacobian * jacobian.transpose();
      gradient += weight * e * jacobian;
      ++used;
    }
    if (used < 4) break;
    const Eigen::Vector3d step = -SymmetricSolver<3>(normal).solve(gradient);
    if (!step.allFinite() || step.norm() > 0.5) break;
    circle.centre += step.head<2>();
    circle.radius_m += step.z();
    if (step.norm() < 1e-5) break;
  }
  if (!held()) return false;
  count_points(points, band_m, circle);
  return true;
}

// A search for circles in one group. The points that a circle takes away are looked up by their
// place. The time is nearly proportional to the points, even where a spoilt map hangs together as
// one group.
class GroupSearch {
 public:
  GroupSearch(PointList points, const CircleSearchConfig& config, std::uint64_t seed)
      : config_(config),
        points_(std::move(points)),
        live_(points_.size()),
        low_(lowest()),
        fine_(points_, live_, low_, kFineCell),
        coarse_(points_, live_, low_, kCoarseCell),
        random_(seed) {}

  std::vector<Circle> run(const ProgressSink& progress) {
    std::vector<Circle> found;
    int failures = 0;
    const Eigen::Vector2f extent = highest() - low_;
    const int max_failures = 2 + static_cast<int>(0.5F * extent.x() * extent.y());
    work_ += 2 * points_.size();
    while (static_cast<int>(live_.size()) >= config_.min_points && failures < max_failures) {
      progress.poll();
      const Circle sampled = sample();
      if (sampled.on < config_.min_points) break;
      const Circle circle = refine(sampled);
      const bool good = acceptable(circle);
      if (good) {
        found.push_back(circle);
      } else {
        ++failures;
      }
      remove(good ? circle : sampled, good);
    }
    return found;
  }

  // Points that were sorted, fitted or taken away, each as often as it was.
  [[nodiscard]] std::uint64_t work() const { return work_; }

 private:
  [[nodiscard]] Eigen::Vector2f lowest() const {
    Eigen::Vector2f low = Eigen::Vector2f::Constant(std::numeric_limits<float>::max());
    for (std::uint32_t i = 0; i < points_.size(); ++i) {
      if (live_.holds(i)) low = low.cwiseMin(points_[i]);
    }
    return low;
  }
  [[nodiscard]] Eigen::Vector2f highest() const {
    Eigen::Vector2f high = points_.front();
    for (const Eigen::Vector2f& point : points_)
      high = high.cwiseMax(point);
    return high;
  }

  [[nodiscard]] bool acceptable(const Circle& circle) const {
    return circle.on >= config_.min_points && circle.radius_m >= config_.min_radius_m &&
           circle.radius_m <= config_.max_radius_m && circle.arc_deg >= config_.min_arc_deg &&
           circle.even_deg >= kEvenArcShare * circle.arc_deg && 2 * circle.inside <= circle.on &&
           circle.rms_m <=
               std::max(kMostScatterBands * config_.band_m, kMostScatterShare * circle.radius_m);
  }

  // The best of many circles through three points near each other.
  Circle sample() {
    const std::size_t n = live_.size();
    const std::size_t draws = std::min<std::size_t>(kFewestDraws + n / kPointsPerDraw, kMostDraws);
    Circle best;
    double best_score = 0.0;
    for (std::size_t draw = 0; draw < draws; ++draw) {
      const Eigen::Vector2f& first = points_[live_.at(random_.below(n))];
      const float scale = kScales[draw % kScales.size()];
      if (scale > 2.0 * config_.max_radius_m) continue;
      const std::uint32_t near = coarse_.square(first, scale, candidates_);
      if (near < 3) continue;
      for (int i = 0; i < kTriesPerDraw; ++i) {
        Circle circle;
        const Eigen::Vector2f& second = pick(near);
        const Eigen::Vector2f& third = pick(near);
        if ((second - first).squaredNorm() > scale * scale ||
            (third - first).squaredNorm() > scale * scale ||
            !circle_through(first, second, third, circle) ||
            circle.radius_m < config_.min_radius_m || circle.radius_m > config_.max_radius_m) {
          continue;
        }
        const double value = score(circle, best_score);
        if (value <= best_score) continue;
        best_score = value;
        best = circle;
      }
      // Most of the group lies on one clean circle: more draws would only find it again.
      if (draw >= 8 && best.inside == 0 && 10 * best.on >= 6 * static_cast<int>(n)) break;
    }
    return best;
  }

  // One of the candidates, each as likely as any other.
  const Eigen::Vector2f& pick(std::uint32_t count) {
    auto at = static_cast<std::uint32_t>(random_.below(count));
    for (const auto& [begin, end] : candidates_) {
      if (at < end - begin) return coarse_.point(begin + at);
      at -= end - begin;
    }
    return coarse_.point(candidates_.front().first);
  }

  // (0.15 m + radius)^0.7, nearly: products of roots are cheaper than powers.
  static double length_of(double radius_m) {
    const double root = std::sqrt(kLengthOffset + radius_m);
    const double eighth = std::sqrt(std::sqrt(root));
    return root * eighth * std::sqrt(eighth);
  }

  // Points on the circle less those inside it, which a stem cannot have, about per length of the
  // circumference. A large circle through a thicket and a stem in it collects more points than the
  // stem, but hardly more per length. Gives up as soon as it cannot beat `best`.
  double score(Circle& circle, double best) {
    const Eigen::Vector2f centre = circle.centre.cast<float>();
    const auto radius = static_cast<float>(circle.radius_m);
    const auto band = static_cast<float>(config_.band_m);
    const double length = length_of(circle.radius_m);
    auto inside = static_cast<int>(
        fine_.ring(centre, std::max(0.0F, radius - 2.0F * band), radius + band, ring_));
    int possible = 0;
    for (const auto& [begin, end] : ring_)
      possible += static_cast<int>(end - begin);
    if ((possible - kInsideWeight * inside) / length <= best) return 0.0;
    int on = 0;
    for (const auto& [begin, end] : ring_) {
      for (std::uint32_t i = begin; i < end; ++i) {
        const float d = (fine_.point(i) - centre).norm() - radius;
        on += std::abs(d) <= band ? 1 : 0;
        inside += d < -2.0F * band ? 1 : 0;
      }
    }
    circle.on = on;
    circle.inside = inside;
    return (on - 1.5 * inside) / length;
  }

  // Indices of the live points within a square around a place, in order.
  const std::vector<std::uint32_t>& near(const Eigen::Vector2d& centre, double reach) {
    near_.clear();
    fine_.square(centre.cast<float>(), static_cast<float>(reach), ring_);
    for (const auto& [begin, end] : ring_) {
      for (std::uint32_t i = begin; i < end; ++i)
        near_.push_back(fine_.id(i));
    }
    std::sort(near_.begin(), near_.end());
    work_ += near_.size();
    return near_;
  }

  Circle refine(const Circle& sampled) {
    for (double margin = kRefineMargin;; margin *= 2.0) {
      const Surroundings around{sampled.centre, sampled.radius_m + 2.0 * config_.band_m + margin};
      fitted_.clear();
      for (const std::uint32_t i : near(around.centre, around.reach_m + kFineCell))
        fitted_.push_back(points_[i]);
      const bool all = fitted_.size() == live_.size();
      Circle circle = sampled;
      if (refine_among(fitted_, all ? Surroundings() : around, config_.band_m, circle))
        return circle;
    }
  }

  // Takes away what the circle explains: its points and, of a stem, all within it.
  void remove(const Circle& circle, bool stem) {
    const double margin = 1.5 * config_.band_m;
    const double reach = circle.radius_m + margin + kFineCell;
    const std::size_t before = live_.size();
    bool lowest_went = false;
    for (const std::uint32_t i : near(circle.centre, reach)) {
      const Eigen::Vector2f& point = points_[i];
      const double d = (point.cast<double>() - circle.centre).norm() - circle.radius_m;
      if (d > margin || (!stem && d < -margin)) continue;
      live_.remove(i);
      lowest_went = lowest_went || point.x() == low_.x() || point.y() == low_.y();
    }
    if (live_.size() == before) return live_.clear();  // cannot happen twice without progress
    for (CellIndex* index : {&fine_, &coarse_}) {
      work_ += index->forget(live_, circle.centre.cast<float>(), static_cast<float>(reach));
    }
    if (lowest_went && points_.size() <= kMostSortedAnew) sort_anew();
  }

  // Cells begin at the lowest points that are left.
  void sort_anew() {
    low_ = lowest();
    work_ += points_.size();
    if (live_.size() == 0) return;
    fine_ = CellIndex(points_, live_, low_, kFineCell);
    coarse_ = CellIndex(points_, live_, low_, kCoarseCell);
    work_ += 2 * live_.size();
  }

  const CircleSearchConfig& config_;
  PointList points_;
  LivePoints live_;
  Eigen::Vector2f low_;  // of the live points
  CellIndex fine_;
  CellIndex coarse_;
  Random random_;
  std::uint64_t work_ = 0;
  std::vector<std::uint32_t> near_;
  PointList fitted_;
  std::vector<CellIndex::Range> candidates_;
  std::vector<CellIndex::Range> ring_;
};

}  // namespace

Circle refine_circle(const PointList& points, const Circle& start, double band_m) {
  Circle circle = start;
  static_cast<void>(refine_among(points, {}, band_m, circle));
  return circle;
}

std::vector<std::vector<Circle>> find_circles(const std::vector<PointList>& slices,
                                              const CircleSearchConfig& config, std::uint64_t seed,
                                              const ProgressSink& progress, std::uint64_t* work) {
  std::vector<std::vector<PointGroup>> groups(slices.size());
  PointGroupConfig grouping;
  grouping.reach_m = config.reach_m;
  grouping.min_points = config.min_points;
  grouping.margin_m = group_margin_m(config.max_radius_m, config.band_m);
  grouping.area = config.area;
  grouping.origin = config.origin;
  grouping.whole = config.whole_groups;
  parallel_for(slices.size(), 1, [&](std::size_t s) {
    if (static_cast<int>(slices[s].size()) < config.min_points) return;
    groups[s] = groups_near(slices[s], grouping);
  });
  // Large groups take much longer than small ones: all slices' groups together keep all threads
  // busy to the end.
  std::vector<std::pair<std::size_t, std::size_t>> jobs;
  std::vector<std::vector<std::vector<Circle>>> found(slices.size());
  for (std::size_t s = 0; s < slices.size(); ++s) {
    found[s].resize(groups[s].size());
    for (std::size_t g = 0; g < groups[s].size(); ++g)
      jobs.emplace_back(s, g);
  }
  std::vector<std::uint64_t> works(jobs.size(), 0);
  parallel_for(jobs.size(), 1, [&](std::size_t i) {
    const auto [s, g] = jobs[i];
    PointGroup& group = groups[s][g];
    GroupSearch search(std::move(group.points), config,
                       hash_numbers(seed, s, config.whole_groups ? g : group.place));
    found[s][g] = search.run(progress);
    std::erase_if(found[s][g],
                  [&](const Circle& circle) { return !group.window.contains(circle.centre); });
    works[i] = search.work();
  });
  if (work != nullptr) *work = std::accumulate(works.begin(), works.end(), std::uint64_t{0});
  std::vector<std::vector<Circle>> all(slices.size());
  for (std::size_t s = 0; s < slices.size(); ++s) {
    for (const std::vector<Circle>& part : found[s])
      all[s].insert(all[s].end(), part.begin(), part.end());
  }
  return all;
}

}  // namespace understory
