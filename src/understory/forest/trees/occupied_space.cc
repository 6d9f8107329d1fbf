#include "understory/forest/trees/occupied_space.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace understory {
namespace {

using namespace forest_constants::sight_lines;

}  // namespace

SightLines::SightLines(const OccupiedSpace& space)
    : bounds_(space.columns().bounds(kMostCells, kStray)) {
  columns_.resize(static_cast<std::size_t>(bounds_.columns) *
                  static_cast<std::size_t>(bounds_.rows));
  space.columns().for_each([&](int column, int row, std::uint64_t metres) {
    const int c = column - bounds_.column0;
    const int r = row - bounds_.row0;
    if (c < 0 || r < 0 || c >= bounds_.columns || r >= bounds_.rows) return;
    columns_[static_cast<std::size_t>(r) * static_cast<std::size_t>(bounds_.columns) +
             static_cast<std::size_t>(c)] = metres;
  });
}

bool SightLines::holds(const Eigen::Vector2d& place, double height_m) const {
  const int c = static_cast<int>(std::floor(place.x() / kCell)) - bounds_.column0;
  const int r = static_cast<int>(std::floor(place.y() / kCell)) - bounds_.row0;
  if (c < 0 || r < 0 || c >= bounds_.columns || r >= bounds_.rows) return false;
  if (!(height_m >= 0.0) || height_m >= OccupiedSpace::kMetres) return false;
  const std::uint64_t metres =
      columns_[static_cast<std::size_t>(r) * static_cast<std::size_t>(bounds_.columns) +
               static_cast<std::size_t>(c)];
  return (metres >> static_cast<unsigned>(height_m) & 1U) != 0;
}

double SightLines::clear_share(const PlaceAbove& from, const PlaceAbove& to) const {
  const Eigen::Vector2d way = to.place - from.place;
  const double length = way.norm();
  int occupied = 0;
  for (double at = kCell; at < length - kCell; at += kCell) {
    const double share = at / length;
    const double height = from.height_m + share * (to.height_m - from.height_m);
    occupied += holds(from.place + share * way, height) ? 1 : 0;
  }
  return std::pow(kThroughMetre, occupied);
}

double SightLines::view_of(const PlaceAbove& place, const std::vector<PlaceAbove>& from) const {
  double view = 0.0;
  for (const PlaceAbove& here : from) {
    const double up = place.height_m - here.height_m;
    const double squared = (place.place - here.place).squaredNorm() + up * up;
    view += clear_share(here, place) * kUnitRange * kUnitRange / std::max(1.0, squared);
  }
  return view;
}

}  // namespace understory
