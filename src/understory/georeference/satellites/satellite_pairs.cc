#include "understory/georeference/satellites/satellite_pairs.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <limits>

#include "understory/georeference/georeference_constants.h"
#include "understory/sensor/fix_position.h"
#include "understory/util/angles.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

using namespace georeference_constants::interpolation;
using namespace georeference_constants::satellite_pairs;

using Eigen::Vector3d;

double median_of(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

template <typename Of>
Vector3d median_place(const std::vector<SatellitePair>& pairs, Of of) {
  Vector3d place;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const SatellitePair& pair : pairs)
      values.push_back(of(pair)[axis]);
    place[axis] = median_of(std::move(values));
  }
  return place;
}

// The first fix that is not far from the median of all: one false fix does not tell the frame.
const GnssFix& first_of_most(const std::vector<GnssFix>& fixes) {
  std::vector<double> latitudes, longitudes;
  for (const GnssFix& fix : fixes) {
    latitudes.push_back(fix.latitude_deg);
    longitudes.push_back(fix.longitude_deg);
  }
  const double latitude = median_of(std::move(latitudes));
  const double longitude = median_of(std::move(longitudes));
  for (const GnssFix& fix : fixes) {
    if (std::abs(fix.latitude_deg - latitude) <= kFarOriginDeg &&
        std::abs(fix.longitude_deg - longitude) <= kFarOriginDeg)
      return fix;
  }
  return fixes.front();
}

// "2017-08-15T10:00:05Z", of what looks like a date.
std::string moment(TimeNs stamp) {
  const std::chrono::sys_seconds seconds{std::chrono::seconds(stamp / kNsPerSecond)};
  const auto day = std::chrono::floor<std::chrono::days>(seconds);
  const std::chrono::year_month_day date(day);
  const auto left = (seconds - day).count();
  return fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}Z", static_cast<int>(date.year()),
                     static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()),
                     left / 3600, left / 60 % 60, left % 60);
}

std::string no_common_time(const std::vector<StampedPose>& trajectory,
                           const std::vector<GnssFix>& fixes) {
  const auto [first, last] =
      std::minmax_element(fixes.begin(), fixes.end(),
                          [](const GnssFix& a, const GnssFix& b) { return a.stamp < b.stamp; });
  return fmt::format(
      "the fixes and the path do not overlap in time: the fixes are from {} to {}, the path is "
      "from "
      "{} to {}. Expected fixes of the same time; --method gnss-path needs no common clock",
      moment(first->stamp), moment(last->stamp), moment(trajectory.front().stamp),
      moment(trajectory.back().stamp));
}

// Of fixes that are left out, `left_out` has the stamps.
std::vector<SatellitePair> gathered(const std::vector<SatellitePair>& single,
                                    const std::vector<TimeNs>& stamps, const PairingConfig& config,
                                    std::set<TimeNs>& left_out) {
  const double whole_s = single.back().time_s - single.front().time_s;
  const double interval_s =
      std::max(config.interval_s, whole_s / static_cast<double>(config.most_pairs));
  std::vector<SatellitePair> pairs;
  GatheredPair now;
  std::size_t begin = 0;
  const auto take = [&](std::size_t end) {
    pairs.push_back(now.mean());
    const std::vector<char> out = now.left_out();
    for (std::size_t i = begin; i < end; ++i) {
      if (out[i - begin] != 0) left_out.insert(stamps[i]);
    }
    now = {};
    begin = end;
  };
  for (std::size_t i = 0; i < single.size(); ++i) {
    if (now.fixes() > 0 && single[i].time_s - now.begin_s() >= interval_s) take(i);
    now.add(single[i]);
  }
  take(single.size());
  return pairs;
}

}  // namespace

std::vector<char> GatheredPair::left_out() const {
  std::vector<char> out(singles_.size(), 0);
  if (singles_.size() < kFewestToCompare) return out;
  const auto fix_of = [](const SatellitePair& pair) { return pair.fix_in_enu; };
  const auto antenna_of = [](const SatellitePair& pair) { return pair.antenna_in_world; };
  Vector3d fix = median_place(singles_, fix_of);
  // A fix without a height is not judged by it.
  std::vector<double> heights;
  for (const SatellitePair& one : singles_) {
    if (one.has_height) heights.push_back(one.fix_in_enu.z());
  }
  if (!heights.empty()) fix.z() = median_of(std::move(heights));
  const Vector3d antenna = median_place(singles_, antenna_of);
  // Plane and height apart. The motion between both frames keeps lengths, so the way of the antenna
  // counts whichever way it went.
  std::vector<double> plane, height;
  double moved = 0.0;
  for (const SatellitePair& one : singles_) {
    plane.push_back((one.fix_in_enu - fix).head<2>().norm());
    height.push_back(one.has_height ? std::abs(one.fix_in_enu.z() - fix.z()) : 0.0);
    moved = std::max(moved, (one.antenna_in_world - antenna).norm());
  }
  const double most_plane = moved + std::max(kFarFixM, kFarFixMedians * median_of(plane));
  const double most_height = moved + std::max(kFarFixM, kFarFixMedians * median_of(height));
  for (std::size_t i = 0; i < out.size(); ++i)
    out[i] = plane[i] > most_plane || height[i] > most_height ? 1 : 0;
  return out;
}

SatellitePair GatheredPair::mean() const {
  const std::vector<char> out = left_out();
  SatellitePair pair;
  Eigen::Vector2d turns = Eigen::Vector2d::Zero();
  double turn_sds = 0.0;
  std::size_t headings = 0;
  for (std::size_t i = 0; i < singles_.size(); ++i) {
    if (out[i] != 0) continue;
    const SatellitePair& one = singles_[i];
    pair.time_s += one.time_s;
    pair.antenna_in_world += one.antenna_in_world;
    pair.velocity_in_world += one.velocity_in_world;
    pair.fix_in_enu += one.fix_in_enu;
    pair.has_height = (pair.fixes == 0 || pair.has_height) && one.has_height;
    if (std::isfinite(one.turn_rad)) {
      turns += Eigen::Vector2d(std::cos(one.turn_rad), std::sin(one.turn_rad));
      turn_sds += one.turn_sd_rad;
      ++headings;
    }
    pair.covariance = pair.fixes == 0 ? one.covariance : pair.covariance + one.covariance;
    ++pair.fixes;
  }
  const auto n = static_cast<double>(pair.fixes);
  pair.time_s /= n;
  pair.antenna_in_world /= n;
  pair.velocity_in_world /= n;
  pair.fix_in_enu /= n;
  pair.covariance /= n;
  if (headings > 0) {
    pair.turn_rad = std::atan2(turns.y(), turns.x());
    pair.turn_sd_rad = turn_sds / static_cast<double>(headings);
  }
  return pair;
}

void GatheredPair::save(BinaryWriter& writer) const {
  writer.put(static_cast<std::uint64_t>(singles_.size()));
  for (const SatellitePair& one : singles_) {
    writer.put(one.time_s);
    for (const Vector3d* v : {&one.antenna_in_world, &one.velocity_in_world, &one.fix_in_enu})
      writer.put_doubles(v->data(), 3);
    writer.put(one.has_height);
    writer.put(one.turn_rad);
    writer.put(one.turn_sd_rad);
    writer.put_doubles(one.covariance.data(), 9);
    writer.put(static_cast<std::uint64_t>(one.fixes));
  }
}

void GatheredPair::load(BinaryReader& reader) {
  singles_.clear();
  for (auto left = reader.get<std::uint64_t>(); left > 0; --left) {
    SatellitePair& one = singles_.emplace_back();
    one.time_s = reader.get<double>();
    for (Vector3d* v : {&one.antenna_in_world, &one.velocity_in_world, &one.fix_in_enu})
      reader.get_doubles(v->data(), 3);
    one.has_height = reader.get<bool>();
    one.turn_rad = reader.get<double>();
    one.turn_sd_rad = reader.get<double>();
    reader.get_doubles(one.covariance.data(), 9);
    one.fixes = reader.get<std::uint64_t>();
  }
}

double turn_by_heading(const GnssFix& fix, const Vector3d& baseline_in_world) {
  const double in_plane = baseline_in_world.head<2>().norm();
  if (!(in_plane > kUpright * baseline_in_world.norm()))
    return std::numeric_limits<double>::quiet_NaN();
  const double heading_from_east = 0.5 * M_PI - fix.heading_deg * kDegree;
  const double as_it_lies = std::atan2(baseline_in_world.y(), baseline_in_world.x());
  return std::remainder(heading_from_east - as_it_lies, 2.0 * M_PI);
}

double turn_sd_rad(const GnssFix& fix, double heading_sd_deg) {
  return kDegree * (fix.heading_sd_deg > 0.0 ? fix.heading_sd_deg : heading_sd_deg);
}

std::optional<Vector3d> antenna_place(const std::vector<StampedPose>& trajectory,
                                      const Vector3d& antenna_in_body, TimeNs stamp) {
  const auto after =
      std::lower_bound(trajectory.begin(), trajectory.end(), stamp,
                       [](const StampedPose& pose, TimeNs t) { return pose.stamp < t; });
  if (after == trajectory.end()) return std::nullopt;
  if (after->stamp == stamp) return after->world_from_body * antenna_in_body;
  if (after == trajectory.begin()) return std::nullopt;
  const auto before = std::prev(after);
  const double gap = to_seconds(after->stamp - before->stamp);
  if (gap > kGapS) return std::nullopt;
  const double u = to_seconds(stamp - before->stamp) / gap;
  return (1.0 - u) * (before->world_from_body * antenna_in_body) +
         u * (after->world_from_body * antenna_in_body);
}

SatellitePairs pair_by_time(const std::vector<StampedPose>& trajectory,
                            const std::vector<GnssFix>& given, const PairingConfig& config) {
  SatellitePairs result;
  std::vector<GnssFix> fixes;
  std::copy_if(given.begin(), given.end(), std::back_inserter(fixes), is_on_globe);
  if (fixes.empty() || trajectory.empty()) {
    result.reason = "expected fixes with a position, and a path";
    return result;
  }
  const auto height = [](const GnssFix& fix) {
    return std::isfinite(fix.height_m) ? fix.height_m : 0.0;
  };
  const GnssFix& first = first_of_most(fixes);
  result.origin = {first.latitude_deg, first.longitude_deg, height(first)};
  const EastNorthUp frame(*result.origin);
  sort_stably(fixes, [](const GnssFix& a, const GnssFix& b) { return a.stamp < b.stamp; });
  result.first_fix = fixes.front().stamp;
  const TimeNs shift = from_seconds(config.time_offset_s);
  const Vector3d& arm = config.antenna_in_body;
  std::vector<SatellitePair> single;
  std::vector<TimeNs> stamps;
  for (const GnssFix& fix : fixes) {
    const TimeNs stamp = fix.stamp + shift;
    const auto place = antenna_place(trajectory, arm, stamp);
    if (!place) continue;
    SatellitePair one;
    one.time_s = to_seconds(fix.stamp - fixes.front().stamp);
    one.antenna_in_world = *place;
    const auto before = antenna_place(trajectory, arm, stamp - kNsPerSecond / 2);
    const auto after = antenna_place(trajectory, arm, stamp + kNsPerSecond / 2);
    if (before && after) one.velocity_in_world = *after - *before;
    if (config.second_antenna_in_body && std::isfinite(fix.heading_deg)) {
      const Vector3d second = *antenna_place(trajectory, *config.second_antenna_in_body, stamp);
      one.turn_rad = turn_by_heading(fix, second - *place);
      one.turn_sd_rad = turn_sd_rad(fix, config.heading_sd_deg);
    }
    one.fix_in_enu = frame.from_place({fix.latitude_deg, fix.longitude_deg, height(fix)});
    one.has_height = std::isfinite(fix.height_m);
    one.covariance = fix_covariance(fix, config.covariance);
    one.fixes = 1;
    single.push_back(one);
    stamps.push_back(fix.stamp);
  }
  result.fixes_in_time = single.size();
  if (single.empty()) {
    result.reason = no_common_time(trajectory, fixes);
    return result;
  }
  result.pairs = gathered(single, stamps, config, result.left_out);
  return result;
}

std::vector<SatellitePair> with_height(const std::vector<SatellitePair>& pairs) {
  std::vector<SatellitePair> high;
  std::copy_if(pairs.begin(), pairs.end(), std::back_inserter(high),
               [](const SatellitePair& pair) { return pair.has_height; });
  return high;
}

std::vector<SatellitePair> of_one_kind(const std::vector<SatellitePair>& pairs) {
  std::vector<SatellitePair> high = with_height(pairs);
  return 2 * high.size() >= pairs.size() ? high : pairs;
}

double plane_extent_m(const std::vector<SatellitePair>& pairs) {
  if (pairs.empty()) return 0.0;
  Eigen::Vector2d low = pairs.front().antenna_in_world.head<2>();
  Eigen::Vector2d high = low;
  for (const SatellitePair& pair : pairs) {
    low = low.cwiseMin(pair.antenna_in_world.head<2>());
    high = high.cwiseMax(pair.antenna_in_world.head<2>());
  }
  return (high - low).norm();
}

}  // namespace understory
