#include "understory/map/loop_closer.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>
#include <utility>

#include "understory/graph/loops/local_map_loop.h"
#include "understory/map/map_constants.h"
#include "understory/preprocess/voxel_filter.h"
#include "understory/util/error.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

using namespace map_constants::loop_closer;

// Everything that a search needs, of its own, so that it can run beside the scan loop.
struct Search {
  LoopCloserConfig config;
  LocalMapConfig local_map;
  PoseGraphProblem problem;
  std::size_t segment_start = 0;
  KeyframePoints* points = nullptr;
};

// Points of a keyframe in the body frame of another.
void add_points_seen_from(const Search& search, std::size_t keyframe, std::size_t from,
                          Points& all) {
  const auto& poses = search.problem.world_from_keyframe;
  const Pose here_from_there = poses[from].inverse() * poses[keyframe];
  const Eigen::Matrix3f rotation = here_from_there.rotation_matrix().cast<float>();
  const Eigen::Vector3f translation = here_from_there.translation().cast<float>();
  for (const Eigen::Vector3f& p : search.points->get(keyframe)->points)
    all.push_back(rotation * p + translation);
}

// The clouds of the keyframes around one, along the path, in its frame.
Points points_around(const Search& search, std::size_t keyframe, int reach) {
  const auto& poses = search.problem.world_from_keyframe;
  const auto r = static_cast<std::size_t>(reach);
  const std::size_t first = std::max(search.segment_start, keyframe > r ? keyframe - r : 0);
  const std::size_t last = std::min(poses.size() - 1, keyframe + r);
  Points all;
  for (std::size_t i = first; i <= last; ++i)
    add_points_seen_from(search, i, keyframe, all);
  return VoxelFilter().filter(all, search.config.voxel_size_m);
}

LoopAttempt attempt_of(std::size_t query, const LoopCandidate& candidate,
                       const Pose& candidate_from_query, const LoopVerification& verified) {
  LoopAttempt attempt;
  attempt.from = candidate.keyframe;
  attempt.to = static_cast<int>(query);
  attempt.verified = verified.accepted;
  attempt.reason = verified.reason;
  attempt.correction_m =
      (candidate_from_query.inverse() * verified.target_from_source).translation().norm();
  attempt.edge = {attempt.from, attempt.to, verified.target_from_source, verified.covariance};
  return attempt;
}

LoopAttempt try_loop(const Search& search, std::size_t query, const LoopCandidate& candidate) {
  const auto& poses = search.problem.world_from_keyframe;
  const auto from = static_cast<std::size_t>(candidate.keyframe);
  LoopInput input;
  input.target_points = points_around(search, from, search.config.submap_keyframes);
  input.source_points = points_around(search, query, search.config.source_keyframes);
  input.target_from_source = poses[from].inverse() * poses[query];
  input.sigma_translation_m = candidate.sigma_translation_m;
  input.sigma_rotation_rad = candidate.sigma_rotation_rad;
  input.up_in_target = poses[from].rotation().conjugate() * Eigen::Vector3d::UnitZ();
  input.up_in_source = poses[query].rotation().conjugate() * Eigen::Vector3d::UnitZ();
  return attempt_of(query, candidate, input.target_from_source,
                    verify_loop(input, search.config.verification));
}

bool worth_applying(const Search& search, const std::vector<Pose>& solved) {
  const auto& poses = search.problem.world_from_keyframe;
  for (std::size_t i = 0; i < solved.size(); ++i) {
    const Pose change = poses[i].inverse() * solved[i];
    if (change.translation().norm() > search.config.min_correction_m ||
        change.angle() > search.config.min_correction_deg * std::numbers::pi / 180.0) {
      return true;
    }
  }
  return false;
}

void make_local_map(const Search& search, LoopOutcome& outcome) {
  if (search.local_map.method != LocalMapConfig::Method::kAccumulate) return;
  std::vector<Eigen::Vector3d> positions;
  for (std::size_t i = search.segment_start; i < outcome.world_from_keyframe.size(); ++i) {
    positions.push_back(outcome.world_from_keyframe[i].translation());
  }
  outcome.local_map.emplace(search.local_map);
  outcome.inserted = keyframes_within_reach(positions, search.segment_start, search.local_map);
  for (const LocalMapInsertion& insertion : outcome.inserted) {
    const auto points = search.points->get(insertion.keyframe);
    outcome.local_map->insert({points.get(), outcome.world_from_keyframe[insertion.keyframe]},
                              insertion.forget != 0);
  }
  // Works the cells out here, so that the scan loop need not.
  static_cast<void>(outcome.local_map->snapshot());
}

// Steps 2 and 3 of P4 (38).
LoopAttempt try_in_present(const Search& search, std::size_t query, const LoopCandidate& candidate,
                           const PresentMap& present) {
  const auto& poses = search.problem.world_from_keyframe;
  const auto from = static_cast<std::size_t>(candidate.keyframe);
  LocalMapLoopInput input;
  input.local_map = &present.target;
  for (const std::size_t i : present.keyframes)
    add_points_seen_from(search, i, query, input.map_points_in_query);
  input.candidate_points =
      VoxelFilter().filter(search.points->get(from)->points, search.config.voxel_size_m);
  input.world_from_candidate = poses[from];
  input.world_from_query = poses[query];
  const Pose estimated = poses[from].inverse() * poses[query];
  return attempt_of(query, candidate, estimated,
                    register_to_local_map(input, search.config.verification));
}

// Optimises with the loops of the outcome, if there are any.
void apply_loops(Search& search, LoopOutcome& outcome) {
  for (const LoopAttempt& attempt : outcome.attempts) {
    if (attempt.verified) search.problem.loops.push_back(attempt.edge);
  }
  const bool found = std::any_of(outcome.attempts.begin(), outcome.attempts.end(),
                                 [](const LoopAttempt& attempt) { return attempt.verified; });
  if (!found) return;
  PoseGraphResult result = optimise_pose_graph(search.problem, search.config.graph);
  if (result.converged && worth_applying(search, result.world_from_keyframe))
    outcome.world_from_keyframe = std::move(result.world_from_keyframe);
}

// `abandoned` ends it at the next candidate, with whatever it has.
LoopOutcome run_search(Search search, const std::atomic<bool>& abandoned) {
  LoopOutcome outcome;
  outcome.keyframes = search.problem.world_from_keyframe.size();
  const std::size_t query = outcome.keyframes - 1;
  for (const LoopCandidate& candidate :
       find_loop_candidates(search.problem, query, search.config.search)) {
    if (abandoned) return outcome;
    if (static_cast<std::size_t>(candidate.keyframe) < search.segment_start) continue;
    outcome.attempts.push_back(try_loop(search, query, candidate));
  }
  apply_loops(search, outcome);
  if (!outcome.world_from_keyframe.empty()) make_local_map(search, outcome);
  return outcome;
}

}  // namespace

void describe(ConfigTable& table, LoopCloserConfig& config) {
  table.add("enabled", config.enabled, "look for loops and close them");
  table.section("search", [&] { describe(table, config.search); });
  table.section("verification", [&] { describe(table, config.verification); });
  table.section("graph", [&] { describe(table, config.graph); });
  table.add("submap_keyframes", config.submap_keyframes, {0, 1000}, "",
            "keyframes on each side of a candidate that make the target");
  table.add("source_keyframes", config.source_keyframes, {0, 100}, "",
            "keyframes on each side of the newest one that make the source");
  table.add("voxel_size_m", config.voxel_size_m, {0.05, 5.0}, "m",
            "voxels that thin source and target");
  table.add("handover_keyframes", config.handover_keyframes, {1, 1000}, "",
            "number of keyframes after which the result of a search is used");
  table.add("min_correction_m", config.min_correction_m, {0.0, 10.0}, "m",
            "smaller shifts are not applied until the next loop");
  table.add("min_correction_deg", config.min_correction_deg, {0.0, 180.0}, "deg",
            "smaller turns are not applied until the next loop");
}

LoopCloser::LoopCloser(const LoopCloserConfig& config, const LocalMapConfig& local_map)
    : config_(config), local_map_config_(local_map) {}

LoopCloser::~LoopCloser() {
  abandoned_ = true;
  if (running_) running_->outcome.wait();  // it uses the caller's points and work_
}

PoseGraphProblem LoopCloser::problem_of(const std::vector<Keyframe>& keyframes) const {
  PoseGraphProblem problem;
  for (std::size_t i = 0; i < keyframes.size(); ++i) {
    problem.world_from_keyframe.push_back(keyframes[i].world_from_body);
    if (i == 0) continue;
    problem.odometry.push_back({static_cast<int>(i) - 1, static_cast<int>(i),
                                keyframes[i].previous_from_this, keyframes[i].covariance});
  }
  for (const LoopAttempt& attempt : attempts_) {
    if (attempt.verified) problem.loops.push_back(attempt.edge);
  }
  return problem;
}

void LoopCloser::consider(const std::vector<Keyframe>& keyframes, std::size_t segment_start,
                          KeyframePoints& points) {
  if (config_.search.method == LoopSearchConfig::Method::kPaper || !due(keyframes)) return;
  begin(keyframes, segment_start, points);
}

bool LoopCloser::due(const std::vector<Keyframe>& keyframes) {
  if (!config_.enabled || running_) return false;
  if (!loop_search_due(last_search_, keyframes.back().stamp, config_.search)) return false;
  last_search_ = keyframes.back().stamp;
  return true;
}

std::optional<LoopOutcome> LoopCloser::close_in_present(const std::vector<Keyframe>& keyframes,
                                                        std::size_t segment_start,
                                                        KeyframePoints& points,
                                                        const PresentMap& present) {
  if (config_.search.method != LoopSearchConfig::Method::kPaper || !due(keyframes))
    return std::nullopt;
  Search search{config_, local_map_config_, problem_of(keyframes), segment_start, &points};
  LoopOutcome outcome;
  outcome.keyframes = keyframes.size();
  const std::size_t query = keyframes.size() - 1;
  for (const LoopCandidate& candidate :
       find_loop_candidates(search.problem, query, config_.search)) {
    if (static_cast<std::size_t>(candidate.keyframe) < segment_start) continue;
    outcome.attempts.push_back(try_in_present(search, query, candidate, present));
  }
  apply_loops(search, outcome);
  attempts_.insert(attempts_.end(), outcome.attempts.begin(), outcome.attempts.end());
  return outcome;
}

void LoopCloser::begin(const std::vector<Keyframe>& keyframes, std::size_t segment_start,
                       KeyframePoints& points) {
  Search search{config_, local_map_config_, problem_of(keyframes), segment_start, &points};
  running_.emplace();
  running_->keyframes = keyframes.size();
  running_->segment_start = segment_start;
  running_->outcome = std::async(std::launch::async, [this, search = std::move(search)]() mutable {
    const SideWork::Scope working(work_);
    LoopOutcome outcome;
    // One thread: the others belong to the scan loop.
    in_arena(1, [&] { outcome = run_search(std::move(search), abandoned_); });
    return outcome;
  });
}

std::optional<LoopOutcome> LoopCloser::take(std::size_t keyframes, bool wait, bool when_found,
                                            const ProgressSink& progress) {
  if (!running_) return std::nullopt;
  const bool ready =
      running_->outcome.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
  const auto due = running_->keyframes + static_cast<std::size_t>(config_.handover_keyframes);
  if (!wait && !(when_found ? ready : keyframes >= due)) return std::nullopt;
  while (running_->outcome.wait_for(kPollInterval) != std::future_status::ready)
    progress.poll();
  LoopOutcome outcome = running_->outcome.get();
  running_.reset();
  attempts_.insert(attempts_.end(), outcome.attempts.begin(), outcome.attempts.end());
  return outcome;
}

PoseGraphResult LoopCloser::optimise(const std::vector<Keyframe>& keyframes) const {
  const PoseGraphProblem problem = problem_of(keyframes);
  if (problem.loops.empty()) return {};
  return optimise_pose_graph(problem, config_.graph);
}

void LoopCloser::save(BinaryWriter& writer) const {
  writer.put(last_search_);
  writer.put(running_.has_value());
  if (!running_) return;
  writer.put(running_->keyframes);
  writer.put(running_->segment_start);
}

void LoopCloser::load(BinaryReader& reader, std::vector<LoopAttempt> attempts,
                      const std::vector<Keyframe>& keyframes, KeyframePoints& points) {
  attempts_ = std::move(attempts);
  last_search_ = reader.get<TimeNs>();
  if (!reader.get<bool>()) return;
  const auto known = reader.get<std::uint64_t>();
  const auto segment_start = reader.get<std::uint64_t>();
  if (known == 0 || known > keyframes.size() || segment_start >= known)
    throw InputError("checkpoint", "", "expected a search among keyframes that are there");
  // Keyframes do not move while a search runs (a levelling of the world waits for it), so the first
  // ones are what it began with.
  begin({keyframes.begin(), keyframes.begin() + static_cast<std::ptrdiff_t>(known)}, segment_start,
        points);
}

}  // namespace understory
