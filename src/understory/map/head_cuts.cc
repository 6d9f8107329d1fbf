#include "understory/map/head_cuts.h"

#include <algorithm>

#include "understory/util/stable_sort.h"

namespace understory {
namespace {

struct Pairing {
  double distance_m;
  std::size_t cut;
  std::size_t tree;
};

// Until when each tree was seen standing, as far as one can tell.
std::vector<TimeNs> last_standing(const std::vector<MappedStem>& trees,
                                  const std::vector<FelledTree>& felled,
                                  const std::vector<StemView>& views) {
  std::vector<TimeNs> stood;
  for (const MappedStem& tree : trees)
    stood.push_back(views[static_cast<std::size_t>(tree.last_view)].stamp);
  for (const FelledTree& tree : felled)
    stood[tree.tree] = views[static_cast<std::size_t>(tree.last_seen)].stamp;
  return stood;
}

}  // namespace

std::vector<CutTree> match_cuts(const std::vector<HeadCut>& cuts,
                                const std::vector<MappedStem>& trees,
                                const std::vector<FelledTree>& felled,
                                const std::vector<StemView>& views, const CutMatching& config) {
  const std::vector<TimeNs> stood = last_standing(trees, felled, views);
  std::vector<Pairing> pairs;
  for (std::size_t c = 0; c < cuts.size(); ++c) {
    for (std::size_t t = 0; t < trees.size(); ++t) {
      const double distance = (trees[t].point_in_world - cuts[c].head_in_world).head<2>().norm();
      const bool stood_on = stood[t] > cuts[c].stamp + from_seconds(config.settle_s);
      if (distance <= config.reach_m && !stood_on) pairs.push_back({distance, c, t});
    }
  }
  sort_stably(pairs,
              [](const Pairing& a, const Pairing& b) { return a.distance_m < b.distance_m; });
  std::vector<CutTree> result(cuts.size());
  std::vector<char> taken(trees.size(), 0);
  for (const Pairing& pair : pairs) {
    if (result[pair.cut].tree >= 0 || taken[pair.tree] != 0) continue;
    result[pair.cut] = {static_cast<int>(pair.tree), pair.distance_m};
    taken[pair.tree] = 1;
  }
  return result;
}

}  // namespace understory
