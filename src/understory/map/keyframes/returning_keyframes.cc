#include "understory/map/keyframes/returning_keyframes.h"

#include <algorithm>
#include <utility>

#include "understory/map/map_constants.h"
#include "understory/util/error.h"

namespace understory {

using namespace map_constants::returning_keyframes;

void ReturningKeyframes::add(bool held) {
  held_.push_back(held ? 1 : 0);
  gone_.push_back(0);
}

std::vector<std::size_t> ReturningKeyframes::take(const std::vector<Keyframe>& keyframes,
                                                  std::size_t first, double radius_m) {
  const std::size_t newest = held_.size() - 1;
  gone_[newest] = 0;
  const bool held = held_[newest] != 0;
  const auto begin = held_.begin() + static_cast<std::ptrdiff_t>(first);
  const bool first_held = held && std::count(begin, held_.end(), 1) == 1;
  // Over the first stretch the odometry has not drifted yet.
  double way_m = 0.0;
  for (std::size_t i = newest; first_held && i > first && way_m < radius_m; --i) {
    held_[i] = 1;
    way_m += (keyframes[i].world_from_body.translation() -
              keyframes[i - 1].world_from_body.translation())
                 .norm();
  }
  std::vector<std::pair<double, std::size_t>> near;
  for (std::size_t i = first; i < newest; ++i) {
    const double away_m = (keyframes[i].world_from_body.translation() -
                           keyframes[newest].world_from_body.translation())
                              .norm();
    if (away_m >= radius_m) gone_[i] = 1;
    if (gone_[i] != 0 && held_[i] != 0 && held && away_m < kNear * radius_m)
      near.emplace_back(away_m, i);
  }
  std::sort(near.begin(), near.end());
  near.resize(std::min(near.size(), kMostAtOnce));
  std::vector<std::size_t> coming;
  for (const auto& [away_m, i] : near) {
    gone_[i] = 0;
    coming.push_back(i);
  }
  return coming;
}

void ReturningKeyframes::note_made_anew(const std::vector<LocalMapInsertion>& in_map) {
  std::fill(gone_.begin(), gone_.end(), std::uint8_t{1});
  for (const LocalMapInsertion& insertion : in_map)
    gone_[insertion.keyframe] = 0;
}

void ReturningKeyframes::save(BinaryWriter& writer) const {
  writer.put(held_);
  writer.put(gone_);
}

void ReturningKeyframes::load(BinaryReader& reader, std::size_t keyframes) {
  held_ = reader.get_vector<std::uint8_t>();
  gone_ = reader.get_vector<std::uint8_t>();
  if (held_.size() != keyframes || gone_.size() != keyframes)
    throw InputError("checkpoint", "", "expected one entry for each keyframe");
}

}  // namespace understory
