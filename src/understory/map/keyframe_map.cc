#include "understory/map/keyframe_map.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "understory/geometry/pose_io.h"
#include "understory/util/error.h"

namespace understory {

void describe(ConfigTable& table, KeyframeConfig& config) {
  table.add("distance_m", config.distance_m, {0.0, 100.0}, "m",
            "weighted distance (37) after which a scan becomes a keyframe");
  table.add("rotation_as_metre_deg", config.rotation_as_metre_deg, {0.1, 360.0}, "deg",
            "rotation that counts as one metre in (37)");
}

double keyframe_distance(const Pose& world_from_last, const Pose& world_from_current,
                         const KeyframeConfig& config) {
  Vector6d difference = right_difference(world_from_current, world_from_last);
  difference.head<3>() *= 180.0 / std::numbers::pi / config.rotation_as_metre_deg;
  return difference.norm();
}

KeyframePoints::KeyframePoints(const std::filesystem::path& file, std::size_t keep,
                               std::size_t cached)
    : clouds_(file, keep), cached_(cached) {}

void KeyframePoints::append(TimeNs stamp, const Points& points) {
  KeyframeCloud cloud{static_cast<std::int32_t>(clouds_.size()), stamp, {}};
  cloud.points.reserve(points.size());
  for (const Eigen::Vector3f& p : points)
    cloud.points.push_back({p.x(), p.y(), p.z(), 0, 0});
  remember(clouds_.size(), std::make_shared<const Points>(points));
  clouds_.append(cloud);
}

std::shared_ptr<const Points> KeyframePoints::get(std::size_t keyframe) {
  const auto found = cache_.find(keyframe);
  if (found != cache_.end()) {
    found->second.used = ++uses_;
    return found->second.points;
  }
  const KeyframeCloud cloud = clouds_.read(keyframe);
  Points points;
  points.reserve(cloud.points.size());
  for (const KeyframePoint& p : cloud.points)
    points.emplace_back(p.x, p.y, p.z);
  auto shared = std::make_shared<const Points>(std::move(points));
  remember(keyframe, shared);
  return shared;
}

void KeyframePoints::remember(std::size_t keyframe, std::shared_ptr<const Points> points) {
  cache_[keyframe] = {std::move(points), ++uses_};
  if (cache_.size() <= cached_) return;
  const auto oldest =
      std::min_element(cache_.begin(), cache_.end(),
                       [](const auto& a, const auto& b) { return a.second.used < b.second.used; });
  cache_.erase(oldest);
}

void KeyframeMap::describe(ConfigTable& table, Config& config) {
  table.section("keyframe", [&] { understory::describe(table, config.keyframe); });
  table.section("local_map", [&] { understory::describe(table, config.local_map); });
  table.section("odometry_edge", [&] {
    table.add("rotation_deg_per_sqrt_m", config.edge_rotation_deg_per_sqrt_m, {1e-6, 10.0},
              "deg/sqrt(m)", "noise of the odometry between keyframes");
    table.add("translation_m_per_sqrt_m", config.edge_translation_m_per_sqrt_m, {1e-6, 10.0},
              "m/sqrt(m)", "noise of the odometry between keyframes");
  });
}

KeyframeMap::KeyframeMap(const Config& config, const std::filesystem::path& folder,
                         StageTimes& times, Log& log)
    : config_(config), folder_(folder), times_(times), log_(log), local_map_(config.local_map) {}

namespace {
constexpr std::size_t kCachedKeyframes = 300;
constexpr const char* kPointsFile = "keyframe_points.bin";
}  // namespace

void KeyframeMap::start() {
  points_ = std::make_unique<KeyframePoints>(folder_ / kPointsFile, 0, kCachedKeyframes);
}

bool KeyframeMap::wants(const Pose& world_from_body) const {
  if (keyframes_.size() == segment_start_) return true;
  return keyframe_distance(keyframes_.back().world_from_body, world_from_body, config_.keyframe) >=
         config_.keyframe.distance_m;
}

std::optional<Pose> KeyframeMap::add(TimeNs stamp, const Pose& world_from_body,
                                     const Points& points_in_body) {
  const ScopedTimer timer(times_, "keyframe");
  Keyframe keyframe;
  keyframe.stamp = stamp;
  keyframe.world_from_body = world_from_body;
  double length = 0.0;
  if (!keyframes_.empty()) {
    keyframe.previous_from_this = keyframes_.back().world_from_body.inverse() * world_from_body;
    length = keyframe.previous_from_this.translation().norm();
  }
  // A new segment hangs on a prediction over an outage: its edge says almost nothing.
  const bool joined = keyframes_.size() != segment_start_;
  const double grown = std::sqrt(std::max(length, 0.1)) * (joined ? 1.0 : 1e3);
  const double rotation = grown * config_.edge_rotation_deg_per_sqrt_m * std::numbers::pi / 180.0;
  const double translation = grown * config_.edge_translation_m_per_sqrt_m;
  Vector6d variances;
  variances << Eigen::Vector3d::Constant(rotation * rotation),
      Eigen::Vector3d::Constant(translation * translation);
  keyframe.covariance = variances.asDiagonal();
  keyframes_.push_back(keyframe);
  points_->append(stamp, points_in_body);
  update_local_map(keyframes_.size() - 1);
  return std::nullopt;
}

void KeyframeMap::update_local_map(std::size_t keyframe) {
  if (config_.local_map.method == LocalMapConfig::Method::kRecent) {
    rebuild_local_map();
    return;
  }
  inserted_.push_back({keyframe, 1});
  local_map_.insert({points_->get(keyframe).get(), keyframes_[keyframe].world_from_body}, true);
  snapshot_ = local_map_.snapshot();
}

// Chooses the keyframes of the local map anew, e.g. after a loop closure has moved them.
void KeyframeMap::rebuild_local_map() {
  std::vector<Eigen::Vector3d> positions;
  for (std::size_t i = segment_start_; i < keyframes_.size(); ++i) {
    positions.push_back(keyframes_[i].world_from_body.translation());
  }
  inserted_.clear();
  if (config_.local_map.method == LocalMapConfig::Method::kRecent) {
    for (const std::size_t i : recent_keyframes(positions, config_.local_map)) {
      inserted_.push_back({segment_start_ + i, 0});
    }
  } else {
    for (std::size_t i = 0; i < positions.size(); ++i) {
      const double distance = (positions[i] - positions.back()).norm();
      if (distance < config_.local_map.radius_m) inserted_.push_back({segment_start_ + i, 0});
    }
    inserted_.back().forget = 1;
  }
  insert_all();
}

void KeyframeMap::insert_all() {
  local_map_.clear();
  for (const Insertion& insertion : inserted_) {
    const auto points = points_->get(insertion.keyframe);
    local_map_.insert({points.get(), keyframes_[insertion.keyframe].world_from_body},
                      insertion.forget != 0);
  }
  snapshot_ = inserted_.empty() ? std::vector<NdtMapPtr>{} : local_map_.snapshot();
}

void KeyframeMap::start_segment() {
  segment_start_ = keyframes_.size();
  inserted_.clear();
  insert_all();
}

void KeyframeMap::move_world(const Pose& new_world_from_old_world) {
  for (Keyframe& keyframe : keyframes_) {
    keyframe.world_from_body = new_world_from_old_world * keyframe.world_from_body;
  }
  if (!snapshot_.empty()) rebuild_local_map();
}

void KeyframeMap::flush() {
  points_->flush();
}

void KeyframeMap::save(BinaryWriter& writer) const {
  writer.put(static_cast<std::uint64_t>(keyframes_.size()));
  for (const Keyframe& keyframe : keyframes_) {
    writer.put(keyframe.stamp);
    put_pose(writer, keyframe.world_from_body);
    put_pose(writer, keyframe.previous_from_this);
    writer.put_doubles(keyframe.covariance.data(), 36);
  }
  writer.put(static_cast<std::uint64_t>(segment_start_));
  writer.put(inserted_);
}

void KeyframeMap::load(BinaryReader& reader) {
  keyframes_.resize(reader.get<std::uint64_t>());
  for (Keyframe& keyframe : keyframes_) {
    keyframe.stamp = reader.get<TimeNs>();
    keyframe.world_from_body = get_pose(reader);
    keyframe.previous_from_this = get_pose(reader);
    reader.get_doubles(keyframe.covariance.data(), 36);
  }
  segment_start_ = reader.get<std::uint64_t>();
  inserted_ = reader.get_vector<Insertion>();
  points_ =
      std::make_unique<KeyframePoints>(folder_ / kPointsFile, keyframes_.size(), kCachedKeyframes);
  insert_all();
}

}  // namespace understory
