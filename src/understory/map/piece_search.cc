#include "understory/map/piece_search.h"

#include <algorithm>
#include <cmath>

#include "understory/util/stable_sort.h"

namespace understory {
namespace {

double distance(const std::vector<Pose>& poses, std::size_t a, std::size_t b) {
  return (poses[a].translation() - poses[b].translation()).norm();
}

// The way to each keyframe from the beginning of its piece, metres.
std::vector<double> ways_in_pieces(const std::vector<Pose>& poses, const MapPieces& pieces) {
  std::vector<double> way(poses.size(), 0.0);
  for (std::size_t p = 0; p < pieces.count(); ++p) {
    for (std::size_t k = pieces.begin(p) + 1; k < std::min(pieces.end(p), poses.size()); ++k)
      way[k] = way[k - 1] + distance(poses, k - 1, k);
  }
  return way;
}

// The keyframes of a piece that begin each stretch of `spacing_m`, and its last.
std::vector<std::size_t> places_of(const std::vector<double>& way, const MapPieces& pieces,
                                   std::size_t piece, double spacing_m) {
  std::vector<std::size_t> places;
  const std::size_t end = std::min(pieces.end(piece), way.size());
  for (std::size_t k = pieces.begin(piece); k < end; ++k) {
    if (places.empty() || way[k] - way[places.back()] >= spacing_m || k + 1 == end)
      places.push_back(k);
  }
  return places;
}

PiecePlaces in_order(std::size_t a, std::size_t b) {
  return {std::min(a, b), std::max(a, b)};
}

// How often the pieces of `query` were compared with a place or what lies near it on its way.
int tries(const std::vector<LoopAttempt>& attempts, const MapPieces& pieces,
          const std::vector<double>& way, std::size_t place, std::size_t query, double spacing_m) {
  int count = 0;
  for (const LoopAttempt& attempt : attempts) {
    auto there = static_cast<std::size_t>(attempt.from);
    auto here = static_cast<std::size_t>(attempt.to);
    if (pieces.connected(there, here)) continue;
    if (pieces.connected(there, query)) std::swap(there, here);
    if (!pieces.connected(here, query) || pieces.piece_of(there) != pieces.piece_of(place))
      continue;
    if (std::abs(way[there] - way[place]) < 0.5 * spacing_m) ++count;
  }
  return count;
}

}  // namespace

void describe(ConfigTable& table, PieceSearchConfig& config) {
  table.add("enabled", config.enabled,
            "after the position was lost, look for the new piece of map in the old one");
  table.add("keyframes", config.keyframes, {0, 1000}, "",
            "keyframes on each side of a place that are compared");
  table.add("spacing_m", config.spacing_m, {0.5, 1e4}, "m",
            "path length between the places of a piece that are compared");
  table.add("max_candidates", config.max_candidates, {0, 1000}, "",
            "most places compared in one search");
  table.add("max_at_end", config.max_at_end, {0, 100000}, "",
            "most pairs of places compared after the last scan");
  table.add("min_apart_m", config.min_apart_m, {0.0, 1e4}, "m",
            "path length between two places that have to be found again before pieces are joined");
}

std::vector<PiecePlaces> places_to_try(const std::vector<Pose>& poses, const MapPieces& pieces,
                                       const std::vector<LoopAttempt>& attempts, std::size_t query,
                                       const PieceSearchConfig& config) {
  const std::vector<double> way = ways_in_pieces(poses, pieces);
  const std::size_t own = pieces.piece_of(query);
  if (way[query] < config.min_apart_m) return {};
  struct Choice {
    std::size_t place;
    int tries;
    double distance_m;
  };
  std::vector<Choice> choices;
  for (std::size_t p = 0; p < pieces.count(); ++p) {
    if (pieces.together(p, own)) continue;
    for (const std::size_t place : places_of(way, pieces, p, config.spacing_m)) {
      choices.push_back({place, tries(attempts, pieces, way, place, query, config.spacing_m),
                         distance(poses, place, query)});
    }
  }
  sort_stably(choices, [](const Choice& a, const Choice& b) {
    return a.tries != b.tries ? a.tries < b.tries : a.distance_m < b.distance_m;
  });
  choices.resize(std::min(choices.size(), static_cast<std::size_t>(config.max_candidates)));
  std::vector<PiecePlaces> pairs;
  for (const Choice& choice : choices)
    pairs.push_back(in_order(choice.place, query));
  return pairs;
}

std::vector<PiecePlaces> all_places_to_try(const std::vector<Pose>& poses, const MapPieces& pieces,
                                           std::size_t piece, const PieceSearchConfig& config) {
  const std::vector<double> way = ways_in_pieces(poses, pieces);
  std::vector<PiecePlaces> pairs;
  for (const std::size_t here : places_of(way, pieces, piece, config.spacing_m)) {
    for (std::size_t p = 0; p < pieces.count(); ++p) {
      if (pieces.together(p, piece)) continue;
      for (const std::size_t there : places_of(way, pieces, p, config.spacing_m))
        pairs.push_back(in_order(here, there));
    }
  }
  sort_stably(pairs, [&](const PiecePlaces& a, const PiecePlaces& b) {
    return distance(poses, a.older, a.newer) < distance(poses, b.older, b.newer);
  });
  return pairs;
}

}  // namespace understory
