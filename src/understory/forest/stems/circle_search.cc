#include "understory/forest/stems/circle_search.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "understory/forest/forest_constants.h"
#include "understory/forest/stems/arc_bins.h"
#include "understory/util/parallel.h"
#include "understory/util/random.h"

namespace understory {
namespace {

using namespace forest_constants::circle_search;

using PointList = std::vector<Eigen::Vector2f>;

// Points sorted into square cells, so that those near a place are found without looking at all.
class CellIndex {
 public:
  CellIndex(const PointList& points, float cell_m) : cell_m_(cell_m) {
    low_ = points.front();
    Eigen::Vector2f high = low_;
    for (const Eigen::Vector2f& point : points) {
      low_ = low_.cwiseMin(point);
      high = high.cwiseMax(point);
    }
    columns_ = static_cast<int>((high.x() - low_.x()) / cell_m) + 1;
    rows_ = static_cast<int>((high.y() - low_.y()) / cell_m) + 1;
    begin_.assign(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_) + 1, 0);
    for (const Eigen::Vector2f& point : points)
      ++begin_[cell_of(point) + 1];
    std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
    std::vector<std::uint32_t> next(begin_.begin(), begin_.end() - 1);
    sorted_.resize(points.size());
    for (const Eigen::Vector2f& point : points)
      sorted_[next[cell_of(point)]++] = point;
  }

  using Range = std::pair<std::uint32_t, std::uint32_t>;  // of `sorted`, without its end

  // The points of all cells that touch the square around `centre`: one range a row.
  std::uint32_t square(const Eigen::Vector2f& centre, float reach,
                       std::vector<Range>& ranges) const {
    ranges.clear();
    const int c0 = std::max(0, column(centre.x() - reach));
    const int c1 = std::min(columns_ - 1, column(centre.x() + reach));
    const int r0 = std::max(0, row(centre.y() - reach));
    const int r1 = std::min(rows_ - 1, row(centre.y() + reach));
    std::uint32_t count = 0;
    for (int r = r0; r <= r1 && c0 <= c1; ++r) {
      ranges.push_back(cells_between(r, c0, c1));
      count += ranges.back().second - ranges.back().first;
    }
    return count;
  }

  // The points in cells that touch the ring between `inner` and `outer`, as ranges; returns how
  // many lie in cells wholly within `inner`. Cells of a row follow each other, so a row takes two
  // steps.
  std::uint32_t ring(const Eigen::Vector2f& centre, float inner, float outer,
                     std::vector<Range>& ranges) const {
    ranges.clear();
    std::uint32_t within = 0;
    const int r0 = std::max(0, row(centre.y() - outer));
    const int r1 = std::min(rows_ - 1, row(centre.y() + outer));
    for (int r = r0; r <= r1; ++r) {
      const float low = low_.y() + static_cast<float>(r) * cell_m_ - centre.y();
      const float high = low + cell_m_;
      const float nearest = std::max({0.0F, low, -high});
      const float farthest = std::max(-low, high);
      const float wide = std::sqrt(std::max(0.0F, outer * outer - nearest * nearest));
      const int c0 = std::max(0, column(centre.x() - wide));
      const int c1 = std::min(columns_ - 1, column(centre.x() + wide));
      if (c0 > c1) continue;
      const float slim = inner > farthest ? std::sqrt(inner * inner - farthest * farthest) : -1.0F;
      const int i0 = std::max(c0, column(centre.x() - slim) + 1);
      const int i1 = std::min(c1, column(centre.x() + slim) - 1);
      if (slim <= 0.0F || i0 > i1) {
        add_range(cells_between(r, c0, c1), ranges);
        continue;
      }
      add_range(cells_between(r, c0, i0 - 1), ranges);
      add_range(cells_between(r, i1 + 1, c1), ranges);
      const Range inside = cells_between(r, i0, i1);
      within += inside.second - inside.first;
    }
    return within;
  }
  // The points in order of their cells.
  [[nodiscard]] const PointList& sorted() const { return sorted_; }

 private:
  [[nodiscard]] int column(float x) const {
    return static_cast<int>(std::floor((x - low_.x()) / cell_m_));
  }
  [[nodiscard]] int row(float y) const {
    return static_cast<int>(std::floor((y - low_.y()) / cell_m_));
  }
  static void add_range(const Range& range, std::vector<Range>& ranges) {
    if (range.first < range.second) ranges.push_back(range);
  }
  [[nodiscard]] Range cells_between(int r, int c0, int c1) const {
    const std::size_t base = static_cast<std::size_t>(r) * static_cast<std::size_t>(columns_);
    return {begin_[base + static_cast<std::size_t>(c0)],
            begin_[base + static_cast<std::size_t>(c1) + 1]};
  }
  [[nodiscard]] std::size_t cell_of(const Eigen::Vector2f& point) const {
    const int c = std::clamp(column(point.x()), 0, columns_ - 1);
    const int r = std::clamp(row(point.y()), 0, rows_ - 1);
    return static_cast<std::size_t>(r) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(c);
  }

  float cell_m_;
  Eigen::Vector2f low_;
  int columns_ = 0;
  int rows_ = 0;
  std::vector<std::uint32_t> begin_;
  PointList sorted_;
};

// Groups of points that hang together: cells of `reach` that touch, also by a corner.
std::vector<PointList> groups_of(const PointList& points, double reach, int min_points) {
  std::vector<std::pair<std::uint64_t, std::uint32_t>> cells(points.size());
  const auto key = [&](std::int64_t column, std::int64_t row) {
    return static_cast<std::uint64_t>(row + (1LL << 31)) << 32 |
           static_cast<std::uint64_t>(column + (1LL << 31));
  };
  for (std::size_t i = 0; i < points.size(); ++i) {
    cells[i] = {key(static_cast<std::int64_t>(std::floor(points[i].x() / reach)),
                    static_cast<std::int64_t>(std::floor(points[i].y() / reach))),
                static_cast<std::uint32_t>(i)};
  }
  std::sort(cells.begin(), cells.end());
  std::vector<std::uint64_t> keys;
  for (const auto& cell : cells) {
    if (keys.empty() || keys.back() != cell.first) keys.push_back(cell.first);
  }
  std::vector<std::uint32_t> parent(keys.size());
  std::iota(parent.begin(), parent.end(), 0U);
  const auto root = [&](std::uint32_t i) {
    while (parent[i] != i)
      i = parent[i] = parent[parent[i]];
    return i;
  };
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const auto row = static_cast<std::int64_t>(keys[i] >> 32) - (1LL << 31);
    const auto column = static_cast<std::int64_t>(keys[i] & 0xffffffffU) - (1LL << 31);
    constexpr std::array<std::pair<int, int>, 4> kBefore = {{{-1, 0}, {-1, -1}, {0, -1}, {1, -1}}};
    for (const auto& [dx, dy] : kBefore) {
      const std::uint64_t other = key(column + dx, row + dy);
      const auto found = std::lower_bound(keys.begin(), keys.end(), other);
      if (found == keys.end() || *found != other) continue;
      const std::uint32_t a = root(static_cast<std::uint32_t>(found - keys.begin()));
      const std::uint32_t b = root(static_cast<std::uint32_t>(i));
      parent[std::max(a, b)] = std::min(a, b);
    }
  }
  std::vector<PointList> groups(keys.size());
  std::size_t cell = 0;
  for (const auto& [k, i] : cells) {
    while (keys[cell] != k)
      ++cell;
    groups[root(static_cast<std::uint32_t>(cell))].push_back(points[i]);
  }
  std::erase_if(
      groups, [&](const PointList& group) { return static_cast<int>(group.size()) < min_points; });
  return groups;
}

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

// A search for circles in one group.
class GroupSearch {
 public:
  GroupSearch(PointList points, const CircleSearchConfig& config, std::uint64_t seed)
      : config_(config), points_(std::move(points)), random_(seed) {}

  std::vector<Circle> run() {
    std::vector<Circle> found;
    int failures = 0;
    const Eigen::Vector2f extent = extent_of(points_);
    const int max_failures = 2 + static_cast<int>(0.5F * extent.x() * extent.y());
    while (static_cast<int>(points_.size()) >= config_.min_points && failures < max_failures) {
      const CellIndex fine(points_, kFineCell);
      const CellIndex coarse(points_, kCoarseCell);
      const Circle sampled = sample(fine, coarse);
      if (sampled.on < config_.min_points) break;
      const Circle circle = refine_circle(points_, sampled, config_.band_m);
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

 private:
  static Eigen::Vector2f extent_of(const PointList& points) {
    Eigen::Vector2f low = points.front();
    Eigen::Vector2f high = low;
    for (const Eigen::Vector2f& point : points) {
      low = low.cwiseMin(point);
      high = high.cwiseMax(point);
    }
    return high - low;
  }

  [[nodiscard]] bool acceptable(const Circle& circle) const {
    return circle.on >= config_.min_points && circle.radius_m >= config_.min_radius_m &&
           circle.radius_m <= config_.max_radius_m && circle.arc_deg >= config_.min_arc_deg &&
           circle.even_deg >= kEvenArcShare * circle.arc_deg && 2 * circle.inside <= circle.on &&
           circle.rms_m <=
               std::max(kMostScatterBands * config_.band_m, kMostScatterShare * circle.radius_m);
  }

  // The best of many circles through three points near each other.
  Circle sample(const CellIndex& fine, const CellIndex& coarse) {
    const std::size_t n = points_.size();
    const std::size_t draws = std::min<std::size_t>(kFewestDraws + n / kPointsPerDraw, kMostDraws);
    Circle best;
    double best_score = 0.0;
    for (std::size_t draw = 0; draw < draws; ++draw) {
      const Eigen::Vector2f& first = points_[random_.below(n)];
      const float scale = kScales[draw % kScales.size()];
      if (scale > 2.0 * config_.max_radius_m) continue;
      const std::uint32_t near = coarse.square(first, scale, candidates_);
      if (near < 3) continue;
      for (int i = 0; i < kTriesPerDraw; ++i) {
        Circle circle;
        const Eigen::Vector2f& second = pick(coarse, near);
        const Eigen::Vector2f& third = pick(coarse, near);
        if ((second - first).squaredNorm() > scale * scale ||
            (third - first).squaredNorm() > scale * scale ||
            !circle_through(first, second, third, circle) ||
            circle.radius_m < config_.min_radius_m || circle.radius_m > config_.max_radius_m) {
          continue;
        }
        const double value = score(fine, circle, best_score);
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
  const Eigen::Vector2f& pick(const CellIndex& index, std::uint32_t count) {
    auto at = static_cast<std::uint32_t>(random_.below(count));
    for (const auto& [begin, end] : candidates_) {
      if (at < end - begin) return index.sorted()[begin + at];
      at -= end - begin;
    }
    return index.sorted()[candidates_.front().first];
  }

  // (0.15 m + radius)^0.7, nearly: products of roots are cheaper than powers.
  static double length_of(double radius_m) {
    const double root = std::sqrt(kLengthOffset + radius_m);
    const double eighth = std::sqrt(std::sqrt(root));
    return root * eighth * std::sqrt(eighth);
  }

  // Points on the circle less those inside it, which a stem cannot have, about per
  // length of the circumference: a large circle through a thicket and a stem in it collects more
  // points than the stem, but hardly more per length. Gives up as soon as it cannot beat `best`.
  double score(const CellIndex& index, Circle& circle, double best) {
    const Eigen::Vector2f centre = circle.centre.cast<float>();
    const auto radius = static_cast<float>(circle.radius_m);
    const auto band = static_cast<float>(config_.band_m);
    const double length = length_of(circle.radius_m);
    auto inside = static_cast<int>(
        index.ring(centre, std::max(0.0F, radius - 2.0F * band), radius + band, ring_));
    int possible = 0;
    for (const auto& [begin, end] : ring_)
      possible += static_cast<int>(end - begin);
    if ((possible - kInsideWeight * inside) / length <= best) return 0.0;
    int on = 0;
    for (const auto& [begin, end] : ring_) {
      for (std::uint32_t i = begin; i < end; ++i) {
        const float d = (index.sorted()[i] - centre).norm() - radius;
        on += std::abs(d) <= band ? 1 : 0;
        inside += d < -2.0F * band ? 1 : 0;
      }
    }
    circle.on = on;
    circle.inside = inside;
    return (on - 1.5 * inside) / length;
  }

  // Takes away what the circle explains: its points and, of a stem, all within it.
  void remove(const Circle& circle, bool stem) {
    const double margin = 1.5 * config_.band_m;
    const std::size_t before = points_.size();
    std::erase_if(points_, [&](const Eigen::Vector2f& point) {
      const double d = (point.cast<double>() - circle.centre).norm() - circle.radius_m;
      return d <= margin && (stem || d >= -margin);
    });
    if (points_.size() == before) points_.clear();  // cannot happen twice without progress
  }

  const CircleSearchConfig& config_;
  PointList points_;
  Random random_;
  std::vector<CellIndex::Range> candidates_;
  std::vector<CellIndex::Range> ring_;
};

}  // namespace

Circle refine_circle(const std::vector<Eigen::Vector2f>& points, const Circle& start,
                     double band_m) {
  Circle circle = start;
  for (int iteration = 0; iteration < 12; ++iteration) {
    const double reach = 2.0 * band_m;
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
    const Eigen::Vector3d step = -normal.ldlt().solve(gradient);
    if (!step.allFinite() || step.norm() > 0.5) break;
    circle.centre += step.head<2>();
    circle.radius_m += step.z();
    if (step.norm() < 1e-5) break;
  }
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
  return circle;
}

std::vector<std::vector<Circle>> find_circles(const std::vector<PointList>& slices,
                                              const CircleSearchConfig& config,
                                              std::uint64_t seed) {
  std::vector<std::vector<PointList>> groups(slices.size());
  parallel_for(slices.size(), 1, [&](std::size_t s) {
    if (static_cast<int>(slices[s].size()) < config.min_points) return;
    groups[s] = groups_of(slices[s], config.reach_m, config.min_points);
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
  parallel_for(jobs.size(), 1, [&](std::size_t i) {
    const auto [s, g] = jobs[i];
    found[s][g] = GroupSearch(std::move(groups[s][g]), config, hash_numbers(seed, s, g)).run();
  });
  std::vector<std::vector<Circle>> all(slices.size());
  for (std::size_t s = 0; s < slices.size(); ++s) {
    for (const std::vector<Circle>& part : found[s])
      all[s].insert(all[s].end(), part.begin(), part.end());
  }
  return all;
}

}  // namespace understory
