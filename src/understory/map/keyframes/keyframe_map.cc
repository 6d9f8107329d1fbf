#include "understory/map/keyframes/keyframe_map.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "understory/geometry/pose_io.h"
#include "understory/map/map_constants.h"
#include "understory/util/error.h"
#include "understory/util/timing.h"

namespace understory {

void describe(ConfigTable& table, KeyframeConfig& config) {
  table.add(
      "distance_m", config.distance_m, {0.0, 100.0}, "m",
      "distance after which a scan becomes a keyframe; turns count too, see the next setting");
  table.add("rotation_as_metre_deg", config.rotation_as_metre_deg, {0.1, 360.0}, "deg",
            "rotation that counts as one metre of this distance");
  table.add("voxel_size_m", config.voxel_size_m, {0.0, 5.0}, "m",
            "edge of the voxels that thin a keyframe's points; 0: it keeps all of them");
  table.add("below_found_share", config.below_found_share, {0.0, 1.0}, "",
            "a scan that finds less than this share of what is usual in the map becomes a "
            "keyframe, too; of sparse scans 0.75, 0: none");
  table.add("above_fitness_m2", config.above_fitness_m2, {0.0, 100.0}, "m^2",
            "a scan whose matched points lie farther from the map than this, squared, in the mean, "
            "becomes a keyframe, too; 0: none");
  table.add("max_fitness_m2", config.max_fitness_m2, {0.0, 100.0}, "m^2",
            "a scan whose matched points lie farther from the map than this, squared, in the mean, "
            "becomes no keyframe; 0: all may");
}

double keyframe_distance(const Pose& world_from_last, const Pose& world_from_current,
                         const KeyframeConfig& config) {
  Vector6d difference = right_difference(world_from_current, world_from_last);
  difference.head<3>() *= 180.0 / std::numbers::pi / config.rotation_as_metre_deg;
  return difference.norm();
}

void KeyframeMap::describe(ConfigTable& table, Config& config) {
  table.section("keyframe", [&] { understory::describe(table, config.keyframe); });
  table.section("local_map", [&] { understory::describe(table, config.local_map); });
  table.section("loop_closure", [&] { understory::describe(table, config.loop_closure); });
  table.section("first_keyframes", [&] { understory::describe(table, config.first_keyframes); });
  table.section("range_check", [&] { understory::describe(table, config.range_check); });
  table.section("odometry_edge", [&] {
    table.add("rotation_deg", config.edge_rotation_deg, {0.0, 10.0}, "deg",
              "noise of the odometry between keyframes, however near");
    table.add("translation_m", config.edge_translation_m, {0.0, 10.0}, "m",
              "noise of the odometry between keyframes, however near");
    table.add("rotation_deg_per_sqrt_m", config.edge_rotation_deg_per_sqrt_m, {1e-6, 10.0},
              "deg/sqrt(m)", "noise of the odometry between keyframes");
    table.add("translation_m_per_sqrt_m", config.edge_translation_m_per_sqrt_m, {1e-6, 10.0},
              "m/sqrt(m)", "noise of the odometry between keyframes");
  });
}

KeyframeMap::KeyframeMap(const Config& config, const std::filesystem::path& folder,
                         StageTimes& times, Log& log)
    : config_(config),
      folder_(folder),
      times_(times),
      log_(log),
      local_map_(config.local_map),
      loops_(config.loop_closure, config.local_map, config.one_local_map) {}

namespace {

constexpr const char* kPointsFile = "keyframe_points.bin";
}  // namespace

void KeyframeMap::start() {
  keyframes_.clear();
  returning_ = {};
  segment_starts_ = {0};
  joined_ = 0;
  inserted_.clear();
  insert_all();
  moved_ = false;
  points_ = std::make_unique<KeyframePoints>(folder_ / kPointsFile, config_.cached_keyframes);
  history_ = std::make_unique<KeyframeHistory>(folder_);
}

bool KeyframeMap::wants(const KeyframeOffer& offer) const {
  if (keyframes_.size() == segment_start()) return true;
  const KeyframeConfig& config = config_.keyframe;
  if (config.max_fitness_m2 > 0.0 && offer.fitness_m2 > config.max_fitness_m2) return false;
  if (offer.found_share < config.below_found_share) return true;
  if (config.above_fitness_m2 > 0.0 && offer.fitness_m2 > config.above_fitness_m2) return true;
  return keyframe_distance(keyframes_.back().world_from_body, offer.world_from_body, config) >=
         config.distance_m;
}

std::optional<Pose> KeyframeMap::add(TimeNs stamp, const KeyframeOffer& offer,
                                     const FeaturePoints& points_in_body) {
  const ScopedTimer timer(times_, "keyframe");
  std::optional<Pose> moved;
  if (auto outcome = loops_.take(keyframes_.size(), false, takes_loops_when_found_)) {
    moved = take_over(std::move(*outcome));
  }
  Keyframe keyframe;
  keyframe.stamp = stamp;
  keyframe.world_from_body = moved ? *moved * offer.world_from_body : offer.world_from_body;
  if (!keyframes_.empty()) {
    keyframe.previous_from_this =
        keyframes_.back().world_from_body.inverse() * keyframe.world_from_body;
  }
  keyframe.covariance = edge_covariance(keyframe.previous_from_this) + offer.covariance;
  keyframe.begins_piece = !keyframes_.empty() && keyframes_.size() == segment_start();
  keyframes_.push_back(keyframe);
  returning_.add(offer.held);
  points_->append(stamp, points_in_body);
  if (const auto again = close_in_present()) return moved ? *again * *moved : *again;
  update_local_map(keyframes_.size() - 1);
  loops_.consider(keyframes_, segment_starts_, *points_);
  return moved;
}

// The newest keyframe is not in the local map yet. If the world moves, the map is built anew with
// it.
std::optional<Pose> KeyframeMap::close_in_present() {
  if (snapshot_ == nullptr) return std::nullopt;
  PresentMap present{*snapshot_, {}};
  for (const LocalMapInsertion& insertion : inserted_)
    present.keyframes.push_back(insertion.keyframe);
  auto outcome = loops_.close_in_present(keyframes_, segment_starts_, *points_, present);
  return outcome ? take_over(std::move(*outcome)) : std::nullopt;
}

Matrix6d KeyframeMap::edge_covariance(const Pose& previous_from_this) const {
  // A new segment hangs on a prediction over an outage: its edge says almost nothing.
  const bool joined = keyframes_.size() != segment_start();
  const double length = std::max(previous_from_this.translation().norm(), 0.1);
  const double scale = joined ? 1.0 : 1e3;
  const double grown = std::sqrt(length) * scale;
  const double degree = std::numbers::pi / 180.0;
  const double rotation = grown * config_.edge_rotation_deg_per_sqrt_m * degree;
  const double translation = grown * config_.edge_translation_m_per_sqrt_m;
  const double min_rotation = scale * config_.edge_rotation_deg * degree;
  const double min_translation = scale * config_.edge_translation_m;
  Vector6d variances;
  variances << Eigen::Vector3d::Constant(rotation * rotation + min_rotation * min_rotation),
      Eigen::Vector3d::Constant(translation * translation + min_translation * min_translation);
  return variances.asDiagonal();
}

// Applies new poses of the keyframes that the search knew; those added since move along rigidly,
// and so does the present (P0 (20)).
std::optional<Pose> KeyframeMap::take_over(LoopOutcome outcome) {
  for (const LoopAttempt& attempt : outcome.attempts) {
    log_.debug(fmt::format("loop {} - {}: {}", attempt.from, attempt.to,
                           attempt.verified
                               ? fmt::format("fits, {:.3f} m off", attempt.correction_m)
                               : attempt.reason));
  }
  if (outcome.world_from_keyframe.empty()) return std::nullopt;
  tell_of_joined_pieces();
  moved_ = true;
  const std::size_t known = outcome.keyframes;
  const Pose moved =
      outcome.world_from_keyframe[known - 1] * keyframes_[known - 1].world_from_body.inverse();
  for (std::size_t i = 0; i < keyframes_.size(); ++i) {
    keyframes_[i].world_from_body =
        i < known ? outcome.world_from_keyframe[i] : moved * keyframes_[i].world_from_body;
  }
  // A search that began in the piece before has made a map of that.
  if (!(outcome.local_map || outcome.map_begins_at) || known <= segment_start()) {
    rebuild_local_map();
    give_back();
    return moved;
  }
  take_local_map(outcome);
  for (std::size_t i = std::max(known, segment_start()); i < keyframes_.size(); ++i) {
    insert(i);
  }
  returning_.note_made_anew(inserted_);
  take_snapshot();
  give_back();
  return moved;
}

// What the search and the map before have left goes back to the system beside the scan loop. Where
// no thread is to be had it stays.
void KeyframeMap::give_back() {
  try {
    giving_back_ = std::async(std::launch::async, return_freed_memory);
  } catch (const std::system_error& e) {
    log_.debug(fmt::format("memory is not given back: {}", e.what()));
  }
}

// The map that the search made, or the same one, made in the place of the present one.
void KeyframeMap::take_local_map(LoopOutcome& outcome) {
  if (outcome.local_map) {
    local_map_ = std::move(*outcome.local_map);
    inserted_ = std::move(outcome.inserted);
    return;
  }
  std::vector<Eigen::Vector3d> positions;
  for (std::size_t i = *outcome.map_begins_at; i < outcome.keyframes; ++i)
    positions.push_back(keyframes_[i].world_from_body.translation());
  inserted_ = keyframes_within_reach(positions, *outcome.map_begins_at, local_map_.radius_m());
  insert_all();
}

void KeyframeMap::tell_of_joined_pieces() {
  const MapPieces now = pieces();
  const std::size_t joined = now.count() - now.groups();
  if (joined == joined_) return;
  joined_ = joined;
  log_.warn("map.joined",
            fmt::format("{} of {} pieces of the map were found again in others and are joined to "
                        "them: places in them are the same",
                        joined, now.count()));
}

void KeyframeMap::finish(const ProgressSink& progress) {
  if (keyframes_.empty()) return;
  if (auto outcome = loops_.take(keyframes_.size(), true, true, progress)) {
    static_cast<void>(take_over(std::move(*outcome)));
  }
  if (loops_.join_left(keyframes_, segment_starts_, *points_, progress)) tell_of_joined_pieces();
  const PoseGraphResult result = loops_.optimise(keyframes_, segment_starts_);
  loops_used_.assign(loops_.attempts().size(), 0);
  const std::vector<char> counted = loops_.counted(pieces());
  std::size_t k = 0;
  for (std::size_t i = 0; i < loops_used_.size(); ++i) {
    if (counted[i] != 0) loops_used_[i] = result.loop_used[k++];
  }
  for (std::size_t i = 0; i < result.world_from_keyframe.size(); ++i) {
    keyframes_[i].world_from_body = result.world_from_keyframe[i];
  }
  snapshot_.reset();
  local_map_.clear();
  if (config_.first_keyframes.enabled) refine_first_keyframes_of_segments(progress);
  points_->forget();
  return_freed_memory();
}

void KeyframeMap::refine_first_keyframes_of_segments(const ProgressSink& progress) {
  for (std::size_t s = 0; s < segment_starts_.size(); ++s) {
    const std::size_t first = segment_starts_[s];
    const bool is_last = s + 1 == segment_starts_.size();
    const std::size_t end = is_last ? keyframes_.size() : segment_starts_[s + 1];
    const std::vector<Pose> refined = refine_first_keyframes(
        std::span(keyframes_).subspan(first, end - first),
        [&](std::size_t i) {
          progress.poll();
          return points_->get(first + i);
        },
        config_.local_map, config_.first_keyframes);
    if (refined.empty()) continue;
    for (std::size_t i = 0; i < refined.size(); ++i)
      keyframes_[first + i].world_from_body = refined[i];
    for (std::size_t i = std::max<std::size_t>(first, 1); i <= first + refined.size(); ++i) {
      keyframes_[i].previous_from_this =
          keyframes_[i - 1].world_from_body.inverse() * keyframes_[i].world_from_body;
    }
  }
}

void KeyframeMap::update_local_map(std::size_t keyframe) {
  if (config_.local_map.method == LocalMapConfig::Method::kRecent) {
    rebuild_local_map();
    return;
  }
  insert(keyframe);
  for (const std::size_t back :
       returning_.take(keyframes_, local_map_start(), local_map_.radius_m()))
    insert(back, false);
  take_snapshot();
}

// The old one goes first, so that the new one is written in its place.
void KeyframeMap::take_snapshot() {
  snapshot_.reset();
  snapshot_ = local_map_.snapshot();
}

void KeyframeMap::insert(std::size_t keyframe) {
  insert(keyframe, keyframe % kForgetEvery == 0);
}

void KeyframeMap::insert(std::size_t keyframe, bool forget) {
  snapshot_.reset();  // so that the map need not copy what it forgets of
  inserted_.push_back({keyframe, forget ? 1U : 0U});
  local_map_.insert({points_->get(keyframe).get(), keyframes_[keyframe].world_from_body}, forget);
  tell_of_radius();
}

// The pieces that are together with the last one, as far as they follow each other.
std::size_t KeyframeMap::local_map_start() const {
  if (segment_start() == keyframes_.size()) return segment_start();
  return pieces().last_group_start();
}

void KeyframeMap::tell_of_radius() {
  const double radius_m = local_map_.radius_m();
  if (told_of_radius_ || radius_m >= config_.local_map.radius_m) return;
  told_of_radius_ = true;
  log_.warn("memory.radius",
            fmt::format("the local map does not fit into run.max_memory_mb: it ends {:.0f} m from "
                        "the lidar, not {:.0f} m (local_map.radius_m), from keyframe {} on. Poses "
                        "may differ from those without a limit",
                        radius_m, config_.local_map.radius_m, keyframes_.size()));
}

// Chooses the keyframes of the local map anew, e.g. after a loop closure has moved them.
void KeyframeMap::rebuild_local_map() {
  const std::size_t first = local_map_start();
  std::vector<Eigen::Vector3d> positions;
  for (std::size_t i = first; i < keyframes_.size(); ++i) {
    positions.push_back(keyframes_[i].world_from_body.translation());
  }
  inserted_.clear();
  if (config_.local_map.method == LocalMapConfig::Method::kRecent) {
    for (const std::size_t i : recent_keyframes(positions, config_.local_map)) {
      inserted_.push_back({first + i, 0});
    }
  } else {
    inserted_ = keyframes_within_reach(positions, first, local_map_.radius_m());
    returning_.note_made_anew(inserted_);
  }
  insert_all();
}

void KeyframeMap::insert_all() {
  snapshot_.reset();
  local_map_.clear();
  for (const LocalMapInsertion& insertion : inserted_) {
    const auto points = points_->get(insertion.keyframe);
    local_map_.insert({points.get(), keyframes_[insertion.keyframe].world_from_body},
                      insertion.forget != 0);
  }
  if (!inserted_.empty()) take_snapshot();
}

void KeyframeMap::start_segment() {
  if (segment_start() != keyframes_.size()) segment_starts_.push_back(keyframes_.size());
  inserted_.clear();
  insert_all();
}

RangeCheck KeyframeMap::check_ranges(const Eigen::Vector3d& lidar_in_body,
                                     const ProgressSink& progress) const {
  const auto points_of = [&](std::size_t i) {
    progress.poll();
    const std::shared_ptr<const FeaturePoints> cloud = points_->get(i);
    return std::shared_ptr<const Points>(cloud, &cloud->points);
  };
  const RangeCheck check = understory::check_ranges(keyframes_, segment_starts_, points_of,
                                                    lidar_in_body, config_.range_check);
  points_->forget();
  return check;
}

std::vector<char> KeyframeMap::graph_loops_used() const {
  std::vector<char> used;
  const std::vector<char> counted = loops_.counted(pieces());
  for (std::size_t i = 0; i < loops_used_.size(); ++i) {
    if (counted[i] != 0) used.push_back(loops_used_[i]);
  }
  return used;
}

MapPieces KeyframeMap::pieces() const {
  return loops_.pieces_of(keyframes_, segment_starts_);
}

MapPieces KeyframeMap::finished_pieces() const {
  MapPieces joined = pieces_among(segment_starts_, keyframes_.size());
  for (std::size_t i = 0; i < loops_used_.size(); ++i) {
    const LoopAttempt& attempt = loops_.attempts()[i];
    if (loops_used_[i] == 0) continue;
    joined.join(joined.piece_of(static_cast<std::size_t>(attempt.from)),
                joined.piece_of(static_cast<std::size_t>(attempt.to)));
  }
  return joined;
}

void KeyframeMap::set_poses(const std::vector<Pose>& world_from_keyframe) {
  UNDERSTORY_CHECK(world_from_keyframe.size() == keyframes_.size() && snapshot_ == nullptr);
  for (std::size_t i = 0; i < keyframes_.size(); ++i)
    keyframes_[i].world_from_body = world_from_keyframe[i];
}

std::optional<Pose> KeyframeMap::level(const Pose& turn, const Pose& world_from_body) {
  // What a running search finds refers to the world before the turn, so it is applied first.
  std::optional<Pose> found;
  if (auto outcome = loops_.take(keyframes_.size(), true, true))
    found = take_over(std::move(*outcome));
  std::optional<Pose> back;
  if (found) back = turn * *found * turn.inverse();
  const std::size_t first = segment_start();
  if (first > 0) {
    const Pose body = back.value_or(Pose()) * world_from_body;
    const Eigen::Vector3d pivot = first < keyframes_.size()
                                      ? keyframes_[first].world_from_body.translation()
                                      : turn.inverse() * body.translation();
    const Pose held(Eigen::Quaterniond::Identity(), pivot - turn * pivot);
    back = held * back.value_or(Pose());
    level_from(first, held * turn);
  } else {
    level_from(0, turn);
  }
  return back;
}

void KeyframeMap::level_from(std::size_t first, const Pose& new_world_from_old_world) {
  moved_ = true;
  for (std::size_t i = first; i < keyframes_.size(); ++i)
    keyframes_[i].world_from_body = new_world_from_old_world * keyframes_[i].world_from_body;
  if (snapshot_ != nullptr) rebuild_local_map();
}

void KeyframeMap::sync() {
  points_->sync();
  history_->sync(keyframes_, segment_starts_, loops_.attempts(), std::exchange(moved_, false));
}

std::vector<CountedFile> KeyframeMap::files() const {
  std::vector<CountedFile> files = history_->files();
  files.push_back({kPointsFile, points_->count()});
  return files;
}

void KeyframeMap::save(BinaryWriter& writer) const {
  history_->save(writer);
  writer.put(points_->count());
  writer.put(local_map_.first_radius_m());
  put_insertions(writer, inserted_);
  returning_.save(writer);
  loops_.save(writer);
}

void KeyframeMap::load(BinaryReader& reader) {
  KeyframeGrowth growth;
  history_ = std::make_unique<KeyframeHistory>(folder_, reader, growth);
  keyframes_ = std::move(growth.keyframes);
  segment_starts_ = std::move(growth.segment_starts);
  for (const std::uint64_t start : segment_starts_) {
    if (start > 0 && start < keyframes_.size()) keyframes_[start].begins_piece = true;
  }
  points_ = std::make_unique<KeyframePoints>(folder_ / kPointsFile, reader.get<RecordCount>(),
                                             config_.cached_keyframes);
  const auto first_radius_m = reader.get<double>();
  if (points_->count().records != keyframes_.size())
    throw InputError((folder_ / kPointsFile).string(), "", "expected the points of each keyframe");
  local_map_.set_radius(first_radius_m);
  inserted_ = get_insertions(reader, keyframes_.size());
  returning_.load(reader, keyframes_.size());
  insert_all();
  loops_.load(reader, std::move(growth.loops), keyframes_, segment_starts_, *points_);
  const MapPieces known = pieces();
  joined_ = known.count() - known.groups();
}

}  // namespace understory
