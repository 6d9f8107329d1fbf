#include "understory/forest/trees/look_again.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <utility>

#include "understory/forest/forest_constants.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

using namespace forest_constants::look_again;

using Square = std::pair<std::int32_t, std::int32_t>;  // row, column

Square square_of(const Eigen::Vector2d& place, double size) {
  return {static_cast<std::int32_t>(std::floor(place.y() / size)),
          static_cast<std::int32_t>(std::floor(place.x() / size))};
}

// Stems by squares of the sensor's range.
class StemsAround {
 public:
  explicit StemsAround(const std::vector<StandingStem>& stems) : stems_(stems) {
    for (std::size_t i = 0; i < stems.size(); ++i)
      squares_[square_of(stems[i].place, kFarthest)].push_back(i);
  }
  template <typename Visit>
  void near(const Eigen::Vector2d& place, const Visit& visit) const {
    const auto [row, column] = square_of(place, kFarthest);
    for (std::int32_t y = row - 1; y <= row + 1; ++y) {
      for (std::int32_t x = column - 1; x <= column + 1; ++x) {
        const auto found = squares_.find({y, x});
        if (found == squares_.end()) continue;
        for (const std::size_t i : found->second)
          visit(i);
      }
    }
  }
  [[nodiscard]] bool is_free(const Eigen::Vector2d& place) const {
    bool free = true;
    near(place, [&](std::size_t i) {
      free = free && (stems_[i].place - place).norm() > stems_[i].radius_m + kElbowRoom;
    });
    return free;
  }
  // Whether no other stem lies on the straight way to a stem's middle.
  [[nodiscard]] bool is_in_view(const Eigen::Vector2d& from, std::size_t target) const {
    const Eigen::Vector2d way = stems_[target].place - from;
    const double length = way.norm();
    bool in_view = true;
    near(from, [&](std::size_t i) {
      if (i == target || !in_view) return;
      const Eigen::Vector2d to = stems_[i].place - from;
      const double along = to.dot(way) / length;
      if (along <= 0.0 || along >= length) return;
      const double beside = std::abs(to.x() * way.y() - to.y() * way.x()) / length;
      in_view = beside > stems_[i].radius_m;
    });
    return in_view;
  }

 private:
  const std::vector<StandingStem>& stems_;
  std::map<Square, std::vector<std::size_t>> squares_;
};

bool shows_enough(const StandingStem& stem, const Eigen::Vector2d& from) {
  return !lacks_a_side(stem) || newly_seen_deg(stem, from) >= kEnoughDeg;
}

Eigen::Vector2d middle_of(const Square& square) {
  return {(square.second + 0.5) * kStep, (square.first + 0.5) * kStep};
}

// Weak stems by the squares from which they show enough.
std::map<Square, std::vector<std::size_t>> candidates(
    const std::vector<StandingStem>& stems, const StemsAround& around,
    const std::function<bool(const Eigen::Vector2d&)>& walkable) {
  std::map<Square, std::vector<std::size_t>> all;
  std::map<Square, bool> good;
  const auto steps = static_cast<std::int32_t>(std::ceil(kFarthest / kStep));
  for (std::size_t i = 0; i < stems.size(); ++i) {
    if (!stems[i].weak) continue;
    const auto [row, column] = square_of(stems[i].place, kStep);
    for (std::int32_t y = row - steps; y <= row + steps; ++y) {
      for (std::int32_t x = column - steps; x <= column + steps; ++x) {
        const Eigen::Vector2d from = middle_of({y, x});
        const double distance = (from - stems[i].place).norm();
        if (distance < kNearest || distance > kFarthest || !shows_enough(stems[i], from)) continue;
        const auto [at, is_new] = good.try_emplace({y, x}, false);
        if (is_new) at->second = walkable(from) && around.is_free(from);
        if (at->second && around.is_in_view(from, i)) all[{y, x}].push_back(i);
      }
    }
  }
  return all;
}

}  // namespace

int newly_seen_deg(const StandingStem& stem, const Eigen::Vector2d& from) {
  const Eigen::Vector2d towards = from - stem.place;
  const double direction = std::atan2(towards.y(), towards.x());
  int sides = 0;
  for (int side = 0; side < 36; ++side) {
    const double angle = (side + 0.5) * std::numbers::pi / 18.0;
    const double off = std::remainder(angle - direction, 2.0 * std::numbers::pi);
    if (std::abs(off) > kShownDeg * std::numbers::pi / 180.0) continue;
    sides += stem.seen.test(static_cast<std::size_t>(side)) ? 0 : 1;
  }
  return 10 * sides;
}

bool lacks_a_side(const StandingStem& stem) {
  return 360 - 10 * static_cast<int>(stem.seen.count()) >= kSeenRoundDeg;
}

std::vector<LookPlace> places_to_look(const std::vector<StandingStem>& stems,
                                      const std::function<bool(const Eigen::Vector2d&)>& walkable) {
  const StemsAround around(stems);
  auto squares = candidates(stems, around, walkable);
  std::vector<LookPlace> places;
  std::vector<char> shown(stems.size(), 0);
  while (places.size() < kMostPlaces) {
    const std::vector<std::size_t>* most = nullptr;
    Square best;
    double least_way = 0.0;
    for (auto& [square, weak] : squares) {
      std::erase_if(weak, [&](std::size_t i) { return shown[i] != 0; });
      if (weak.empty() || (most != nullptr && weak.size() < most->size())) continue;
      double way = 0.0;
      for (const std::size_t i : weak)
        way += (stems[i].place - middle_of(square)).norm();
      if (most != nullptr && weak.size() == most->size() && way >= least_way) continue;
      most = &weak;
      best = square;
      least_way = way;
    }
    if (most == nullptr || (most->size() < kLeastStems && !places.empty())) break;
    LookPlace place{middle_of(best), *most};
    sort_stably(place.stems, [&](std::size_t a, std::size_t b) {
      return (stems[a].place - place.place).norm() < (stems[b].place - place.place).norm();
    });
    for (const std::size_t i : place.stems)
      shown[i] = 1;
    places.push_back(std::move(place));
  }
  return places;
}

}  // namespace understory
