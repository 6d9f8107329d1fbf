#include "understory/registration/global/upright_search.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <tuple>

#include "understory/geometry/plane/plane_grid.h"
#include "understory/registration/global/global_constants.h"
#include "understory/util/median.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

using namespace registration_constants::upright_search;

// Two uprights and how far apart they are.
struct UprightPair {
  float length;
  float heading;
  int a;
  int b;
};

std::vector<UprightPair> pairs_of(const std::vector<Upright>& uprights) {
  std::vector<UprightPair> pairs;
  for (std::size_t i = 0; i < uprights.size(); ++i) {
    for (std::size_t j = i + 1; j < uprights.size(); ++j) {
      const double length = (uprights[i].at - uprights[j].at).norm();
      const Eigen::Vector2d d = uprights[j].at - uprights[i].at;
      if (length >= kShortest && length <= kLongest) {
        pairs.push_back({static_cast<float>(length), static_cast<float>(std::atan2(d.y(), d.x())),
                         static_cast<int>(i), static_cast<int>(j)});
      }
    }
  }
  std::sort(pairs.begin(), pairs.end(), [](const UprightPair& x, const UprightPair& y) {
    return std::tie(x.length, x.a, x.b) < std::tie(y.length, y.a, y.b);
  });
  return pairs;
}

// A turn about z about the middle of the source's uprights, and where that middle comes to lie.
struct PlaneStart {
  double yaw = 0.0;
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
};

// Cells of heading and place of the source's middle, with the votes in each.
class MotionVotes {
 public:
  explicit MotionVotes(const std::vector<Upright>& target) {
    Eigen::Vector2d high = target.front().at;
    low_ = high;
    for (const Upright& upright : target) {
      low_ = low_.cwiseMin(upright.at);
      high = high.cwiseMax(upright.at);
    }
    low_.array() -= kMargin;
    const Eigen::Vector2d size = high - low_ + Eigen::Vector2d::Constant(kMargin);
    columns_ = std::min(kMostColumns, static_cast<int>(size.x() / kCell) + 1);
    rows_ = std::min(kMostColumns, static_cast<int>(size.y() / kCell) + 1);
    votes_.resize(static_cast<std::size_t>(kHeadings * columns_ * rows_));
  }
  void cast(double yaw, const Eigen::Vector2d& middle) {
    const int column = static_cast<int>(std::floor((middle.x() - low_.x()) / kCell));
    const int row = static_cast<int>(std::floor((middle.y() - low_.y()) / kCell));
    if (column < 0 || row < 0 || column >= columns_ || row >= rows_) return;
    const double turns = yaw / (2.0 * M_PI);
    const int heading = static_cast<int>((turns - std::floor(turns)) * kHeadings) % kHeadings;
    ++votes_[index(heading, row, column)];
  }
  // The middles of the cells that hold more votes, with their neighbours, than any neighbour does.
  [[nodiscard]] std::vector<PlaneStart> fullest(std::size_t most) const;

 private:
  [[nodiscard]] std::size_t index(int heading, int row, int column) const {
    return static_cast<std::size_t>((heading * rows_ + row) * columns_ + column);
  }
  [[nodiscard]] int around(int heading, int row, int column) const {
    int sum = 0;
    for (int dh = -1; dh <= 1; ++dh) {
      const int h = (heading + dh + kHeadings) % kHeadings;
      for (int r = std::max(row - 1, 0); r <= std::min(row + 1, rows_ - 1); ++r) {
        for (int c = std::max(column - 1, 0); c <= std::min(column + 1, columns_ - 1); ++c)
          sum += votes_[index(h, r, c)];
      }
    }
    return sum;
  }

  Eigen::Vector2d low_;
  int columns_ = 1;
  int rows_ = 1;
  std::vector<std::uint16_t> votes_;
};

std::vector<PlaneStart> MotionVotes::fullest(std::size_t most) const {
  struct Cell {
    int sum;
    int heading;
    int row;
    int column;
  };
  // Cells with the most votes of their own first: sums of neighbours are worked out for few.
  std::vector<std::size_t> of_votes(UINT16_MAX + 1U);
  for (const std::uint16_t votes : votes_)
    ++of_votes[votes];
  std::size_t least = UINT16_MAX;
  for (std::size_t count = 0; least > 1; --least) {
    count += of_votes[least];
    if (count > kCellsLookedAt) break;
  }
  std::vector<Cell> cells;
  for (int heading = 0; heading < kHeadings; ++heading) {
    for (int row = 0; row < rows_; ++row) {
      for (int column = 0; column < columns_; ++column) {
        if (votes_[index(heading, row, column)] > least)
          cells.push_back({around(heading, row, column), heading, row, column});
      }
    }
  }
  sort_stably(cells, [](const Cell& a, const Cell& b) { return a.sum > b.sum; });
  std::vector<Cell> kept;
  for (const Cell& cell : cells) {
    if (kept.size() >= most) break;
    const bool known = std::any_of(kept.begin(), kept.end(), [&](const Cell& other) {
      const int turn = std::abs(cell.heading - other.heading);
      return std::min(turn, kHeadings - turn) <= 1 && std::abs(cell.row - other.row) <= 1 &&
             std::abs(cell.column - other.column) <= 1;
    });
    if (!known) kept.push_back(cell);
  }
  std::vector<PlaneStart> starts;
  for (const Cell& cell : kept) {
    starts.push_back({(cell.heading + 0.5) * 2.0 * M_PI / kHeadings,
                      low_ + kCell * Eigen::Vector2d(cell.column + 0.5, cell.row + 0.5)});
  }
  return starts;
}

Eigen::Vector2d middle_of(const std::vector<Upright>& uprights) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (const Upright& upright : uprights)
    sum += upright.at;
  return sum / static_cast<double>(uprights.size());
}

std::vector<PlaneStart> starts_of(const std::vector<Upright>& target,
                                  const std::vector<Upright>& source) {
  const std::vector<UprightPair> targets = pairs_of(target);
  MotionVotes votes(target);
  const Eigen::Vector2d middle = middle_of(source);
  std::size_t first = 0;
  for (const UprightPair& pair : pairs_of(source)) {
    const auto tolerance = static_cast<float>(kLengthTolerance);
    while (first < targets.size() && targets[first].length < pair.length - tolerance)
      ++first;
    const Eigen::Vector2d a = source[static_cast<std::size_t>(pair.a)].at;
    const Eigen::Vector2d d = source[static_cast<std::size_t>(pair.b)].at - a;
    const double rise = source[static_cast<std::size_t>(pair.b)].ground_m -
                        source[static_cast<std::size_t>(pair.a)].ground_m;
    const double most_off = kRise + kRisePerM * pair.length;
    const Eigen::Vector2d to_middle = middle - a - 0.5 * d;
    for (std::size_t k = first; k < targets.size() && targets[k].length <= pair.length + tolerance;
         ++k) {
      const Upright& p = target[static_cast<std::size_t>(targets[k].a)];
      const Upright& q = target[static_cast<std::size_t>(targets[k].b)];
      const double climb = q.ground_m - p.ground_m;
      const Eigen::Vector2d e = q.at - p.at;
      const Eigen::Vector2d half = 0.5 * (p.at + q.at);
      const double yaw = static_cast<double>(targets[k].heading - pair.heading);
      // cos and sin of the yaw from the two directions: the lengths are nearly the same.
      const double scale = 1.0 / static_cast<double>(pair.length * targets[k].length);
      const double c = scale * d.dot(e);
      const double s = scale * (d.x() * e.y() - d.y() * e.x());
      const Eigen::Vector2d turned(c * to_middle.x() - s * to_middle.y(),
                                   s * to_middle.x() + c * to_middle.y());
      if (std::abs(climb - rise) < most_off) votes.cast(yaw, half + turned);
      if (std::abs(climb + rise) < most_off) votes.cast(yaw + M_PI, half - turned);
    }
  }
  return votes.fullest(kStarts);
}

// Of each source upright the target upright that it lies on: each is taken once, by the nearest.
struct Partner {
  double squared_m2;
  int source;
  int target;
};

std::vector<Partner> partners(const PlaneGrid& target, const std::vector<Upright>& source,
                              const Eigen::Isometry2d& motion, double reach_m) {
  std::vector<Partner> found;
  for (std::size_t i = 0; i < source.size(); ++i) {
    const Eigen::Vector2d at = motion * source[i].at;
    const auto nearest = target.nearest({at.x(), at.y(), 0.0}, reach_m, 0.0);
    if (nearest.index >= 0)
      found.push_back({nearest.squared_m2, static_cast<int>(i), nearest.index});
  }
  std::sort(found.begin(), found.end(), [](const Partner& a, const Partner& b) {
    return std::tie(a.squared_m2, a.source) < std::tie(b.squared_m2, b.source);
  });
  std::vector<bool> taken(target.points().size());
  std::erase_if(found, [&](const Partner& partner) {
    const bool again = taken[static_cast<std::size_t>(partner.target)];
    taken[static_cast<std::size_t>(partner.target)] = true;
    return again;
  });
  return found;
}

// The rigid motion in the plane with the least squares over the pairs.
Eigen::Isometry2d best_motion(const std::vector<Upright>& target,
                              const std::vector<Upright>& source,
                              const std::vector<Partner>& pairs) {
  Eigen::Vector2d p = Eigen::Vector2d::Zero();
  Eigen::Vector2d q = Eigen::Vector2d::Zero();
  for (const Partner& pair : pairs) {
    p += source[static_cast<std::size_t>(pair.source)].at;
    q += target[static_cast<std::size_t>(pair.target)].at;
  }
  p /= static_cast<double>(pairs.size());
  q /= static_cast<double>(pairs.size());
  double c = 0.0;
  double s = 0.0;
  for (const Partner& pair : pairs) {
    const Eigen::Vector2d a = source[static_cast<std::size_t>(pair.source)].at - p;
    const Eigen::Vector2d b = target[static_cast<std::size_t>(pair.target)].at - q;
    c += a.dot(b);
    s += a.x() * b.y() - a.y() * b.x();
  }
  Eigen::Isometry2d motion(Eigen::Rotation2Dd(std::atan2(s, c)));
  motion.pretranslate(q - motion.linear() * p);
  return motion;
}

UprightMatch fitted(const PlaneGrid& grid, const std::vector<Upright>& target,
                    const std::vector<Upright>& source, Eigen::Isometry2d motion) {
  std::vector<Partner> pairs;
  for (const double reach : kReaches) {
    pairs = partners(grid, source, motion, reach);
    if (pairs.size() < 2) return {};
    motion = best_motion(target, source, pairs);
  }
  pairs = partners(grid, source, motion, kReaches.back());
  std::vector<double> rises;
  for (const Partner& pair : pairs)
    rises.push_back(target[static_cast<std::size_t>(pair.target)].ground_m -
                    source[static_cast<std::size_t>(pair.source)].ground_m);
  if (rises.empty()) return {};
  const double rise = upper_median(rises);
  double level = 0.0;
  for (const double other : rises)
    level += std::abs(other - rise) < kSameRise ? 1.0 : kOtherRise;
  const double yaw = std::atan2(motion.linear()(1, 0), motion.linear()(0, 0));
  return {Pose(Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ())),
               {motion.translation().x(), motion.translation().y(), rise}),
          static_cast<int>(pairs.size()), level};
}

}  // namespace

std::vector<UprightMatch> match_uprights(const std::vector<Upright>& target,
                                         const std::vector<Upright>& source, std::size_t most) {
  if (target.size() < kFewest || source.size() < kFewest) return {};
  SparsePoints places;
  for (const Upright& upright : target)
    places.emplace_back(upright.at.x(), upright.at.y(), 0.0);
  const PlaneGrid grid(places);
  const Eigen::Vector2d middle = middle_of(source);
  std::vector<UprightMatch> matches;
  for (const PlaneStart& start : starts_of(target, source)) {
    Eigen::Isometry2d motion(Eigen::Rotation2Dd(start.yaw));
    motion.pretranslate(start.middle - motion.linear() * middle);
    const UprightMatch match = fitted(grid, target, source, motion);
    if (match.matched >= 2) matches.push_back(match);
  }
  sort_stably(matches,
              [](const UprightMatch& a, const UprightMatch& b) { return a.score > b.score; });
  std::vector<UprightMatch> kept;
  for (const UprightMatch& match : matches) {
    if (kept.size() >= most) break;
    const bool known = std::any_of(kept.begin(), kept.end(), [&](const UprightMatch& other) {
      const Pose step = other.target_from_source.inverse() * match.target_from_source;
      return step.angle() < kSameTurn && step.translation().norm() < kSamePlace;
    });
    if (!known) kept.push_back(match);
  }
  return kept;
}

}  // namespace understory
