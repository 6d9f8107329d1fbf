#include "understory/registration/icp/apart_points.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "understory/geometry/voxel_key.h"
#include "understory/registration/cell_blocks.h"
#include "understory/util/error.h"
#include "understory/util/parallel.h"

namespace understory::internal {
namespace {

// The surface of a cube is that of the points up to so many cubes away.
constexpr int kSurroundings = 2;
// Blocks whose surfaces are worked out at a time: their sums are in memory together.
constexpr std::size_t kBatch = 4096;
// Blocks that one piece of parallel work takes.
constexpr std::size_t kTogether = 32;
// Cubes have fewer points than that; with more their surfaces stay.
constexpr std::uint32_t kMostCounted = 100'000;
// Arrays of a block grow by an eighth, so that little of them is empty.
constexpr std::size_t kGrowth = 8;

std::uint64_t key_of(const std::array<int, 3>& block) {
  return voxel_key(block[0], block[1], block[2]);
}

template <typename Value>
void insert_at(std::vector<Value>& values, std::size_t place, const Value& value) {
  if (values.size() == values.capacity())
    values.reserve(values.size() + std::max<std::size_t>(4, values.size() / kGrowth));
  values.insert(values.begin() + static_cast<std::ptrdiff_t>(place), value);
}

// Which cubes of a block are near one, the block being `step` (-1 to 1 along each axis) from its
// own.
std::uint64_t near_cubes(const std::array<int, 3>& cube, const std::array<int, 3>& step,
                         int reach) {
  std::uint64_t near = ~std::uint64_t{0};
  for (std::size_t axis = 0; axis < 3; ++axis)
    near &= kNearAlongAxis.of[axis][reach][cube[axis] & 3][step[axis] + 1];
  return near;
}

Eigen::Vector3f cubes_between(const std::array<int, 3>& from, const std::array<int, 3>& to) {
  return {static_cast<float>(to[0] - from[0]), static_cast<float>(to[1] - from[1]),
          static_cast<float>(to[2] - from[2])};
}

}  // namespace

// The cubes of a block and those up to two beside it, 8 x 8 x 8. Sums over the 5 x 5 x 5 cubes
// around one are made along one axis after the other.
class ApartPoints::SumsAround {
 public:
  void clear() { std::fill(cells_.begin(), cells_.end(), Sums::Zero()); }
  // `cube`: from the block's first one. What lies farther off is left out.
  void put(const Place& cube, const SurfaceSums& from_centre, double cube_m) {
    std::array<std::size_t, 3> at{};
    Eigen::Vector3d step;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const int shifted = cube[axis] + kSurroundings;
      if (shifted < 0 || shifted >= static_cast<int>(kEdge)) return;
      at[axis] = static_cast<std::size_t>(shifted);
      step[static_cast<Eigen::Index>(axis)] = cube_m * (cube[axis] - 1.5);
    }
    const auto n = static_cast<double>(from_centre.count);
    const Eigen::Vector3d sum = from_centre.sum.cast<double>();
    const Eigen::Matrix3d mixed = sum * step.transpose();
    const Eigen::Matrix3d products = from_centre.products.cast<double>() + mixed +
                                     mixed.transpose() + n * step * step.transpose();
    const Eigen::Vector3d moved = sum + n * step;
    cells_[at[0] + kEdge * (at[1] + kEdge * at[2])] << n, moved, products(0, 0), products(0, 1),
        products(0, 2), products(1, 1), products(1, 2), products(2, 2), 0.0, 0.0;
  }
  // Afterwards the first 4 x 4 x 4 cells are those of the block's cubes.
  void add_up() {
    for (std::size_t z = 0; z < kEdge; ++z) {
      for (std::size_t y = 0; y < kEdge; ++y)
        add_along(kEdge * (y + kEdge * z), 1);
      for (std::size_t x = 0; x < 4; ++x)
        add_along(x + kEdge * kEdge * z, kEdge);
    }
    for (std::size_t y = 0; y < 4; ++y) {
      for (std::size_t x = 0; x < 4; ++x)
        add_along(x + kEdge * y, kEdge * kEdge);
    }
  }
  // Around the mean of the neighbourhood of a cube.
  [[nodiscard]] SurfaceSums of(int bit) const {
    const auto b = static_cast<std::size_t>(bit);
    const Sums& at = cells_[(b & 3) + kEdge * ((b >> 2 & 3) + kEdge * (b >> 4))];
    SurfaceSums sums;
    sums.count = static_cast<std::size_t>(at[0]);
    Eigen::Matrix3d products;
    products << at[4], at[5], at[6], at[5], at[7], at[8], at[6], at[8], at[9];
    const Eigen::Vector3d sum = at.segment<3>(1).matrix();
    sums.products = (products - sum * sum.transpose() / std::max(1.0, at[0])).cast<float>();
    return sums;
  }

 private:
  static constexpr std::size_t kEdge = 4 + 2 * kSurroundings;
  // Count, sum, products; as long as whole vectors of the processor.
  using Sums = Eigen::Array<double, 12, 1>;

  // Each of four cells along an axis becomes the sum of itself and the four after it.
  void add_along(std::size_t first, std::size_t stride) {
    for (std::size_t i = first; i < first + 4 * stride; i += stride) {
      cells_[i] += cells_[i + stride] + cells_[i + 2 * stride] + cells_[i + 3 * stride] +
                   cells_[i + 4 * stride];
    }
  }

  std::vector<Sums> cells_ = std::vector<Sums>(kEdge * kEdge * kEdge);
};

ApartPoints::Gaps::Gaps(float edge_m, const Eigen::Vector3f& from_centre) : squared{} {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const float at = from_centre[static_cast<Eigen::Index>(axis)];
    for (int step = 1; step <= 4; ++step) {
      const float to_face = (static_cast<float>(step) - 0.5F) * edge_m;
      const float up = std::max(0.0F, to_face - at);
      const float down = std::max(0.0F, to_face + at);
      squared[axis][static_cast<std::size_t>(4 + step)] = up * up;
      squared[axis][static_cast<std::size_t>(4 - step)] = down * down;
    }
  }
}

ApartPoints::ApartPoints(const IcpMapConfig& config)
    : config_(config),
      step_m_(static_cast<float>(config.cube_m) / kSteps),
      lowest_(
          Eigen::Vector3f::Constant(0.5F * step_m_ - 0.5F * static_cast<float>(config.cube_m))) {
  UNDERSTORY_CHECK(config.epsilon_m > 0.0 && config.epsilon_m <= config.cube_m);
  for (std::uint32_t count = 1; count < kMostCounted;) {
    due_.push_back(count);
    const double grown = std::ceil((1.0 + config.growth) * static_cast<double>(count));
    count = std::max(count + 1, static_cast<std::uint32_t>(grown));
  }
}

ApartPoints::Packed ApartPoints::packed(const Eigen::Vector3f& from_centre) const {
  Packed point;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const Eigen::Index k = static_cast<Eigen::Index>(axis);
    const float steps = std::round((from_centre[k] - lowest_[k]) / step_m_);
    point.steps[axis] = static_cast<std::uint16_t>(std::clamp(steps, 0.0F, kSteps - 1.0F));
  }
  return point;
}

void ApartPoints::Cube::set(const SurfacePatch& patch) {
  surface = patch.surface;
  for (std::size_t axis = 0; axis < 3; ++axis)
    direction[axis] = static_cast<std::int16_t>(
        std::lround(kUnit * patch.direction[static_cast<Eigen::Index>(axis)]));
}

std::uint32_t ApartPoints::find(const Place& block) const {
  return index_.find(key_of(block));
}

ApartPoints::Block& ApartPoints::find_or_add(const Place& block) {
  const std::uint32_t found = find(block);
  if (found != kNone) return blocks_[found];
  UNDERSTORY_CHECK(blocks_.size() < kNone / kCubes);
  index_.set(key_of(block), static_cast<std::uint32_t>(blocks_.size()));
  blocks_.emplace_back().at = block;
  return blocks_.back();
}

void ApartPoints::mark_changed(Block& block, std::uint64_t cubes) {
  if (block.changed == 0) changed_.push_back(block.at);
  block.changed |= cubes;
}

template <typename Least, typename Act>
void ApartPoints::for_each_near(const Place& cube, int reach, const Gaps& gaps, const Least& least,
                                const Act& act) const {
  const Place own = block_of(cube);
  // To the nearest cube of the block before, of the own, of the one after.
  std::array<std::array<int, 3>, 3> first{};
  for (std::size_t axis = 0; axis < 3; ++axis)
    first[axis] = {-(cube[axis] & 3) - 1, 0, 4 - (cube[axis] & 3)};
  constexpr std::array<int, 3> kOrder = {0, -1, 1};  // the own block first
  for (const int z : kOrder) {
    const int near_z = first[2][static_cast<std::size_t>(z + 1)];
    if (std::abs(near_z) > reach) continue;
    for (const int y : kOrder) {
      const int near_y = first[1][static_cast<std::size_t>(y + 1)];
      if (std::abs(near_y) > reach) continue;
      for (const int x : kOrder) {
        const int near_x = first[0][static_cast<std::size_t>(x + 1)];
        if (std::abs(near_x) > reach || gaps.to(near_x, near_y, near_z) >= least()) continue;
        const std::uint32_t number = find({own[0] + x, own[1] + y, own[2] + z});
        if (number == kNone) continue;
        act(number, blocks_[number].present & near_cubes(cube, {x, y, z}, reach));
      }
    }
  }
}

NearestTwo ApartPoints::nearest(const Place& at, const Eigen::Vector3f& from_centre,
                                int reach) const {
  const auto edge = static_cast<float>(config_.cube_m);
  constexpr float kFar = std::numeric_limits<float>::infinity();
  NearestTwo found{kFar, kFar, 0, 0};
  const Gaps gaps(edge, from_centre);
  const auto look = [&](std::uint32_t number, int bit) {
    const Block& block = blocks_[number];
    const std::size_t rank = rank_of(block, bit);
    const Eigen::Vector3f from = from_centre - edge * cubes_between(at, cube_at(block, bit));
    const std::uint32_t end = block.cubes[rank].end;
    for (std::uint32_t i = begin_of(block, rank); i < end; ++i) {
      const float squared = (from - unpacked(block.points[i])).squaredNorm();
      if (squared < found.best) {
        found = {squared, found.best, number * kCubes + static_cast<std::uint32_t>(bit), i};
      } else {
        found.second = std::min(found.second, squared);
      }
    }
  };
  for_each_near(
      at, reach, gaps, [&] { return found.second; },
      [&](std::uint32_t number, std::uint64_t near) {
        const Block& block = blocks_[number];
        const int own = block.at == block_of(at) ? bit_of(at) : -1;
        if (own >= 0 && (near >> own & 1) != 0) {
          look(number, own);
          near &= ~(std::uint64_t{1} << own);
        }
        for (std::uint64_t left = near; left != 0; left &= left - 1) {
          const int bit = std::countr_zero(left);
          const Place cube = cube_at(block, bit);
          if (gaps.to(cube[0] - at[0], cube[1] - at[1], cube[2] - at[2]) < found.second)
            look(number, bit);
        }
      });
  return found;
}

bool ApartPoints::is_apart(const Place& at, const Eigen::Vector3f& from_centre) const {
  const auto edge = static_cast<float>(config_.cube_m);
  const float least = static_cast<float>(config_.epsilon_m) * static_cast<float>(config_.epsilon_m);
  const Gaps gaps(edge, from_centre);
  bool apart = true;
  for_each_near(
      at, 1, gaps,
      // What lies on a face counts as within, whatever rounding does.
      [&] { return apart ? 1.001F * least : 0.0F; },
      [&](std::uint32_t number, std::uint64_t near) {
        const Block& block = blocks_[number];
        for (std::uint64_t left = near; left != 0 && apart; left &= left - 1) {
          const int bit = std::countr_zero(left);
          const Place cube = cube_at(block, bit);
          if (gaps.to(cube[0] - at[0], cube[1] - at[1], cube[2] - at[2]) >= 1.001F * least)
            continue;
          const std::size_t rank = rank_of(block, bit);
          const Eigen::Vector3f from = from_centre - edge * cubes_between(at, cube);
          const std::uint32_t end = block.cubes[rank].end;
          for (std::uint32_t i = begin_of(block, rank); i < end && apart; ++i)
            apart = (from - unpacked(block.points[i])).squaredNorm() > least;
        }
      });
  return apart;
}

bool ApartPoints::insert(const Place& cube, const Eigen::Vector3f& from_centre) {
  if (!is_apart(cube, from_centre)) return false;
  Block& block = find_or_add(block_of(cube));
  const std::uint64_t bit = std::uint64_t{1} << bit_of(cube);
  const std::size_t rank = rank_of(block, bit_of(cube));
  if ((block.present & bit) == 0) {
    Cube added;
    added.end = begin_of(block, rank);
    insert_at(block.cubes, rank, added);
    if (config_.covariances)
      insert_at<Eigen::Matrix3f>(block.covariances, rank, Eigen::Matrix3f::Constant(-1.0F));
    block.present |= bit;
    ++cubes_;
  }
  insert_at(block.points, block.cubes[rank].end, packed(from_centre));
  for (std::size_t i = rank; i < block.cubes.size(); ++i)
    ++block.cubes[i].end;
  ++size_;
  const std::uint32_t count = block.cubes[rank].end - begin_of(block, rank);
  if (std::binary_search(due_.begin(), due_.end(), count)) mark_changed(block, bit);
  return true;
}

void ApartPoints::drop_cubes(Block& block, std::uint64_t cubes) {
  Block kept;
  std::size_t rank = 0;
  for (std::uint64_t left = block.present; left != 0; left &= left - 1, ++rank) {
    if ((cubes >> std::countr_zero(left) & 1) != 0) continue;
    const auto begin = block.points.begin() + begin_of(block, rank);
    const auto end = block.points.begin() + block.cubes[rank].end;
    kept.points.insert(kept.points.end(), begin, end);
    kept.cubes.push_back(block.cubes[rank]);
    kept.cubes.back().end = static_cast<std::uint32_t>(kept.points.size());
    if (config_.covariances) kept.covariances.push_back(block.covariances[rank]);
  }
  size_ -= block.points.size() - kept.points.size();
  cubes_ -= block.cubes.size() - kept.cubes.size();
  mark_changed(block, block.present & cubes);
  block.present &= ~cubes;
  block.points = std::vector<Packed>(kept.points.begin(), kept.points.end());
  block.cubes = std::vector<Cube>(kept.cubes.begin(), kept.cubes.end());
  block.covariances = std::move(kept.covariances);
}

void ApartPoints::remove_beyond(const Eigen::Vector3d& center, double radius_m) {
  const double half_diagonal_m = 2.0 * std::sqrt(3.0) * config_.cube_m;
  for (Block& block : blocks_) {
    const Eigen::Vector3d middle =
        4.0 * config_.cube_m *
        (Eigen::Vector3d(block.at[0], block.at[1], block.at[2]) + Eigen::Vector3d::Constant(0.5));
    if ((middle - center).norm() + half_diagonal_m <= radius_m) continue;
    std::uint64_t far = 0;
    for (std::uint64_t left = block.present; left != 0; left &= left - 1) {
      const int bit = std::countr_zero(left);
      if ((centre_of(cube_at(block, bit)) - center).squaredNorm() > radius_m * radius_m)
        far |= std::uint64_t{1} << bit;
    }
    if (far != 0) drop_cubes(block, far);
  }
}

// The last block takes the place of the one dropped.
void ApartPoints::drop_block(std::uint32_t number) {
  index_.erase(key_of(blocks_[number].at));
  if (number + 1 != blocks_.size()) {
    blocks_[number] = std::move(blocks_.back());
    index_.set(key_of(blocks_[number].at), number);
  }
  blocks_.pop_back();
}

std::array<std::uint32_t, 27> ApartPoints::around(const Block& block) const {
  std::array<std::uint32_t, 27> numbers{};
  for (int step = 0; step < 27; ++step)
    numbers[static_cast<std::size_t>(step)] = find(
        {block.at[0] + step % 3 - 1, block.at[1] + step / 3 % 3 - 1, block.at[2] + step / 9 - 1});
  return numbers;
}

// Blocks with a change in them or beside them.
std::vector<std::uint32_t> ApartPoints::touched() {
  std::vector<std::uint32_t> numbers;
  ++visit_;
  for (const Place& place : changed_) {
    const std::uint32_t changed = find(place);
    for (const std::uint32_t number : around(blocks_[changed])) {
      if (number == kNone || blocks_[number].visit == visit_) continue;
      blocks_[number].visit = visit_;
      numbers.push_back(number);
    }
  }
  return numbers;
}

// Of the blocks of a batch and those beside them.
ApartPoints::CubeSums ApartPoints::sums_of(const std::uint32_t* begin,
                                           const std::uint32_t* end) const {
  CubeSums of;
  of.first.assign(blocks_.size(), kNone);
  std::uint32_t cubes = 0;
  for (const std::uint32_t* touched = begin; touched != end; ++touched) {
    for (const std::uint32_t number : around(blocks_[*touched])) {
      if (number == kNone || of.first[number] != kNone) continue;
      of.first[number] = cubes;
      of.blocks.push_back(number);
      cubes += static_cast<std::uint32_t>(blocks_[number].cubes.size());
    }
  }
  of.sums.resize(cubes);
  parallel_for(of.blocks.size(), 16, [&](std::size_t b) {
    const Block& block = blocks_[of.blocks[b]];
    for (std::size_t rank = 0; rank < block.cubes.size(); ++rank) {
      SurfaceSums& sums = of.sums[of.first[of.blocks[b]] + rank];
      for (std::uint32_t i = begin_of(block, rank); i < block.cubes[rank].end; ++i)
        sums.add(unpacked(block.points[i]));
    }
  });
  return of;
}

// Puts the cubes in and around a block into the region.
void ApartPoints::gather(const Block& block, const std::array<std::uint32_t, 27>& beside,
                         const CubeSums& sums, SumsAround& region) const {
  region.clear();
  for (const std::uint32_t number : beside) {
    if (number == kNone) continue;
    const Block& other = blocks_[number];
    std::size_t at = sums.first[number];
    for (std::uint64_t left = other.present; left != 0; left &= left - 1, ++at) {
      const Place cube = cube_at(other, std::countr_zero(left));
      region.put({cube[0] - 4 * block.at[0], cube[1] - 4 * block.at[1], cube[2] - 4 * block.at[2]},
                 sums.sums[at], config_.cube_m);
    }
  }
  region.add_up();
}

// The cubes of a block near which something changed.
std::uint64_t ApartPoints::affected_of(const Block& block,
                                       const std::array<std::uint32_t, 27>& beside) const {
  std::uint64_t affected = 0;
  for (std::uint64_t left = block.present; left != 0; left &= left - 1) {
    const Place cube = cube_at(block, std::countr_zero(left));
    for (int step = 0; step < 27; ++step) {
      const std::uint32_t number = beside[static_cast<std::size_t>(step)];
      if (number == kNone || blocks_[number].changed == 0) continue;
      const Place by = {step % 3 - 1, step / 3 % 3 - 1, step / 9 - 1};
      if ((blocks_[number].changed & near_cubes(cube, by, kSurroundings)) == 0) continue;
      affected |= left & -left;
      break;
    }
  }
  return affected;
}

void ApartPoints::work_out(Block& block, const CubeSums& sums, SumsAround& region) const {
  const std::array<std::uint32_t, 27> beside = around(block);
  const std::uint64_t affected = affected_of(block, beside);
  if (affected == 0) return;
  gather(block, beside, sums, region);
  for (std::uint64_t left = affected; left != 0; left &= left - 1) {
    const int bit = std::countr_zero(left);
    const std::size_t rank = rank_of(block, bit);
    const SurfaceSums around_it = region.of(bit);
    if (config_.planes) block.cubes[rank].set(surface_of(around_it, config_.max_planarity));
    if (config_.covariances)
      block.covariances[rank] = covariance_of(around_it).value_or(Eigen::Matrix3f::Constant(-1.0F));
  }
}

void ApartPoints::settle() {
  if (!config_.planes) {
    for (const Place& place : changed_) {
      for (Cube& cube : blocks_[find(place)].cubes)
        cube.surface = SurfaceKind::kPoint;
    }
  }
  if (config_.planes || config_.covariances) {
    const std::vector<std::uint32_t> near = touched();
    for (std::size_t begin = 0; begin < near.size(); begin += kBatch) {
      const std::size_t end = std::min(near.size(), begin + kBatch);
      const CubeSums sums = sums_of(near.data() + begin, near.data() + end);
      parallel_for((end - begin + kTogether - 1) / kTogether, 1, [&](std::size_t part) {
        SumsAround region;
        const std::size_t last = std::min(end, begin + (part + 1) * kTogether);
        for (std::size_t i = begin + part * kTogether; i < last; ++i)
          work_out(blocks_[near[i]], sums, region);
      });
    }
  }
  for (const Place& place : changed_) {
    const std::uint32_t number = find(place);
    blocks_[number].changed = 0;
    if (blocks_[number].present == 0) drop_block(number);
  }
  changed_.clear();
}

double ApartPoints::bytes() const {
  constexpr double kSlack = 1.0 + 0.5 / static_cast<double>(kGrowth);
  constexpr double kAllocation = 16.0;
  double cube = sizeof(Cube);
  if (config_.covariances) cube += sizeof(Eigen::Matrix3f);
  const double block =
      kArraySlack * sizeof(Block) + kIndexBytes + (config_.covariances ? 3.0 : 2.0) * kAllocation;
  return kSlack *
             (static_cast<double>(size_) * sizeof(Packed) + static_cast<double>(cubes_) * cube) +
         static_cast<double>(blocks_.size()) * block;
}

}  // namespace understory::internal
