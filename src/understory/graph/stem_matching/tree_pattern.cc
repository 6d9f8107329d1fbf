#include "understory/graph/stem_matching/tree_pattern.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <unordered_map>

#include "understory/graph/graph_constants.h"
#include "understory/util/error.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

using namespace graph_constants::tree_pattern;

// The place that one matched triangle speaks for, as a cell of yaw and position.
struct Cell {
  int place, yaw, x, y;
  bool operator==(const Cell& other) const = default;
};
struct CellHash {
  std::size_t operator()(const Cell& cell) const {
    std::uint64_t h = static_cast<std::uint32_t>(cell.place);
    for (const int part : {cell.yaw, cell.x, cell.y})
      h = (h ^ static_cast<std::uint32_t>(part)) * 0x9E3779B97F4A7C15ULL + (h >> 29);
    return h;
  }
};
struct Votes {
  int count = 0;
  double sin = 0.0, cos = 0.0;
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
};

}  // namespace

void describe(ConfigTable& table, TreePatternConfig& config) {
  table.add("neighbours", config.neighbours, {2, 20}, "",
            "a triangle is a stem and two of so many nearest stems");
  table.add("longest_side", config.longest_side, {0.5, 20.0}, "stem spacings",
            "longest side of a triangle");
  table.add("tolerance", config.tolerance, {0.005, 0.5}, "stem spacings",
            "largest difference of sides and heights of two equal triangles");
  table.add("vote_cell", config.vote_cell, {0.1, 10.0}, "stem spacings",
            "triangles whose places differ by less vote together");
  table.add("triangles", config.triangles, {10, 100'000}, "",
            "number of triangles of a view that are looked up, about");
  table.add("candidates", config.candidates, {1, 50}, "",
            "number of places that are verified by matching");
}

// Sets of a stem and two of its neighbours, each set once.
std::vector<std::array<int, 3>> TreePatterns::corner_sets(const SparsePoints& points) const {
  const double longest = config_.longest_side * l0_m_;
  const PlaneGrid grid(points);
  std::vector<std::array<int, 3>> sets;
  std::vector<std::pair<double, int>> near;
  for (std::size_t i = 0; i < points.size(); ++i) {
    near.clear();
    grid.around(points[i], longest, [&](int k) {
      const double d = (points[static_cast<std::size_t>(k)] - points[i]).head<2>().norm();
      if (d >= kShortestSide * l0_m_ && d <= longest) near.emplace_back(d, k);
    });
    const std::size_t keep = std::min(near.size(), static_cast<std::size_t>(config_.neighbours));
    std::partial_sort(near.begin(), near.begin() + static_cast<std::ptrdiff_t>(keep), near.end());
    for (std::size_t a = 0; a < keep; ++a) {
      for (std::size_t b = a + 1; b < keep; ++b) {
        std::array<int, 3> set = {static_cast<int>(i), near[a].second, near[b].second};
        std::sort(set.begin(), set.end());
        sets.push_back(set);
      }
    }
  }
  std::sort(sets.begin(), sets.end());
  sets.erase(std::unique(sets.begin(), sets.end()), sets.end());
  return sets;
}

// Corners in the order of the sides they face, longest first: the same for the same three stems.
std::vector<TreePatterns::Triangle> TreePatterns::triangles_of(const SparsePoints& points) const {
  std::vector<Triangle> result;
  for (const std::array<int, 3>& set : corner_sets(points)) {
    std::array<std::pair<double, int>, 3> facing;
    for (std::size_t k = 0; k < 3; ++k) {
      const Eigen::Vector3d& a = points[static_cast<std::size_t>(set[(k + 1) % 3])];
      const Eigen::Vector3d& b = points[static_cast<std::size_t>(set[(k + 2) % 3])];
      facing[k] = {-(a - b).head<2>().norm(), set[k]};
    }
    std::sort(facing.begin(), facing.end());
    const double gap =
        std::min(facing[1].first - facing[0].first, facing[2].first - facing[1].first);
    // Sides that are hard to tell apart give no order, too long ones no neighbourhood.
    if (-facing[0].first > config_.longest_side * l0_m_ ||
        -facing[2].first < kShortestSide * l0_m_ || gap < config_.tolerance * l0_m_)
      continue;
    Triangle triangle;
    for (std::size_t k = 0; k < 3; ++k) {
      triangle.corner[k] = facing[k].second;
      triangle.shape[k] = -facing[k].first;
    }
    const auto at = [&](std::size_t k) -> const Eigen::Vector3d& {
      return points[static_cast<std::size_t>(triangle.corner[k])];
    };
    triangle.shape[3] = at(1).z() - at(0).z();
    triangle.shape[4] = at(2).z() - at(0).z();
    const Eigen::Vector2d u = (at(1) - at(0)).head<2>();
    const Eigen::Vector2d v = (at(2) - at(0)).head<2>();
    triangle.clockwise = u.x() * v.y() - u.y() * v.x() < 0.0;
    result.push_back(triangle);
  }
  return result;
}

std::uint64_t TreePatterns::key_of(const std::array<int, 5>& cell, bool clockwise) {
  std::uint64_t key = clockwise ? 1 : 0;
  for (const int part : cell)
    key = key * 1024 + static_cast<std::uint64_t>(std::clamp(part + 512, 0, 1023));
  key ^= key >> 31;
  key *= 0x9E3779B97F4A7C15ULL;
  return key ^ (key >> 29);
}

void TreePatterns::add(int id, const SparsePoints& level_points) {
  UNDERSTORY_CHECK(places_.empty() || places_.back().id < id);
  const double width = 2.0 * config_.tolerance * l0_m_;
  Place place;
  place.id = id;
  for (const Eigen::Vector3d& point : level_points)
    place.points.push_back(point.cast<float>());
  if (level_points.size() <= kMostStems) {
    for (const Triangle& triangle : triangles_of(level_points)) {
      std::array<int, 5> cell{};
      for (std::size_t k = 0; k < 5; ++k)
        cell[k] = static_cast<int>(std::floor(triangle.shape[k] / width));
      Entry entry;
      entry.key = key_of(cell, triangle.clockwise);
      entry.place = static_cast<std::int32_t>(places_.size());
      for (std::size_t k = 0; k < 3; ++k)
        entry.corner[k] = static_cast<std::uint16_t>(triangle.corner[k]);
      for (std::size_t k = 0; k < 5; ++k)
        entry.shape[k] = static_cast<float>(triangle.shape[k]);
      entries_.push_back(entry);
    }
  }
  places_.push_back(std::move(place));
}

void TreePatterns::finish() {
  sort_stably(entries_, [](const Entry& a, const Entry& b) { return a.key < b.key; });
  first_.assign((1U << 16) + 1, 0);
  for (const Entry& entry : entries_)
    ++first_[(entry.key >> 48) + 1];
  for (std::size_t k = 1; k < first_.size(); ++k)
    first_[k] += first_[k - 1];
}

// Votes of the library's triangles that are the query's triangle.
class TreePatterns::Poll {
 public:
  Poll(const TreePatterns& patterns, int before)
      : patterns_(patterns),
        before_(before),
        tolerance_(patterns.config_.tolerance * patterns.l0_m_),
        cell_m_(patterns.config_.vote_cell * patterns.l0_m_) {}

  void ask(const Triangle& triangle, const SparsePoints& query) {
    const auto q = [&](std::size_t k) -> const Eigen::Vector3d& {
      return query[static_cast<std::size_t>(triangle.corner[k])];
    };
    const Eigen::Vector2d side = (q(1) - q(0)).head<2>();
    const Eigen::Vector3d middle = (q(0) + q(1) + q(2)) / 3.0;
    // The cell that holds each number and the nearer one of its neighbours.
    std::array<int, 5> first{};
    for (std::size_t k = 0; k < 5; ++k)
      first[k] = static_cast<int>(std::floor(triangle.shape[k] / (2.0 * tolerance_) - 0.5));
    for (unsigned probe = 0; probe < 32; ++probe) {
      std::array<int, 5> cell = first;
      for (std::size_t k = 0; k < 5; ++k)
        cell[k] += static_cast<int>((probe >> k) & 1U);
      const std::uint64_t key = patterns_.key_of(cell, triangle.clockwise);
      const auto& entries = patterns_.entries_;
      auto entry = entries.begin() + patterns_.first_[key >> 48];
      while (entry != entries.end() && entry->key < key)
        ++entry;
      for (; entry != entries.end() && entry->key == key; ++entry) {
        // Entries of a key are in the order of their places.
        if (patterns_.places_[static_cast<std::size_t>(entry->place)].id >= before_) break;
        count(*entry, triangle, side, middle);
      }
    }
  }

  [[nodiscard]] std::vector<PatternCandidate> result() const {
    std::vector<PatternCandidate> result;
    for (const auto& [cell, vote] : votes_) {
      if (vote.count < kFewestVotes) continue;
      const Eigen::AngleAxisd yaw(std::atan2(vote.sin, vote.cos), Eigen::Vector3d::UnitZ());
      result.push_back(
          {cell.place, Pose(Eigen::Quaterniond(yaw), vote.shift / vote.count), vote.count});
    }
    return result;
  }

 private:
  void count(const Entry& entry, const Triangle& triangle, const Eigen::Vector2d& side,
             const Eigen::Vector3d& middle) {
    for (std::size_t k = 0; k < 5; ++k) {
      if (std::abs(static_cast<double>(entry.shape[k]) - triangle.shape[k]) > tolerance_) return;
    }
    const Place& place = patterns_.places_[static_cast<std::size_t>(entry.place)];
    const Eigen::Vector3d p0 = place.points[entry.corner[0]].cast<double>();
    const Eigen::Vector3d p1 = place.points[entry.corner[1]].cast<double>();
    const Eigen::Vector3d p2 = place.points[entry.corner[2]].cast<double>();
    const Eigen::Vector2d to = (p1 - p0).head<2>();
    const double yaw = std::atan2(side.x() * to.y() - side.y() * to.x(), side.dot(to));
    const double s = std::sin(yaw);
    const double c = std::cos(yaw);
    const Eigen::Vector3d turned(c * middle.x() - s * middle.y(), s * middle.x() + c * middle.y(),
                                 middle.z());
    const Eigen::Vector3d shift = (p0 + p1 + p2) / 3.0 - turned;
    const int yaw_cell = static_cast<int>(std::lround(yaw / (2.0 * M_PI) * kYawCells));
    Votes& vote = votes_[{entry.place, (yaw_cell + kYawCells) % kYawCells,
                          static_cast<int>(std::floor(shift.x() / cell_m_)),
                          static_cast<int>(std::floor(shift.y() / cell_m_))}];
    ++vote.count;
    vote.sin += s;
    vote.cos += c;
    vote.shift += shift;
  }

  const TreePatterns& patterns_;
  int before_;
  double tolerance_;
  double cell_m_;
  std::unordered_map<Cell, Votes, CellHash> votes_;
};

std::vector<PatternCandidate> TreePatterns::find(const SparsePoints& level_points,
                                                 int before) const {
  Poll poll(*this, before);
  // Evenly over the view; more would say no more.
  const std::vector<Triangle> triangles = triangles_of(level_points);
  const auto most = static_cast<std::size_t>(config_.triangles);
  const std::size_t stride = std::max<std::size_t>(1, triangles.size() / most);
  for (std::size_t i = 0; i < triangles.size(); i += stride)
    poll.ask(triangles[i], level_points);
  std::vector<PatternCandidate> result = poll.result();
  // A total order, whatever the order of the hash table.
  std::sort(result.begin(), result.end(), [](const PatternCandidate& a, const PatternCandidate& b) {
    if (a.votes != b.votes) return a.votes > b.votes;
    if (a.place != b.place) return a.place < b.place;
    const Eigen::Vector3d& p = a.place_from_query.translation();
    const Eigen::Vector3d& q = b.place_from_query.translation();
    return std::lexicographical_compare(p.data(), p.data() + 3, q.data(), q.data() + 3);
  });
  if (result.size() > static_cast<std::size_t>(config_.candidates))
    result.resize(static_cast<std::size_t>(config_.candidates));
  for (PatternCandidate& candidate : result)
    candidate.place = places_[static_cast<std::size_t>(candidate.place)].id;
  return result;
}

}  // namespace understory
