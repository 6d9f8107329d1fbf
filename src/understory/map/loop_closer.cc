#include "understory/map/loop_closer.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>
#include <utility>

#include "understory/graph/loops/local_map_loop.h"
#include "understory/graph/loops/place_again.h"
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
  SearchedMap map;
  LoopAgreement* agreement = nullptr;  // no other search uses it at the time
  std::vector<char> decided;           // of the first loops of the map's graph
  bool leave_map = false;
};

Eigen::Vector3d up_at(const SearchedMap& map, std::size_t keyframe) {
  return map.problem.world_from_keyframe[keyframe].rotation().conjugate() *
         Eigen::Vector3d::UnitZ();
}

LoopAttempt try_loop(const Search& search, std::size_t query, const LoopCandidate& candidate) {
  const SearchedMap& map = search.map;
  const auto& poses = map.problem.world_from_keyframe;
  const LoopCloserConfig& config = search.config;
  const auto from = static_cast<std::size_t>(candidate.keyframe);
  LoopInput input;
  input.target_points = points_around(map, from, config.submap_keyframes, config.voxel_size_m);
  input.source_points = points_around(map, query, config.source_keyframes, config.voxel_size_m);
  input.target_from_source = poses[from].inverse() * poses[query];
  input.sigma_translation_m = candidate.sigma_translation_m;
  input.sigma_rotation_rad = candidate.sigma_rotation_rad;
  input.up_in_target = up_at(map, from);
  input.up_in_source = up_at(map, query);
  return attempt_of(from, query, input.target_from_source, verify_loop(input, config.verification));
}

UnplacedCloud unplaced_around(const Search& search, std::size_t keyframe) {
  const LoopCloserConfig& config = search.config;
  return make_unplaced(
      points_around(search.map, keyframe, config.pieces.keyframes, config.voxel_size_m),
      up_at(search.map, keyframe));
}

// Whether two places of pieces that are apart are one.
LoopAttempt try_places(const Search& search, const PiecePlaces& pair) {
  const auto& poses = search.map.problem.world_from_keyframe;
  return attempt_of(
      pair.older, pair.newer, poses[pair.older].inverse() * poses[pair.newer],
      verify_place_again(unplaced_around(search, pair.older), unplaced_around(search, pair.newer),
                         search.config.verification));
}

// Which keyframes a loop with `query` may lead to: those whose pose against it is known. Empty:
// all.
std::vector<char> known_against(const MapPieces& pieces, std::size_t query) {
  if (pieces.groups() == 1) return {};
  std::vector<char> known(pieces.end(pieces.count() - 1), 0);
  for (std::size_t k = 0; k < known.size(); ++k)
    known[k] = pieces.connected(k, query) ? 1 : 0;
  return known;
}

bool worth_applying(const Search& search, const std::vector<Pose>& solved) {
  const auto& poses = search.map.problem.world_from_keyframe;
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
  const std::size_t first = search.map.pieces.last_group_start();
  if (search.leave_map) {
    outcome.map_begins_at = first;
    return;
  }
  std::vector<Eigen::Vector3d> positions;
  for (std::size_t i = first; i < outcome.world_from_keyframe.size(); ++i) {
    positions.push_back(outcome.world_from_keyframe[i].translation());
  }
  outcome.local_map.emplace(search.local_map);
  outcome.inserted = keyframes_within_reach(positions, first, search.local_map.radius_m);
  for (const LocalMapInsertion& insertion : outcome.inserted) {
    const auto points = search.map.points->get(insertion.keyframe);
    outcome.local_map->insert({points.get(), outcome.world_from_keyframe[insertion.keyframe]},
                              insertion.forget != 0);
  }
  // Works the cells out here, so that the scan loop need not.
  static_cast<void>(outcome.local_map->snapshot());
}

// Steps 2 and 3 of P4 (38).
LoopAttempt try_in_present(const Search& search, std::size_t query, const LoopCandidate& candidate,
                           const PresentMap& present) {
  const auto& poses = search.map.problem.world_from_keyframe;
  const auto from = static_cast<std::size_t>(candidate.keyframe);
  LocalMapLoopInput input;
  input.local_map = &present.target;
  for (const std::size_t i : present.keyframes)
    add_points_seen_from(search.map, i, query, input.map_points_in_query);
  input.candidate_points =
      VoxelFilter().filter(search.map.points->get(from)->points, search.config.voxel_size_m);
  input.world_from_candidate = poses[from];
  input.world_from_query = poses[query];
  const Pose estimated = poses[from].inverse() * poses[query];
  return attempt_of(from, query, estimated,
                    register_to_local_map(input, search.config.verification));
}

JoinConfig join_config(const LoopCloserConfig& config) {
  return {config.pieces.min_apart_m, config.graph};
}

// Lays pieces together that the loops of the outcome join. Whether there were any.
bool join_by_outcome(Search& search, const LoopOutcome& outcome) {
  SearchedMap& map = search.map;
  if (map.pieces.groups() == 1) return false;
  map.attempts.insert(map.attempts.end(), outcome.attempts.begin(), outcome.attempts.end());
  JoinedPieces now =
      join_pieces(map.pieces, map.problem.odometry, map.attempts, join_config(search.config));
  if (now.joins.empty()) return false;
  lay_together(map.pieces, now, map.attempts, map.problem.world_from_keyframe);
  map.problem = graph_problem(std::move(map.problem), now.pieces, map.attempts);
  map.pieces = std::move(now.pieces);
  return true;
}

// Optimises with the loops of the outcome, if there are any that count.
void apply_loops(Search& search, LoopOutcome& outcome) {
  const bool joined = join_by_outcome(search, outcome);
  bool found = joined;
  for (const LoopAttempt& attempt : outcome.attempts) {
    if (joined || !attempt.verified || !counts(attempt, search.map.pieces)) continue;
    search.map.problem.loops.push_back(attempt.edge);
    found = true;
  }
  if (!found) return;
  // Pieces that are joined bring loops of their own, between those that are known.
  if (joined) search.decided.clear();
  PoseGraphResult result = optimise_pose_graph(search.map.problem, search.config.graph,
                                               search.agreement, search.decided);
  if (result.converged) outcome.decided = result.loop_used;
  if (result.converged && (joined || worth_applying(search, result.world_from_keyframe)))
    outcome.world_from_keyframe = std::move(result.world_from_keyframe);
}

// `abandoned` ends it at the next candidate, with whatever it has.
LoopOutcome run_search(Search search, const std::atomic<bool>& abandoned) {
  LoopOutcome outcome;
  const SearchedMap& map = search.map;
  outcome.keyframes = map.problem.world_from_keyframe.size();
  const std::size_t query = outcome.keyframes - 1;
  for (const LoopCandidate& candidate : find_loop_candidates(
           map.problem, query, search.config.search, known_against(map.pieces, query))) {
    if (abandoned) return outcome;
    outcome.attempts.push_back(try_loop(search, query, candidate));
  }
  if (search.config.pieces.enabled && map.pieces.groups() > 1) {
    for (const PiecePlaces& pair : places_to_try(map.problem.world_from_keyframe, map.pieces,
                                                 map.attempts, query, search.config.pieces)) {
      if (abandoned) return outcome;
      outcome.attempts.push_back(try_places(search, pair));
    }
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
  table.section("pieces", [&] { describe(table, config.pieces); });
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

LoopCloser::LoopCloser(const LoopCloserConfig& config, const LocalMapConfig& local_map,
                       bool leave_map)
    : config_(config),
      local_map_config_(local_map),
      leave_map_(leave_map),
      agreement_(std::make_unique<LoopAgreement>(config.graph)) {}

LoopCloser::~LoopCloser() {
  abandoned_ = true;
  if (running_) running_->outcome.wait();  // it uses the caller's points and work_
}

MapPieces LoopCloser::pieces_of(const std::vector<Keyframe>& keyframes,
                                const std::vector<std::uint64_t>& piece_starts) const {
  MapPieces apart = pieces_among(piece_starts, keyframes.size());
  if (apart.count() == 1) return apart;
  return join_pieces(std::move(apart), odometry_of(keyframes), attempts_, join_config(config_))
      .pieces;
}

PoseGraphProblem LoopCloser::problem_of(const std::vector<Keyframe>& keyframes,
                                        const std::vector<std::uint64_t>& piece_starts) const {
  PoseGraphProblem problem;
  for (const Keyframe& keyframe : keyframes)
    problem.world_from_keyframe.push_back(keyframe.world_from_body);
  problem.odometry = odometry_of(keyframes);
  return graph_problem(std::move(problem), pieces_of(keyframes, piece_starts), attempts_);
}

std::vector<char> LoopCloser::counted(const MapPieces& pieces) const {
  std::vector<char> counted;
  for (const LoopAttempt& attempt : attempts_)
    counted.push_back(attempt.verified && counts(attempt, pieces) ? 1 : 0);
  return counted;
}

void LoopCloser::consider(const std::vector<Keyframe>& keyframes,
                          const std::vector<std::uint64_t>& piece_starts, KeyframePoints& points) {
  if (config_.search.method == LoopSearchConfig::Method::kPaper || !due(keyframes)) return;
  begin(keyframes, piece_starts, points);
}

SearchedMap LoopCloser::searched(const std::vector<Keyframe>& keyframes,
                                 const std::vector<std::uint64_t>& piece_starts,
                                 KeyframePoints& points) const {
  SearchedMap map{
      problem_of(keyframes, piece_starts), pieces_of(keyframes, piece_starts), {}, &points};
  if (map.pieces.count() > 1) map.attempts = attempts_;
  return map;
}

bool LoopCloser::due(const std::vector<Keyframe>& keyframes) {
  if (!config_.enabled || running_) return false;
  if (!loop_search_due(last_search_, keyframes.back().stamp, config_.search)) return false;
  last_search_ = keyframes.back().stamp;
  return true;
}

std::optional<LoopOutcome> LoopCloser::close_in_present(
    const std::vector<Keyframe>& keyframes, const std::vector<std::uint64_t>& piece_starts,
    KeyframePoints& points, const PresentMap& present) {
  if (config_.search.method != LoopSearchConfig::Method::kPaper || !due(keyframes))
    return std::nullopt;
  Search search{config_, local_map_config_, searched(keyframes, piece_starts, points),
                agreement_.get(), decided_};
  LoopOutcome outcome;
  outcome.keyframes = keyframes.size();
  const std::size_t query = keyframes.size() - 1;
  for (const LoopCandidate& candidate : find_loop_candidates(
           search.map.problem, query, config_.search, known_against(search.map.pieces, query)))
    outcome.attempts.push_back(try_in_present(search, query, candidate, present));
  apply_loops(search, outcome);
  keep(outcome);
  return outcome;
}

bool LoopCloser::join_left(std::vector<Keyframe>& keyframes,
                           const std::vector<std::uint64_t>& piece_starts, KeyframePoints& points,
                           const ProgressSink& progress) {
  if (!config_.enabled || !config_.pieces.enabled) return false;
  Search search{config_, local_map_config_, searched(keyframes, piece_starts, points),
                agreement_.get(), decided_};
  bool any = false;
  int left = config_.pieces.max_at_end;
  for (std::size_t piece = search.map.pieces.count(); piece-- > 1 && left > 0;) {
    for (const PiecePlaces& pair : all_places_to_try(search.map.problem.world_from_keyframe,
                                                     search.map.pieces, piece, config_.pieces)) {
      if (search.map.pieces.connected(pair.older, pair.newer)) continue;
      if (left-- <= 0) break;
      progress.poll();
      LoopOutcome outcome;
      outcome.attempts.push_back(try_places(search, pair));
      attempts_.push_back(outcome.attempts.front());
      any = join_by_outcome(search, outcome) || any;
    }
  }
  for (std::size_t i = 0; any && i < keyframes.size(); ++i)
    keyframes[i].world_from_body = search.map.problem.world_from_keyframe[i];
  return any;
}

void LoopCloser::begin(const std::vector<Keyframe>& keyframes,
                       const std::vector<std::uint64_t>& piece_starts, KeyframePoints& points) {
  Search search{config_,          local_map_config_, searched(keyframes, piece_starts, points),
                agreement_.get(), decided_,          leave_map_};
  // Nothing runs if no thread is to be had.
  std::future<LoopOutcome> found =
      std::async(std::launch::async, [this, search = std::move(search)]() mutable {
        const SideWork::Scope working(work_);
        LoopOutcome outcome;
        // One thread: the others belong to the scan loop.
        in_arena(1, [&] { outcome = run_search(std::move(search), abandoned_); });
        return outcome;
      });
  running_.emplace(Running{keyframes.size(), std::move(found)});
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
  // No longer the running one, also if it has failed: what it throws leaves nothing to wait for.
  Running done = std::move(*running_);
  running_.reset();
  LoopOutcome outcome = done.outcome.get();
  keep(outcome);
  return outcome;
}

void LoopCloser::keep(LoopOutcome& outcome) {
  attempts_.insert(attempts_.end(), outcome.attempts.begin(), outcome.attempts.end());
  if (!outcome.decided.empty()) decided_ = std::move(outcome.decided);
}

PoseGraphResult LoopCloser::optimise(const std::vector<Keyframe>& keyframes,
                                     const std::vector<std::uint64_t>& piece_starts) const {
  const PoseGraphProblem problem = problem_of(keyframes, piece_starts);
  if (problem.loops.empty()) return {};
  return optimise_pose_graph(problem, config_.graph, agreement_.get());
}

void LoopCloser::save(BinaryWriter& writer) const {
  writer.put(last_search_);
  writer.put(std::string(decided_.begin(), decided_.end()));
  writer.put(running_.has_value());
  if (!running_) return;
  writer.put(running_->keyframes);
}

void LoopCloser::load(BinaryReader& reader, std::vector<LoopAttempt> attempts,
                      const std::vector<Keyframe>& keyframes,
                      const std::vector<std::uint64_t>& piece_starts, KeyframePoints& points) {
  attempts_ = std::move(attempts);
  last_search_ = reader.get<TimeNs>();
  const std::string decided = reader.get_string();
  decided_.assign(decided.begin(), decided.end());
  if (decided_.size() > attempts_.size())
    throw InputError("checkpoint", "", "expected no more decisions than loops that were tried");
  if (!reader.get<bool>()) return;
  const auto known = reader.get<std::uint64_t>();
  if (known == 0 || known > keyframes.size())
    throw InputError("checkpoint", "", "expected a search among keyframes that are there");
  // Keyframes do not move while a search runs (a levelling of the world waits for it), so the first
  // ones are what it began with.
  begin({keyframes.begin(), keyframes.begin() + static_cast<std::ptrdiff_t>(known)}, piece_starts,
        points);
}

}  // namespace understory
