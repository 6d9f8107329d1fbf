#include "understory/georeference/satellites/satellite_pairs.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <limits>

#include "understory/georeference/georeference_constants.h"
#include "understory/util/angles.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

using namespace georeference_constants::interpolation;
using namespace georeference_constants::satellite_pairs;

using Eigen::Vector3d;

bool has_place(const GnssFix& fix) {
  return std::isfinite(fix.latitude_deg) && std::isfinite(fix.longitude_deg);
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

std::vector<SatellitePair> gathered(const std::vector<SatellitePair>& single,
                                    const PairingConfig& config) {
  const double whole_s = single.back().time_s - single.front().time_s;
  const double interval_s =
      std::max(config.interval_s, whole_s / static_cast<double>(config.most_pairs));
  std::vector<SatellitePair> pairs;
  GatheredPair now;
  for (const SatellitePair& one : single) {
    if (now.fixes() > 0 && one.time_s - now.begin_s() >= interval_s) {
      pairs.push_back(now.mean());
      now = {};
    }
    now.add(one);
  }
  pairs.push_back(now.mean());
  return pairs;
}

}  // namespace

void GatheredPair::add(const SatellitePair& one) {
  if (sum_.fixes == 0) begin_s_ = one.time_s;
  sum_.time_s += one.time_s;
  sum_.antenna_in_world += one.antenna_in_world;
  sum_.velocity_in_world += one.velocity_in_world;
  sum_.fix_in_enu += one.fix_in_enu;
  sum_.has_height = (sum_.fixes == 0 || sum_.has_height) && one.has_height;
  if (std::isfinite(one.turn_rad)) {
    turns_ += Eigen::Vector2d(std::cos(one.turn_rad), std::sin(one.turn_rad));
    turn_sds_ += one.turn_sd_rad;
    ++headings_;
  }
  sum_.covariance = sum_.fixes == 0 ? one.covariance : sum_.covariance + one.covariance;
  ++sum_.fixes;
}

SatellitePair GatheredPair::mean() const {
  SatellitePair pair = sum_;
  const auto n = static_cast<double>(sum_.fixes);
  pair.time_s /= n;
  pair.antenna_in_world /= n;
  pair.velocity_in_world /= n;
  pair.fix_in_enu /= n;
  pair.covariance /= n;
  if (headings_ > 0) {
    pair.turn_rad = std::atan2(turns_.y(), turns_.x());
    pair.turn_sd_rad = turn_sds_ / static_cast<double>(headings_);
  }
  return pair;
}

void GatheredPair::save(BinaryWriter& writer) const {
  writer.put(begin_s_);
  writer.put(sum_.time_s);
  for (const Vector3d* v : {&sum_.antenna_in_world, &sum_.velocity_in_world, &sum_.fix_in_enu})
    writer.put_doubles(v->data(), 3);
  writer.put(sum_.has_height);
  writer.put_doubles(sum_.covariance.data(), 9);
  writer.put(static_cast<std::uint64_t>(sum_.fixes));
  writer.put_doubles(turns_.data(), 2);
  writer.put(turn_sds_);
  writer.put(headings_);
}

void GatheredPair::load(BinaryReader& reader) {
  begin_s_ = reader.get<double>();
  sum_.time_s = reader.get<double>();
  for (Vector3d* v : {&sum_.antenna_in_world, &sum_.velocity_in_world, &sum_.fix_in_enu})
    reader.get_doubles(v->data(), 3);
  sum_.has_height = reader.get<bool>();
  reader.get_doubles(sum_.covariance.data(), 9);
  sum_.fixes = reader.get<std::uint64_t>();
  reader.get_doubles(turns_.data(), 2);
  turn_sds_ = reader.get<double>();
  headings_ = reader.get<std::uint64_t>();
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
  std::copy_if(given.begin(), given.end(), std::back_inserter(fixes), has_place);
  if (fixes.empty() || trajectory.empty()) {
    result.reason = "expected fixes with a position, and a path";
    return result;
  }
  const auto height = [](const GnssFix& fix) {
    return std::isfinite(fix.height_m) ? fix.height_m : 0.0;
  };
  const GnssFix& first = fixes.front();
  result.origin = {first.latitude_deg, first.longitude_deg, height(first)};
  const EastNorthUp frame(*result.origin);
  sort_stably(fixes, [](const GnssFix& a, const GnssFix& b) { return a.stamp < b.stamp; });
  result.first_fix = fixes.front().stamp;
  const TimeNs shift = from_seconds(config.time_offset_s);
  const Vector3d& arm = config.antenna_in_body;
  std::vector<SatellitePair> single;
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
    single.push_back(one);
  }
  result.fixes_in_time = single.size();
  if (single.empty()) {
    result.reason = no_common_time(trajectory, fixes);
    return result;
  }
  result.pairs = gathered(single, config);
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
