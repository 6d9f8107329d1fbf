#include "understory/preprocess/carried_returns.h"

#include <algorithm>
#include <cmath>

#include "understory/geometry/symmetric_eigen.h"
#include "understory/preprocess/preprocess_constants.h"

namespace understory {
namespace {

using namespace preprocess_constants::carried_returns;

constexpr auto kVoxelsAMetre = static_cast<float>(1.0 / kVoxelM);

// Weight of the newest scan in a share.
float weight_of(std::uint32_t scan) {
  return 1.0F / static_cast<float>(std::min(scan, kScans));
}

}  // namespace

void describe(ConfigTable& table, CarriedReturnsConfig& config) {
  table.add("reach_m", config.reach_m, {0.0, 10.0}, "m",
            "returns nearer to the lidar that go along with it do not enter matches; 0: all do");
  table.add("share", config.share, {0.5, 1.0}, "",
            "a place beside the lidar is carried that had returns in this share of the scans");
}

CarriedReturns::CarriedReturns(const CarriedReturnsConfig& config) : config_(config) {
  if (!(config.reach_m > 0.0)) return;
  edge_ = 2 * static_cast<int>(std::ceil(config.reach_m / kVoxelM));
  const auto edge = static_cast<std::size_t>(edge_);
  voxels_.resize(edge * edge * edge);
}

std::uint32_t CarriedReturns::voxel_of(const ScanPoint& point) const {
  const auto reach = static_cast<float>(config_.reach_m);
  const float squared = point.x * point.x + point.y * point.y + point.z * point.z;
  if (!(squared < reach * reach)) return kOutside;
  const auto half = static_cast<float>(edge_ / 2);
  const auto at = [&](float value) {
    return std::min(static_cast<int>(value * kVoxelsAMetre + half), edge_ - 1);
  };
  return static_cast<std::uint32_t>((at(point.x) * edge_ + at(point.y)) * edge_ + at(point.z));
}

float CarriedReturns::share_before(const Voxel& voxel, std::uint32_t scan) const {
  float share = voxel.share;
  std::uint32_t at = voxel.last + 1;
  for (; at < scan && at < kScans; ++at)
    share *= 1.0F - weight_of(at);
  if (at < scan) share *= std::pow(1.0F - weight_of(kScans), static_cast<float>(scan - at));
  return share;
}

void CarriedReturns::add(const ScanPoint& point, std::uint32_t index) {
  Voxel& voxel = voxels_[index];
  const auto half = static_cast<float>(edge_ / 2);
  const auto from_center = [&](float value) {
    const auto at = static_cast<float>(static_cast<int>(value * kVoxelsAMetre + half));
    return value - (at - half + 0.5F) * static_cast<float>(kVoxelM);
  };
  const float x = from_center(point.x);
  const float y = from_center(point.y);
  const float z = from_center(point.z);
  voxel.n += 1.0F;
  voxel.sum[0] += x;
  voxel.sum[1] += y;
  voxel.sum[2] += z;
  const float products[6] = {x * x, x * y, x * z, y * y, y * z, z * z};
  for (int k = 0; k < 6; ++k)
    voxel.products[k] += products[k];
}

void CarriedReturns::halve_sums(Voxel& voxel) {
  voxel.n *= 0.5F;
  for (float& sum : voxel.sum)
    sum *= 0.5F;
  for (float& product : voxel.products)
    product *= 0.5F;
}

// By the points of the voxel and of those around it.
bool CarriedReturns::is_level(std::uint32_t index, const Eigen::Vector3d& up) const {
  const int i = static_cast<int>(index);
  const int at[3] = {i / (edge_ * edge_), i / edge_ % edge_, i % edge_};
  double n = 0.0;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
  for (int x = std::max(0, at[0] - 1); x <= std::min(edge_ - 1, at[0] + 1); ++x) {
    for (int y = std::max(0, at[1] - 1); y <= std::min(edge_ - 1, at[1] + 1); ++y) {
      for (int z = std::max(0, at[2] - 1); z <= std::min(edge_ - 1, at[2] + 1); ++z) {
        const Voxel& near = voxels_[static_cast<std::size_t>((x * edge_ + y) * edge_ + z)];
        if (near.n == 0.0F) continue;
        const Eigen::Vector3d c = kVoxelM * Eigen::Vector3d(x - at[0], y - at[1], z - at[2]);
        const Eigen::Vector3d s(near.sum[0], near.sum[1], near.sum[2]);
        const float* p = near.products;
        Eigen::Matrix3d own;
        own << p[0], p[1], p[2], p[1], p[3], p[4], p[2], p[4], p[5];
        const double m = near.n;
        products += own + s * c.transpose() + c * s.transpose() + m * c * c.transpose();
        sum += s + m * c;
        n += m;
      }
    }
  }
  const Eigen::Matrix3d covariance = products / n - sum * sum.transpose() / (n * n);
  const SymmetricEigen3 shape = fast_symmetric_eigen(covariance);
  return shape.values[0] < kFlat * shape.values[1] + kNoiseM * kNoiseM &&
         shape.values[1] > kWidthM * kWidthM && std::abs(shape.vectors.col(0).dot(up)) > kLevel;
}

// Whether something that stays lies steeply below: then it is no ground.
bool CarriedReturns::is_above_others(std::uint32_t index, const Eigen::Vector3d& up) const {
  const Eigen::Vector3d centre = centre_of(index);
  return std::any_of(staying_.begin(), staying_.end(), [&](std::uint32_t other) {
    const Eigen::Vector3d offset = centre_of(other) - centre;
    const double drop = -offset.dot(up);
    return drop > kDropM && drop * drop > kSteep * offset.squaredNorm();
  });
}

Eigen::Vector3d CarriedReturns::centre_of(std::uint32_t index) const {
  const int i = static_cast<int>(index);
  return kVoxelM * Eigen::Vector3d(i / (edge_ * edge_), i / edge_ % edge_, i % edge_);
}

void CarriedReturns::learn(const Scan& scan, const Eigen::Vector3d& up_in_lidar) {
  if (voxels_.empty() || scan.points.empty()) return;
  ++scans_;
  hit_.clear();
  for (const ScanPoint& point : scan.points) {
    const std::uint32_t index = voxel_of(point);
    if (index == kOutside) continue;
    Voxel& voxel = voxels_[index];
    if (voxel.last != scans_) {
      hit_.push_back(index);
      const float before = share_before(voxel, scans_);
      voxel.share = before + weight_of(scans_) * (1.0F - before);
      voxel.last = scans_;
    }
    if (voxel.n < kFullVoxel) add(point, index);
  }
  const auto share = static_cast<float>(config_.share);
  staying_.clear();
  for (const std::uint32_t index : hit_) {
    if (voxels_[index].share >= share) staying_.push_back(index);
  }
  for (const std::uint32_t index : hit_) {
    Voxel& voxel = voxels_[index];
    voxel.carried = voxel.share >= share ? 1 : 0;
    if (voxel.carried == 0) continue;
    if (voxel.judged == 0 || scans_ - voxel.judged >= kJudgeEvery) {
      const bool ground = is_level(index, up_in_lidar) && !is_above_others(index, up_in_lidar);
      voxel.ground = ground ? 1 : 0;
      voxel.judged = scans_;
      if (voxel.n >= kFullVoxel) halve_sums(voxel);
    }
    if (voxel.ground != 0) voxel.carried = 0;
  }
}

std::vector<std::uint8_t> CarriedReturns::mark(const Scan& scan) const {
  std::vector<std::uint8_t> carried;
  if (voxels_.empty()) return carried;
  carried.assign(scan.points.size(), 0);
  std::size_t count = 0;
  for (std::size_t i = 0; i < carried.size(); ++i) {
    const std::uint32_t index = voxel_of(scan.points[i]);
    if (index == kOutside || voxels_[index].carried == 0) continue;
    carried[i] = 1;
    ++count;
  }
  if (count == 0 || 2 * count > carried.size()) carried.clear();
  return carried;
}

void CarriedReturns::save(BinaryWriter& writer) const {
  writer.put(scans_);
  std::vector<std::uint32_t> indices;
  std::vector<Voxel> voxels;
  for (std::uint32_t i = 0; i < voxels_.size(); ++i) {
    if (voxels_[i].last == 0) continue;
    indices.push_back(i);
    voxels.push_back(voxels_[i]);
  }
  writer.put(indices);
  writer.put(voxels);
}

void CarriedReturns::load(BinaryReader& reader) {
  scans_ = reader.get<std::uint32_t>();
  const auto indices = reader.get_vector<std::uint32_t>();
  const auto voxels = reader.get_vector<Voxel>();
  std::fill(voxels_.begin(), voxels_.end(), Voxel());
  for (std::size_t i = 0; i < std::min(indices.size(), voxels.size()); ++i) {
    if (indices[i] < voxels_.size()) voxels_[indices[i]] = voxels[i];
  }
}

}  // namespace understory
