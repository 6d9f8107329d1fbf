#include "understory/forest/stand/seen_area.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "understory/util/random.h"

namespace understory {
namespace {

using Eigen::Vector2d;

// Returns at random places of a plane, those for which `there` holds.
template <typename There>
SeenCells returns_on(double side_m, double per_m2, const There& there, std::uint64_t seed) {
  Random random(seed);
  SeenCells cells;
  const auto count = static_cast<int>(side_m * side_m * per_m2);
  for (int i = 0; i < count; ++i) {
    const Vector2d place(random.uniform(0.0, side_m), random.uniform(0.0, side_m));
    if (there(place)) cells.add(place, 0.0);
  }
  return cells;
}

TEST(VisibleArea, AClippedCloudHasTheAreaOfItsClip) {
  // A leaning rectangle of 26 by 27 m: 702 m2, which cells of 2 m reckon as 800 and more.
  const double turn = 0.4;
  const auto inside = [&](const Vector2d& p) {
    const Vector2d q = p - Vector2d(25.0, 25.0);
    const double u = std::cos(turn) * q.x() + std::sin(turn) * q.y();
    const double v = -std::sin(turn) * q.x() + std::cos(turn) * q.y();
    return std::abs(u) < 13.0 && std::abs(v) < 13.5;
  };
  const VisibleArea area = find_seen_area(returns_on(50.0, 120.0, inside, 1), {1e6, 5e6}, {}, {});
  EXPECT_NEAR(area.area_m2(), 702.0, 7.0);
  EXPECT_TRUE(area.seen({1e6 + 25.0, 5e6 + 25.0}));
  EXPECT_FALSE(area.seen({1e6 + 2.0, 5e6 + 2.0}));
  EXPECT_FALSE(area.seen({1e6 - 80.0, 5e6}));
}

TEST(VisibleArea, OfAPlotItIsTheShareThatWasSeen) {
  const auto west = [](const Vector2d& p) { return p.x() < 19.9; };
  const VisibleArea area = find_seen_area(returns_on(40.0, 120.0, west, 2), {0.0, 0.0}, {}, {});
  const PlotShape whole = circle_plot("a", {10.0, 20.0}, 8.0);
  EXPECT_NEAR(area.area_in_m2(whole), whole.area_m2(), 1e-9);
  const PlotShape half = circle_plot("b", {20.0, 20.0}, 8.0);
  EXPECT_NEAR(area.area_in_m2(half), 0.5 * half.area_m2() - 1.6, 1.0);
  EXPECT_EQ(area.area_in_m2(circle_plot("c", {34.0, 20.0}, 8.0)), 0.0);
  EXPECT_EQ(area.area_in_m2(circle_plot("d", {500.0, 20.0}, 8.0)), 0.0);
}

TEST(VisibleArea, ThinReturnsAndBushesAreNotEnough) {
  const auto all = [](const Vector2d&) { return true; };
  EXPECT_NEAR(find_seen_area(returns_on(30.0, 60.0, all, 3), {0, 0}, {}, {}).area_m2(), 900.0,
              20.0);
  EXPECT_LT(find_seen_area(returns_on(30.0, 0.2, all, 4), {0, 0}, {}, {}).area_m2(), 90.0);
  EXPECT_NEAR(find_seen_area(returns_on(30.0, 8.0, all, 6), {0, 0}, {}, {}).area_m2(), 900.0, 60.0)
      << "a thinned cloud";
  // Beside dense returns the thin ones are those of what lies too far away.
  const auto thin_east = [](const Vector2d& p) {
    return p.x() < 20.0 || std::fmod(17.0 * p.y() + 31.0 * p.x(), 1.0) < 0.015;
  };
  EXPECT_NEAR(find_seen_area(returns_on(30.0, 150.0, thin_east, 7), {0, 0}, {}, {}).area_m2(),
              600.0, 30.0);
  SeenCells deep;
  deep.add({1.0, 1.0}, -2.0);
  EXPECT_TRUE(find_seen_area(deep, {0, 0}, {}, {}).empty());
}

TEST(VisibleArea, AStemHidesWhatIsBehindItFromThePath) {
  const auto all = [](const Vector2d&) { return true; };
  const SeenCells cells = returns_on(40.0, 120.0, all, 5);
  SeenFrom from;
  from.reach_m = 18.0;
  from.path = {{20.0, 20.0}};
  const std::vector<StemDisc> stems = {{{25.0, 20.0}, 1.0}};
  const VisibleArea area = find_seen_area(cells, {0, 0}, stems, from);
  // The shadow of a disc seen from a point: a ring's sector beyond the far side.
  const double shadow = std::asin(1.0 / 5.0) * (18.0 * 18.0 - 6.0 * 6.0);
  EXPECT_NEAR(area.area_m2(), M_PI * 18.0 * 18.0 - shadow, 8.0);
  EXPECT_TRUE(area.seen({25.0, 20.0}));
  EXPECT_FALSE(area.seen({30.0, 20.0}));
  EXPECT_FALSE(area.seen({20.0, 39.0}));
  from.path.emplace_back(30.0, 22.0);
  EXPECT_TRUE(find_seen_area(cells, {0, 0}, stems, from).seen({30.0, 20.0}));
}

// Stems at random places around a scanner at the origin, and what it sees of them at breast height.
class RandomStand {
 public:
  RandomStand(std::uint64_t seed, double per_ha, double reach_m) : front_(7'200, 1e9) {
    Random random(seed);
    const auto count = static_cast<int>(per_ha * 4.0 * reach_m * reach_m / 1e4);
    while (static_cast<int>(stems_.size()) < count) {
      const StemDisc stem{{random.uniform(-reach_m, reach_m), random.uniform(-reach_m, reach_m)},
                          0.18};
      if (stem.centre.norm() > 1.0) stems_.push_back(stem);
    }
    for (const StemDisc& stem : stems_) {
      const double half = std::asin(stem.radius_m / stem.centre.norm());
      const double middle = std::atan2(stem.centre.y(), stem.centre.x());
      for (double angle = middle - half; angle < middle + half; angle += 2e-4) {
        double& front = front_[bin(angle)];
        const double across = stem.centre.norm() * std::sin(angle - middle);
        front = std::min(
            front, stem.centre.norm() * std::cos(angle - middle) -
                       std::sqrt(std::max(0.0, std::pow(stem.radius_m, 2) - std::pow(across, 2))));
      }
    }
  }
  // `beyond_m`: by how much a place may lie behind the nearest surface in its direction.
  [[nodiscard]] bool sees(const Vector2d& place, double beyond_m = 1e-3) const {
    return place.norm() <= front_[bin(std::atan2(place.y(), place.x()))] + beyond_m;
  }
  // Stems of which a third of the near side shows, which is what a detector needs.
  [[nodiscard]] std::vector<StemDisc> found() const {
    std::vector<StemDisc> shown;
    for (const StemDisc& stem : stems_) {
      int near = 0;
      int seen = 0;
      for (double angle = 0.0; angle < 2.0 * M_PI; angle += 0.02) {
        const Vector2d outward(std::cos(angle), std::sin(angle));
        const Vector2d place = stem.centre + stem.radius_m * outward;
        if (outward.dot(place) > 0.0) continue;
        ++near;
        seen += sees(place, 0.1) ? 1 : 0;
      }
      if (3 * seen > near) shown.push_back(stem);
    }
    return shown;
  }

 private:
  [[nodiscard]] std::size_t bin(double angle) const {
    const double turn = angle / (2.0 * M_PI) + 2.0;
    return static_cast<std::size_t>((turn - std::floor(turn)) * 7'200.0) % 7'200;
  }
  std::vector<StemDisc> stems_;
  std::vector<double> front_;
};

struct HectareFigure {
  double ratio = 0.0;  // of the figure to the truth
  double seen_share = 0.0;
};

HectareFigure figure_from_one_place(bool with_path) {
  constexpr double kPerHa = 1'500.0;
  constexpr double kReach = 15.0;
  double listed = 0.0;
  double seen_m2 = 0.0;
  constexpr int kStands = 6;
  const PlotShape plot = circle_plot("a", {0, 0}, kReach);
  for (std::uint64_t seed = 1; seed <= kStands; ++seed) {
    const RandomStand stand(seed, kPerHa, 20.0);
    Random random(100 + seed);
    SeenCells cells;
    for (int i = 0; i < 250'000; ++i) {
      const Vector2d place(random.uniform(-20.0, 20.0), random.uniform(-20.0, 20.0));
      if (stand.sees(place)) cells.add(place, 0.0);
    }
    const std::vector<StemDisc> found = stand.found();
    SeenFrom from;
    from.reach_m = kReach + 5.0;
    if (with_path) from.path = {{0.0, 0.0}};
    const VisibleArea area = find_seen_area(cells, {0, 0}, found, from);
    for (const StemDisc& stem : found)
      if (plot.contains(stem.centre) && area.seen(stem.centre)) listed += 1.0;
    seen_m2 += area.area_in_m2(plot);
  }
  return {listed / (seen_m2 / 1e4) / kPerHa, seen_m2 / (kStands * plot.area_m2())};
}

TEST(VisibleArea, AHectareFigureFromOnePlaceHasNoBias) {
  const HectareFigure with_path = figure_from_one_place(true);
  EXPECT_LT(with_path.seen_share, 0.85);
  EXPECT_NEAR(with_path.ratio, 1.0, 0.06);
  const HectareFigure without = figure_from_one_place(false);
  EXPECT_NEAR(without.ratio, 1.0, 0.08);
}

}  // namespace
}  // namespace understory
