#include "understory/graph/loops/loop_search.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <queue>

#include "understory/util/error.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

// How uncertain keyframes are relative to the query, along the way of least uncertainty.
struct Drift {
  double length = 0.0;                // m, along that way
  double translation_variance = 0.0;  // m^2, sum over the edges
  double rotation_variance = 0.0;     // rad^2, sum over the edges
  bool reached = false;

  // A random walk in rotation bends a straight way sideways by length * sigma / sqrt(3).
  [[nodiscard]] double sigma_translation() const {
    return std::sqrt(translation_variance + rotation_variance * length * length / 3.0);
  }
};

struct Neighbour {
  std::size_t to;
  double length;
  double translation;
  double rotation;
};

std::vector<std::vector<Neighbour>> neighbours(const PoseGraphProblem& problem) {
  std::vector<std::vector<Neighbour>> graph(problem.world_from_keyframe.size());
  for (const auto* edges : {&problem.odometry, &problem.loops}) {
    for (const PoseEdge& edge : *edges) {
      const auto from = static_cast<std::size_t>(edge.from);
      const auto to = static_cast<std::size_t>(edge.to);
      const double length = edge.from_from_to.translation().norm();
      const double rotation = edge.covariance.topLeftCorner<3, 3>().trace() / 3.0;
      const double translation = edge.covariance.bottomRightCorner<3, 3>().trace();
      graph[from].push_back({to, length, translation, rotation});
      graph[to].push_back({from, length, translation, rotation});
    }
  }
  return graph;
}

// Dijkstra by the variance of translation. Ties are broken by the number of the keyframe.
std::vector<Drift> drift_from(const PoseGraphProblem& problem, std::size_t query) {
  const auto graph = neighbours(problem);
  std::vector<Drift> drift(graph.size());
  using Entry = std::pair<double, std::size_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
  std::vector<char> done(graph.size(), 0);
  drift[query].reached = true;
  open.emplace(0.0, query);
  while (!open.empty()) {
    const std::size_t at = open.top().second;
    open.pop();
    if (done[at] != 0) continue;
    done[at] = 1;
    for (const Neighbour& edge : graph[at]) {
      Drift next = drift[at];
      next.length += edge.length;
      next.translation_variance += edge.translation;
      next.rotation_variance += edge.rotation;
      Drift& known = drift[edge.to];
      if (known.reached && known.translation_variance <= next.translation_variance) continue;
      known = next;
      open.emplace(next.translation_variance, edge.to);
    }
  }
  return drift;
}

// Share of a disc of the given radius that a second one at a distance covers.
double disc_overlap(double distance, double radius) {
  const double h = distance / (2.0 * radius);
  if (h >= 1.0) return 0.0;
  return (2.0 / std::numbers::pi) * (std::acos(h) - h * std::sqrt(1.0 - h * h));
}

bool is_eligible(const std::vector<char>& eligible, std::size_t keyframe) {
  return eligible.empty() || eligible[keyframe] != 0;
}

std::vector<LoopCandidate> paper_candidates(const PoseGraphProblem& problem, std::size_t query,
                                            const LoopSearchConfig& config,
                                            const std::vector<char>& eligible) {
  const Eigen::Vector3d& here = problem.world_from_keyframe[query].translation();
  const auto excluded = static_cast<std::size_t>(config.exclude_recent);
  LoopCandidate best;
  best.distance_m = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k + excluded <= query; ++k) {
    if (!is_eligible(eligible, k)) continue;
    const double distance = (problem.world_from_keyframe[k].translation() - here).norm();
    if (distance < best.distance_m) {
      best.keyframe = static_cast<int>(k);
      best.distance_m = distance;
    }
  }
  if (!(best.distance_m <= config.gate_m)) return {};
  best.expected_overlap = disc_overlap(best.distance_m, config.view_radius_m);
  return {best};
}

// Takes the best by overlap, one after another, that are `spacing` of way apart.
std::vector<LoopCandidate> spread(std::vector<LoopCandidate> all, const std::vector<double>& way,
                                  const LoopSearchConfig& config) {
  sort_stably(all, [](const LoopCandidate& a, const LoopCandidate& b) {
    return a.expected_overlap > b.expected_overlap;
  });
  std::vector<LoopCandidate> chosen;
  for (const LoopCandidate& candidate : all) {
    if (static_cast<int>(chosen.size()) >= config.max_candidates) break;
    const auto too_near = [&](const LoopCandidate& other) {
      return std::abs(way[static_cast<std::size_t>(other.keyframe)] -
                      way[static_cast<std::size_t>(candidate.keyframe)]) < config.spacing_m;
    };
    if (std::none_of(chosen.begin(), chosen.end(), too_near)) chosen.push_back(candidate);
  }
  return chosen;
}

std::vector<LoopCandidate> uncertain_candidates(const PoseGraphProblem& problem, std::size_t query,
                                                const LoopSearchConfig& config,
                                                const std::vector<char>& eligible) {
  const auto& poses = problem.world_from_keyframe;
  const std::vector<Drift> drift = drift_from(problem, query);
  std::vector<double> way(query + 1, 0.0);
  for (std::size_t k = 1; k <= query; ++k)
    way[k] = way[k - 1] + (poses[k].translation() - poses[k - 1].translation()).norm();

  std::vector<LoopCandidate> all;
  for (std::size_t k = 0; k < query; ++k) {
    if (way[query] - way[k] < config.exclude_path_m || !drift[k].reached) continue;
    if (!is_eligible(eligible, k)) continue;
    LoopCandidate candidate;
    candidate.keyframe = static_cast<int>(k);
    candidate.distance_m = (poses[k].translation() - poses[query].translation()).norm();
    candidate.sigma_translation_m = drift[k].sigma_translation();
    candidate.sigma_rotation_rad = std::sqrt(drift[k].rotation_variance);
    if (candidate.distance_m > config.max_radius_m) continue;
    candidate.expected_overlap = disc_overlap(candidate.distance_m, config.view_radius_m);
    // What the overlap may be if the drift was as unkind as it plausibly can.
    const double nearest =
        std::max(0.0, candidate.distance_m - config.sigmas * candidate.sigma_translation_m);
    if (nearest > config.max_chord_ratio * (way[query] - way[k])) continue;
    if (disc_overlap(nearest, config.view_radius_m) >= config.min_overlap) all.push_back(candidate);
  }
  return spread(std::move(all), way, config);
}

}  // namespace

std::vector<LoopCandidate> find_loop_candidates(const PoseGraphProblem& problem, std::size_t query,
                                                const LoopSearchConfig& config,
                                                const std::vector<char>& eligible) {
  UNDERSTORY_CHECK(eligible.empty() || eligible.size() == problem.world_from_keyframe.size());
  UNDERSTORY_CHECK(query < problem.world_from_keyframe.size());
  return config.method == LoopSearchConfig::Method::kPaper
             ? paper_candidates(problem, query, config, eligible)
             : uncertain_candidates(problem, query, config, eligible);
}

bool loop_search_due(TimeNs last, TimeNs now, const LoopSearchConfig& config) {
  return last == kNoSearchYet || now - last >= from_seconds(config.interval_s);
}

void describe(ConfigTable& table, LoopSearchConfig& config) {
  using Method = LoopSearchConfig::Method;
  table.add_enum("method", config.method,
                 {{"paper", Method::kPaper}, {"uncertainty", Method::kUncertainty}},
                 "uncertainty: candidates within the drift that can have built up; paper: the "
                 "nearest keyframe within a gate");
  table.add("exclude_recent", config.exclude_recent, {2, 100000}, "keyframes",
            "method paper: number of most recent keyframes that are no candidates");
  table.add("gate_m", config.gate_m, {0.0, 1e4}, "m",
            "method paper: largest distance of a candidate");
  table.add("interval_s", config.interval_s, {0.0, 1e4}, "s", "shortest time between two searches");
  table.add("exclude_path_m", config.exclude_path_m, {0.0, 1e5}, "m",
            "keyframes are no candidates while the path since them is shorter");
  table.add("max_chord_ratio", config.max_chord_ratio, {0.0, 1.0}, "",
            "keyframes are no candidates while their distance is more than this share of the path "
            "since them");
  table.add("view_radius_m", config.view_radius_m, {1.0, 1000.0}, "m",
            "range up to which the views of two keyframes are compared");
  table.add("min_overlap", config.min_overlap, {0.0, 1.0}, "",
            "least share of common view that a candidate can have");
  table.add("sigmas", config.sigmas, {0.0, 10.0}, "",
            "search radius in standard deviations of the drift");
  table.add("max_radius_m", config.max_radius_m, {1.0, 1e4}, "m",
            "largest distance of a candidate");
  table.add("max_candidates", config.max_candidates, {1, 100}, "", "most candidates of one search");
  table.add("spacing_m", config.spacing_m, {0.0, 1e4}, "m",
            "least path length between the candidates of one search");
}

}  // namespace understory
