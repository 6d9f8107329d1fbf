#include "understory/preprocess/weather_filter.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "understory/geometry/pose_io.h"
#include "understory/preprocess/lone_share.h"
#include "understory/preprocess/preprocess_constants.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

using namespace preprocess_constants::weather_filter;

// The intensity of the bright returns; 0 where all are the same.
float bright_of(std::vector<float> intensity) {
  if (intensity.empty()) return 0.0F;
  const auto [least, most] = std::minmax_element(intensity.begin(), intensity.end());
  if (!(*least < *most)) return 0.0F;
  const auto at = static_cast<std::ptrdiff_t>(kBrightShare * (intensity.size() - 1.0));
  std::nth_element(intensity.begin(), intensity.begin() + at, intensity.end());
  return intensity[static_cast<std::size_t>(at)];
}

// 1 where the return before or the one after on the ring is about as far: within this share of it.
std::vector<std::uint8_t> continuing(const BodyCloud& cloud, float within) {
  constexpr std::uint32_t kNone = UINT32_MAX;
  std::vector<std::uint32_t> last;  // of each ring
  std::vector<std::uint8_t> continues(cloud.size(), 0);
  for (std::uint32_t i = 0; i < cloud.size(); ++i) {
    if (cloud.ring[i] >= last.size()) last.resize(cloud.ring[i] + std::size_t{1}, kNone);
    const std::uint32_t before = std::exchange(last[cloud.ring[i]], i);
    if (before == kNone) continue;
    const float step = std::abs(cloud.range[i] - cloud.range[before]);
    if (step <= within * RangeGrid::unit(cloud.range[i])) continues[i] = 1;
    if (step <= within * RangeGrid::unit(cloud.range[before])) continues[before] = 1;
  }
  return continues;
}

// Weight of what speaks for weather, 0..1, by the share of those around that stand alone.
double weight_of(double share) {
  const double expected =
      std::pow(std::min((share + kLoneAnywhere) / kLoneInWeather, 1.0), kByLoneShare);
  const double thick = std::clamp((share - kThickFrom) / (kThickest - kThickFrom), 0.0, 1.0);
  return expected / (1.0 + (kInThickest - 1.0) * thick);
}

void keep_only(const std::vector<std::uint8_t>& keep, BodyCloud& cloud) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < keep.size(); ++i) {
    if (keep[i] == 0) continue;
    cloud.points[kept] = cloud.points[i];
    cloud.intensity[kept] = cloud.intensity[i];
    cloud.range[kept] = cloud.range[i];
    cloud.ring[kept] = cloud.ring[i];
    cloud.t_ns[kept] = cloud.t_ns[i];
    if (!cloud.carried.empty()) cloud.carried[kept] = cloud.carried[i];
    ++kept;
  }
  cloud.resize(kept);
  if (!cloud.carried.empty()) cloud.carried.resize(kept);
}

}  // namespace

void describe(ConfigTable& table, WeatherFilterConfig& config) {
  table.add("enabled", config.enabled,
            "drop dark returns that stand alone in their scan and in those before: snow, false "
            "ranges of a cold lidar and of the low sun");
  table.add("apart", config.apart, {0.001, 10.0}, "",
            "how far from others a return is weather: share of its range over its brightness; less "
            "drops more");
  table.add("reach", config.reach, {0.005, 0.2}, "",
            "share of its range beyond which a return counts as alone");
  table.add("scans", config.scans, {0, 5}, "",
            "scans before, in which what stands still must have been seen");
}

std::size_t WeatherFilter::drop(BodyCloud& cloud, const Pose& world_from_body) {
  if (!config_.enabled) return 0;
  look(cloud);
  const std::vector<std::uint8_t> keep = judge(cloud, world_from_body);
  const auto dropped = static_cast<std::size_t>(std::count(keep.begin(), keep.end(), 0));
  if (dropped > 0) keep_only(keep, cloud);
  return dropped;
}

bool WeatherFilter::judges(const Scan& scan) const {
  if (!config_.enabled) return false;
  float least = std::numeric_limits<float>::infinity();
  float most = -least;
  for (const ScanPoint& point : scan.points) {
    if (!std::isfinite(point.intensity)) continue;
    least = std::min(least, point.intensity);
    most = std::max(most, point.intensity);
  }
  return least < most;
}

void WeatherFilter::look(const BodyCloud& cloud) {
  now_.points = cloud.points;
  now_.range = cloud.range;
  now_.grid = RangeGrid(now_.points, now_.range, config_.reach, kMovedM);
}

std::vector<std::uint8_t> WeatherFilter::judge(const BodyCloud& cloud,
                                               const Pose& world_from_body) const {
  std::vector<std::uint8_t> keep(cloud.size(), 1);
  const float bright = bright_of(cloud.intensity);
  if (!(bright > 0.0F)) return keep;
  std::vector<Eigen::Isometry3f> past_from_body;
  for (const Seen& seen : before_) {
    const Pose pose = seen.world_from_body.inverse() * world_from_body;
    past_from_body.emplace_back(Eigen::Isometry3f::Identity());
    past_from_body.back().linear() = pose.rotation_matrix().cast<float>();
    past_from_body.back().translation() = pose.translation().cast<float>();
  }
  const Lone lone = find_lone(cloud, bright, past_from_body);
  const LoneShare share(cloud.ring, cloud.t_ns, cloud.range, lone.alone);
  parallel_for(cloud.size(), kGrain, [&](std::size_t i) {
    if (lone.excess[i] > 0.0F && lone.excess[i] * weight_of(share.around(i)) > 1.0) keep[i] = 0;
  });
  return keep;
}

WeatherFilter::Lone WeatherFilter::find_lone(
    const BodyCloud& cloud, float bright,
    const std::vector<Eigen::Isometry3f>& past_from_body) const {
  Lone lone{std::vector<float>(cloud.size(), 0.0F), std::vector<std::uint8_t>(cloud.size(), 0)};
  const auto reach = static_cast<float>(config_.reach);
  const auto apart = static_cast<float>(config_.apart);
  const std::vector<std::uint8_t> continues = continuing(cloud, reach);
  parallel_for(cloud.size(), kGrain, [&](std::size_t i) {
    const float range = cloud.range[i];
    const float least = apart * (std::max(cloud.intensity[i], 0.0F) / bright + kDarkest) *
                        std::pow(kUsualRangeM / RangeGrid::unit(range), kByRange) *
                        (continues[i] != 0 ? kContinues : 1.0F);
    const float product = least * least;
    if (!(product < reach * reach)) return;
    const RangeGrid::Nearest now =
        now_.grid.nearest(cloud.points[i], range, product / reach, static_cast<std::uint32_t>(i));
    const float here = now.apart();
    if (here * reach <= product) return;
    RangeGrid::Nearest past = before_.empty() ? now : RangeGrid::Nearest{reach, reach};
    for (std::size_t k = 0; k < before_.size(); ++k) {
      // What goes along with the lidar was where it is now, seen from there.
      const Eigen::Vector3f place =
          cloud.is_carried(i) ? cloud.points[i] : past_from_body[k] * cloud.points[i];
      const RangeGrid::Nearest seen = before_[k].grid.nearest(place, range, product / here);
      past = {std::min(past.first, seen.first), std::min(past.second, seen.second)};
      if (past.apart() * here <= product) return;
    }
    const float then = past.apart();
    if (then * here <= product) return;
    lone.excess[i] = std::sqrt(then * here / product);
    lone.alone[i] = std::min(now.first, past.first) > kAlone * reach ? 1 : 0;
  });
  return lone;
}

void WeatherFilter::remember(const Pose& world_from_body) {
  if (!config_.enabled) return;
  now_.world_from_body = world_from_body;
  before_.push_front(std::move(now_));
  now_ = {};
  while (before_.size() > static_cast<std::size_t>(config_.scans))
    before_.pop_back();
}

void WeatherFilter::move_world(const Pose& new_world_from_old_world) {
  for (Seen& seen : before_)
    seen.world_from_body = new_world_from_old_world * seen.world_from_body;
}

void WeatherFilter::save(BinaryWriter& writer) const {
  writer.put(static_cast<std::uint32_t>(before_.size()));
  for (const Seen& seen : before_) {
    put_pose(writer, seen.world_from_body);
    std::vector<float> places;
    places.reserve(3 * seen.points.size());
    for (const Eigen::Vector3f& point : seen.points)
      places.insert(places.end(), {point.x(), point.y(), point.z()});
    writer.put(places);
    writer.put(seen.range);
  }
}

void WeatherFilter::load(BinaryReader& reader) {
  before_.clear();
  const auto count = reader.get<std::uint32_t>();
  for (std::uint32_t k = 0; k < count; ++k) {
    Seen seen;
    seen.world_from_body = get_pose(reader);
    const auto places = reader.get_vector<float>();
    seen.range = reader.get_vector<float>();
    for (std::size_t i = 0; i + 2 < places.size(); i += 3)
      seen.points.emplace_back(places[i], places[i + 1], places[i + 2]);
    seen.range.resize(seen.points.size());
    seen.grid = RangeGrid(seen.points, seen.range, config_.reach, kMovedM);
    before_.push_back(std::move(seen));
  }
}

}  // namespace understory
