#include "understory/recording/messages/baseline_headings.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <vector>

#include "understory/recording/recording_constants.h"
#include "understory/sensor/sensor_io.h"
#include "understory/util/angles.h"
#include "understory/util/median.h"

namespace understory {
namespace {

using namespace recording_constants::baseline_headings;

bool has_position(const GnssFix& fix) {
  return fix.quality > 0 && std::isfinite(fix.latitude_deg) && std::isfinite(fix.longitude_deg);
}

// East, north, up, metres: right to a micrometre for antennas on one carrier. By the radii of
// curvature of WGS 84.
Eigen::Vector3d line_between(const GnssFix& from, const GnssFix& to) {
  constexpr double kSemiMajor = 6378137.0;
  constexpr double kEccentricity2 = 0.00669437999014;
  const double latitude = 0.5 * (from.latitude_deg + to.latitude_deg) * kDegree;
  const double height = 0.5 * (from.height_m + to.height_m);
  const double w = 1.0 - kEccentricity2 * std::pow(std::sin(latitude), 2.0);
  const double across = kSemiMajor / std::sqrt(w);
  const double meridian = across * (1.0 - kEccentricity2) / w;
  const double turn = std::remainder(to.longitude_deg - from.longitude_deg, 360.0) * kDegree;
  return {(across + height) * std::cos(latitude) * turn,
          (meridian + height) * (to.latitude_deg - from.latitude_deg) * kDegree,
          to.height_m - from.height_m};
}

// Variance of the difference of two positions along a unit vector, as the receivers state it; 0
// where one of them states none.
double stated_variance(const GnssFix& first, const GnssFix& second, const Eigen::Vector3d& along) {
  const double variance = along.dot((first.covariance + second.covariance) * along);
  return std::isfinite(variance) ? std::max(0.0, variance) : 0.0;
}

}  // namespace

void BaselineHeadings::set_length_m(std::optional<double> length_m) {
  const double known = length_m && *length_m >= kShortestM ? *length_m : 0.0;
  if (known == length_m_) return;
  *this = BaselineHeadings();
  length_m_ = known;
}

double BaselineHeadings::scatter_m() const {
  std::vector<double> off;
  for (const double distance : distances_m_)
    off.push_back(std::abs(distance - length_m_));
  return kSdOverMad * upper_median(off);
}

double BaselineHeadings::median_distance_m() const {
  return upper_median(std::vector<double>(distances_m_.begin(), distances_m_.end()));
}

std::optional<HeadingByPositions> BaselineHeadings::add(const GnssFix& first,
                                                        const GnssFix& second) {
  if (!known() || !has_position(first) || !has_position(second)) return std::nullopt;
  const Eigen::Vector3d line = line_between(first, second);
  const double distance = line.norm();
  if (!std::isfinite(distance)) return std::nullopt;
  ++pairs_;
  distances_m_.push_back(distance);
  if (distances_m_.size() > kLastDistances) distances_m_.pop_front();
  const double scatter = std::max(scatter_m(), kLeastSdM);
  const double off = std::abs(distance - length_m_);
  const bool too_far = off > kMostShare * length_m_ || off > kFarDistance * scatter;
  if (too_far || scatter > kMostShare * length_m_) {
    ++contradicting_;
    return std::nullopt;
  }
  const double in_plane = line.head<2>().norm();
  if (distances_m_.size() < kFewestDistances || in_plane < kLeastInPlane * distance)
    return std::nullopt;
  const Eigen::Vector3d across(-line.y() / in_plane, line.x() / in_plane, 0.0);
  const double sd = std::max(scatter, std::sqrt(stated_variance(first, second, across)));
  HeadingByPositions found;
  found.heading_deg = std::atan2(line.x(), line.y()) / kDegree;
  if (found.heading_deg < 0.0) found.heading_deg += 360.0;
  found.sd_deg = std::min(kMostSdDeg, sd / in_plane / kDegree);
  return found;
}

void BaselineHeadings::save(BinaryWriter& writer) const {
  writer.put(length_m_);
  writer.put(static_cast<std::uint64_t>(distances_m_.size()));
  for (const double distance : distances_m_)
    writer.put(distance);
  writer.put(pairs_);
  writer.put(contradicting_);
}

void BaselineHeadings::load(BinaryReader& reader) {
  length_m_ = reader.get<double>();
  distances_m_.clear();
  for (auto left = reader.get<std::uint64_t>(); left > 0; --left)
    distances_m_.push_back(reader.get<double>());
  pairs_ = reader.get<std::uint64_t>();
  contradicting_ = reader.get<std::uint64_t>();
}

void SecondPositions::add(const GnssFix& fix) {
  if (!has_position(fix)) return;
  if (!last_.empty() && fix.stamp <= last_.back().stamp) last_.clear();
  last_.push_back(fix);
  if (last_.size() > kLastPositions) last_.pop_front();
}

std::optional<GnssFix> SecondPositions::at(TimeNs stamp) const {
  for (const GnssFix& fix : last_) {
    if (std::abs(fix.stamp - stamp) <= kSameMoment) return fix;
  }
  const auto after = std::find_if(last_.begin(), last_.end(),
                                  [&](const GnssFix& fix) { return fix.stamp > stamp; });
  if (after == last_.begin() || after == last_.end()) return std::nullopt;
  const GnssFix& before = *(after - 1);
  if (after->stamp - before.stamp > kLongestPositionStep) return std::nullopt;
  const double share =
      static_cast<double>(stamp - before.stamp) / static_cast<double>(after->stamp - before.stamp);
  const auto between = [&](double a, double b) { return a + share * (b - a); };
  GnssFix fix = before;
  fix.stamp = stamp;
  fix.latitude_deg = between(before.latitude_deg, after->latitude_deg);
  fix.longitude_deg += share * std::remainder(after->longitude_deg - before.longitude_deg, 360.0);
  fix.height_m = between(before.height_m, after->height_m);
  // Errors of neighbours are alike: their mean is no better than they are.
  fix.covariance = (1.0 - share) * before.covariance + share * after->covariance;
  return fix;
}

std::optional<GnssFix> SecondPositions::near(TimeNs stamp) const {
  for (std::size_t i = last_.size(); i-- > 1;) {
    const TimeNs apart = std::abs(last_[i].stamp - stamp);
    if (apart > kSameEpoch) continue;
    const Eigen::Vector3d way = line_between(last_[i - 1], last_[i]);
    const double way_m = way.norm() * static_cast<double>(apart) /
                         static_cast<double>(last_[i].stamp - last_[i - 1].stamp);
    if (!std::isfinite(way_m)) return std::nullopt;
    GnssFix fix = last_[i];
    if (!fix.covariance.allFinite()) fix.covariance.setZero();
    fix.covariance += way_m * way_m * Eigen::Matrix3d::Identity();
    return fix;
  }
  return std::nullopt;
}

void SecondPositions::save(BinaryWriter& writer) const {
  writer.put(static_cast<std::uint64_t>(last_.size()));
  for (const GnssFix& fix : last_)
    put_fix(writer, fix);
}

void SecondPositions::load(BinaryReader& reader) {
  last_.clear();
  for (auto left = reader.get<std::uint64_t>(); left > 0; --left)
    last_.push_back(get_fix(reader));
}

}  // namespace understory
