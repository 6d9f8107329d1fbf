#include "understory/georeference/trees/place_search.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <numbers>
#include <tuple>

#include "understory/georeference/georeference_constants.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

using namespace georeference_constants::tree_match;
using Eigen::Vector2d;

constexpr int kBlock = 8;   // cells along the side of a block, of which the best cell is kept
constexpr int kLevels = 7;  // steps of a score
constexpr int kBatch = 255 / kLevels;  // trees whose scores a byte can hold

// Sixteen cells in a register: most of the time goes into adding them up. GCC and clang know it.
using Cells = std::uint8_t __attribute__((vector_size(16)));
constexpr int kCells = 16;
constexpr int kRegisters = 8;
constexpr int kLane = kRegisters * kCells;  // cells that are summed at once

// The scores of one tree of the source over the target: one raster for each class of sizes.
struct ScoreRasters {
  Vector2d low = Vector2d::Zero();  // corner of cell 0, 0
  int columns = 0;
  int rows = 0;
  double step = 1.0;   // score of one level
  double least = 0.0;  // score of level 0
  std::vector<std::vector<std::uint8_t>> levels;
};

// Middle ranks of the classes of sizes: small, medium, large.
constexpr std::array<double, 3> kClassRanks{-1.0, 0.0, 1.0};

std::size_t class_of(double rank) {
  if (!std::isfinite(rank)) return kClassRanks.size();
  return rank < -0.5 ? 0 : rank > 0.5 ? 2 : 1;
}

// Adds the bell of each tree; `rank` is that of the class, NaN for any.
std::vector<float> bells(const PatternGrid& target, const ScoreRasters& frame, double sd_m,
                         const TreeLikeness& likeness, double rank) {
  std::vector<float> sums(
      static_cast<std::size_t>(frame.columns) * static_cast<std::size_t>(frame.rows), 0.0F);
  const int reach = static_cast<int>(std::ceil(3.0 * sd_m / kCellM));
  std::vector<double> along_x(static_cast<std::size_t>(2 * reach + 1));
  for (const PatternTree& tree : target.trees()) {
    const Vector2d cell = (tree.at - frame.low) / kCellM;
    if (!(cell.x() >= reach && cell.y() >= reach && cell.x() < frame.columns - reach &&
          cell.y() < frame.rows - reach))
      continue;
    const int column = static_cast<int>(cell.x());
    const int row = static_cast<int>(cell.y());
    const double peak =
        likeness.rank_ratio(rank, tree.rank) / (2.0 * std::numbers::pi * sd_m * sd_m);
    for (int k = -reach; k <= reach; ++k)
      along_x[static_cast<std::size_t>(k + reach)] =
          std::exp(-0.5 * std::pow((column + k + 0.5 - cell.x()) * kCellM / sd_m, 2.0));
    for (int k = -reach; k <= reach; ++k) {
      const double there =
          peak * std::exp(-0.5 * std::pow((row + k + 0.5 - cell.y()) * kCellM / sd_m, 2.0));
      float* line =
          &sums[static_cast<std::size_t>(row + k) * static_cast<std::size_t>(frame.columns) +
                static_cast<std::size_t>(column - reach)];
      for (std::size_t i = 0; i < along_x.size(); ++i)
        line[i] += static_cast<float>(there * along_x[i]);
    }
  }
  return sums;
}

std::vector<std::uint8_t> levels_of(const std::vector<float>& sums, const PatternGrid& target,
                                    const ScoreRasters& frame, double share) {
  std::vector<std::uint8_t> levels(sums.size());
  for (int row = 0; row < frame.rows; ++row) {
    for (int column = 0; column < frame.columns; ++column) {
      const std::size_t at =
          static_cast<std::size_t>(row) * static_cast<std::size_t>(frame.columns) +
          static_cast<std::size_t>(column);
      const double density = target.density(frame.low + kCellM * Vector2d(column + 0.5, row + 0.5));
      double score = 0.0;
      if (density > 0.0)
        score = std::log(1.0 - share + share * static_cast<double>(sums[at]) / density);
      const double level = std::round((score - frame.least) / frame.step);
      levels[at] = static_cast<std::uint8_t>(std::clamp(level, 0.0, 1.0 * kLevels));
    }
  }
  return levels;
}

// One heading: the trees' offsets in the rasters, and the best cells of all places.
class Heading {
 public:
  Heading(const std::vector<PatternTree>& source, const ScoreRasters& rasters,
          const SearchDisc& disc, double yaw_rad)
      : rasters_(rasters), disc_(disc), yaw_rad_(yaw_rad) {
    const PlaneMotion motion{yaw_rad, disc.middle};
    radius_cells_ = static_cast<int>(std::ceil(disc.radius_m / kCellM));
    for (const PatternTree& tree : source) {
      const Vector2d at = (motion * tree.at - rasters.low) / kCellM;
      const std::size_t size_class =
          rasters.levels.size() > 1 ? class_of(tree.rank) : std::size_t{0};
      offsets_.push_back(&rasters.levels[size_class][0] +
                         static_cast<std::ptrdiff_t>(std::floor(at.y())) * rasters.columns +
                         static_cast<std::ptrdiff_t>(std::floor(at.x())));
    }
  }

  // The best places of the disc, one of a block at most.
  [[nodiscard]] std::vector<PlaceCandidate> best(std::size_t most) {
    std::vector<Best> all;
    for (int row = -radius_cells_; row <= radius_cells_; ++row) {
      if ((row + radius_cells_) % kBlock == 0) keep(all);
      add_row(row);
    }
    keep(all);
    most = std::min(most, all.size());
    const auto better = [](const Best& a, const Best& b) {
      return std::tuple(-a.sum, a.row, a.column) < std::tuple(-b.sum, b.row, b.column);
    };
    std::partial_sort(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(most), all.end(),
                      better);
    std::vector<PlaceCandidate> result;
    for (std::size_t k = 0; k < most; ++k)
      result.push_back(
          {{yaw_rad_, disc_.middle + kCellM * Vector2d(all[k].column, all[k].row)},
           all[k].sum * rasters_.step + static_cast<double>(offsets_.size()) * rasters_.least});
    return result;
  }

 private:
  struct Best {
    int sum = -1;
    int row = 0;
    int column = 0;
  };

  void keep(std::vector<Best>& all) {
    for (const Best& block : blocks_)
      if (block.sum >= 0) all.push_back(block);
    blocks_.assign(static_cast<std::size_t>(2 * radius_cells_ / kBlock + 2), Best{});
  }

  // Scores of `kLane` places from a column on.
  void sum_lane(std::ptrdiff_t shift) {
    sums_.fill(0);
    for (std::size_t begin = 0; begin < offsets_.size(); begin += kBatch) {
      Cells total[kRegisters] = {};
      const std::size_t end = std::min(offsets_.size(), begin + kBatch);
      for (std::size_t i = begin; i < end; ++i) {
        const std::uint8_t* from = offsets_[i] + shift;
        for (int r = 0; r < kRegisters; ++r) {
          Cells cells;
          std::memcpy(&cells, from + r * kCells, sizeof(cells));
          total[r] += cells;
        }
      }
      std::array<std::uint8_t, kLane> bytes{};
      std::memcpy(bytes.data(), total, sizeof(total));
      for (std::size_t k = 0; k < kLane; ++k)
        sums_[k] = static_cast<std::uint16_t>(sums_[k] + bytes[k]);
    }
  }

  void add_row(int row) {
    const double chord = std::sqrt(std::max(
        0.0, static_cast<double>(radius_cells_) * radius_cells_ - static_cast<double>(row) * row));
    const int reach = static_cast<int>(chord);
    for (int column = -reach; column <= reach; column += kLane) {
      sum_lane(static_cast<std::ptrdiff_t>(row) * rasters_.columns + column);
      const int count = std::min(kLane, reach - column + 1);
      for (int k = 0; k < count; ++k) {
        const int sum = sums_[static_cast<std::size_t>(k)];
        Best& best = blocks_[static_cast<std::size_t>((column + k + radius_cells_) / kBlock)];
        if (sum > best.sum) best = {sum, row, column + k};
      }
    }
  }

  const ScoreRasters& rasters_;
  const SearchDisc& disc_;
  double yaw_rad_;
  int radius_cells_ = 0;
  std::vector<const std::uint8_t*> offsets_;
  std::vector<Best> blocks_;
  std::array<std::uint16_t, kLane> sums_{};
};

ScoreRasters rasters_of(const PatternGrid& target, const SearchDisc& disc, double reach_m,
                        const TreeLikeness& likeness, bool sizes) {
  ScoreRasters rasters;
  // A lane may reach beyond the disc, and a bell beyond its cell.
  const double margin = reach_m + kLane * kCellM + 4.0 * kSearchSdM + 2.0 * kCellM;
  rasters.low = disc.middle - Vector2d::Constant(disc.radius_m + margin);
  rasters.columns = rasters.rows =
      static_cast<int>(std::ceil(2.0 * (disc.radius_m + margin) / kCellM)) + 1;
  rasters.least = std::log(1.0 - likeness.share);
  rasters.step = (kMostScore - rasters.least) / kLevels;
  const double sd = std::hypot(likeness.sd_m, kSearchSdM);
  for (const double rank : kClassRanks) {
    if (sizes)
      rasters.levels.push_back(
          levels_of(bells(target, rasters, sd, likeness, rank), target, rasters, likeness.share));
  }
  const double any = std::numeric_limits<double>::quiet_NaN();
  rasters.levels.push_back(
      levels_of(bells(target, rasters, sd, likeness, any), target, rasters, likeness.share));
  return rasters;
}

double angle_between(double a, double b) {
  return std::abs(std::remainder(a - b, 2.0 * std::numbers::pi));
}

// Best first; of those that are nearly the same pose the best.
std::vector<PlaceCandidate> apart(std::vector<PlaceCandidate> all, double yaw_step) {
  std::sort(all.begin(), all.end(), [](const PlaceCandidate& a, const PlaceCandidate& b) {
    const auto key = [](const PlaceCandidate& c) {
      return std::tuple(-c.score, c.target_from_source.yaw_rad, c.target_from_source.at.y(),
                        c.target_from_source.at.x());
    };
    return key(a) < key(b);
  });
  std::vector<PlaceCandidate> kept;
  for (const PlaceCandidate& candidate : all) {
    const PlaneMotion& motion = candidate.target_from_source;
    const bool known = std::any_of(kept.begin(), kept.end(), [&](const PlaceCandidate& other) {
      return (other.target_from_source.at - motion.at).norm() < kApartM &&
             angle_between(other.target_from_source.yaw_rad, motion.yaw_rad) <
                 kApartTurns * yaw_step;
    });
    if (!known) kept.push_back(candidate);
    if (kept.size() >= kCandidates) break;
  }
  return kept;
}

}  // namespace

Eigen::Matrix2d PlaneMotion::rotation() const {
  return Eigen::Rotation2Dd(yaw_rad).toRotationMatrix();
}

Vector2d PlaneMotion::operator*(const Vector2d& point_in_source) const {
  return at + rotation() * point_in_source;
}

double TreeLikeness::rank_ratio(double source_rank, double target_rank) const {
  const double r = rank_correlation;
  if (!(r > 0.0) || !std::isfinite(source_rank) || !std::isfinite(target_rank)) return 1.0;
  const double rest = 1.0 - r * r;
  const double u = source_rank;
  const double v = target_rank;
  const double exponent = (r * r * (u * u + v * v) - 2.0 * r * u * v) / (2.0 * rest);
  return kStrangeSizes + (1.0 - kStrangeSizes) * std::exp(-exponent) / std::sqrt(rest);
}

PlaceSearch search_places(const std::vector<PatternTree>& source, const PatternGrid& target,
                          const SearchDisc& disc, const TreeLikeness& likeness,
                          const ProgressSink& progress) {
  double reach = 0.0;
  double spread = 0.0;
  bool sizes = false;
  for (const PatternTree& tree : source) {
    reach = std::max(reach, tree.at.norm());
    spread += tree.at.squaredNorm() / static_cast<double>(source.size());
    sizes = sizes || (likeness.rank_correlation > 0.0 && std::isfinite(tree.rank));
  }
  spread = std::max(1.0, std::sqrt(spread));
  const ScoreRasters rasters = rasters_of(target, disc, reach, likeness, sizes);
  const auto headings = static_cast<std::size_t>(
      std::ceil(2.0 * std::numbers::pi * std::max(kTurnReach * reach, spread) / kTurnM));
  const double step = 2.0 * std::numbers::pi / static_cast<double>(headings);
  std::vector<std::vector<PlaceCandidate>> found(headings);
  parallel_for(headings, 1, [&](std::size_t k) {
    progress.poll();
    found[k] = Heading(source, rasters, disc, step * static_cast<double>(k)).best(kOfHeading);
  });
  std::vector<PlaceCandidate> all;
  for (const std::vector<PlaceCandidate>& some : found)
    all.insert(all.end(), some.begin(), some.end());
  PlaceSearch result;
  result.candidates = apart(std::move(all), step);
  const double apart_m = 2.0 * likeness.sd_m;
  result.poses =
      std::max(1.0, std::numbers::pi * disc.radius_m * disc.radius_m / (apart_m * apart_m)) *
      (2.0 * std::numbers::pi * spread / apart_m);
  return result;
}

}  // namespace understory
