#include "understory/forest/near_and_far.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "understory/forest/inventory.h"
#include "understory/forest/test_plot.h"

namespace understory {
namespace {

TEST(ScannerPath, TellsRangesByTheTimesOfPoints) {
  const ScannerPath path({{{0.0, 0.0, 0.0}, 10.0}, {{4.0, 0.0, 0.0}, 12.0}});
  EXPECT_NEAR(path.range_m({{1.0, 3.0, 0.0}, 10.5}), 3.0, 1e-12);
  EXPECT_NEAR(path.range_m({{4.0, 0.0, 5.0}, 12.0}), 5.0, 1e-12);
  EXPECT_NEAR(path.range_m({{0.0, 0.0, 5.0}, 9.5}), 5.0, 1e-12);  // where it began
  EXPECT_TRUE(std::isnan(path.range_m({{0.0, 0.0, 5.0}, 8.5})));
  EXPECT_TRUE(std::isnan(path.range_m({{0.0, 0.0, 5.0}, 13.5})));
  EXPECT_TRUE(ScannerPath().empty());
}

// Stems in a row, which the scanner passes 48 m away and 6 m away. Bark is several times as bright
// as the data sheet has it.
struct PassedRow {
  static constexpr double kTimes = 4.0;
  static constexpr int kStems = 12;
  static constexpr double kRadius = 0.12;
  enum class Order { kFarFirst, kNearFirst };

  explicit PassedRow(Order order) {
    config.beam.sensor = LidarSensor::kVlp16;
    TestPlot ground(3);
    ground.add_ground(44.0, 30);
    const double far_begins = order == Order::kFarFirst ? 0.0 : 200.0;
    walk(58.0, far_begins);
    walk(16.0, 100.0);
    std::sort(path.begin(), path.end(),
              [](const TimedPoint& a, const TimedPoint& b) { return a.time_s < b.time_s; });
    for (const Eigen::Vector3d& place : ground.cloud)
      points.push_back({place, 150.0});
    const BeamFootprint beam = brightened(footprint_at(config.beam, 48.0), kTimes);
    double shown = kRadius;
    for (int i = 0; i < 15; ++i)
      shown = kRadius + excess_radius_m(beam, shown, 180.0);
    TestPlot stems(5);
    for (int i = 0; i < kStems; ++i) {
      const double x = 3.0 + 3.4 * i;
      add(stems, {.x = x, .y = 10.0, .dbh = 2.0 * shown, .arc_deg = 180.0, .points = 150},
          far_begins + x);
      add(stems, {.x = x, .y = 10.0, .dbh = 2.0 * kRadius, .arc_deg = 180.0, .points = 1500},
          100.0 + x);
    }
  }
  // Along x at a metre a second.
  void walk(double y, double begins_s) {
    for (int i = 0; i <= 44; ++i)
      path.push_back({{1.0 * i, y, 101.5}, begins_s + i});
  }
  void add(TestPlot& plot, const TestPlot::Stem& stem, double time_s) {
    plot.cloud.clear();
    plot.add_stem(stem);
    for (const Eigen::Vector3d& place : plot.cloud)
      points.push_back({place, time_s});
  }

  // The far places alone, so that the correction of the diameters is large.
  [[nodiscard]] std::vector<Eigen::Vector3d> scanner() const {
    std::vector<Eigen::Vector3d> places;
    for (const TimedPoint& place : path)
      if (place.place.y() > 50.0) places.push_back(place.place);
    return places;
  }
  [[nodiscard]] InventoryResult inventory(bool with_times) const {
    Cloud cloud;
    for (const TimedPoint& point : points)
      cloud.push_back(point.place);
    MeasuredCloud measured;
    if (with_times)
      measured = {[this](const TimedVisitor& visit) { visit(points); }, ScannerPath(path)};
    return take_inventory(blocks_of(cloud), config, {}, {}, scanner(), measured);
  }

  InventoryConfig config = basic_inventory();
  std::vector<TimedPoint> path;
  std::vector<TimedPoint> points;
};

TEST(NearAndFar, AStandTellsHowBrightItsBarkIs) {
  const InventoryResult result = PassedRow(PassedRow::Order::kFarFirst).inventory(true);
  ASSERT_EQ(result.stems.size(), static_cast<std::size_t>(PassedRow::kStems));
  EXPECT_TRUE(result.bark.learnt);
  EXPECT_EQ(result.bark.stems, PassedRow::kStems);
  EXPECT_GT(result.bark.times, 1.8);
  const auto told = [](const std::string& remark) {
    return remark.find("12 stems were seen both from near and from afar. They") == 0;
  };
  EXPECT_EQ(std::count_if(result.remarks.begin(), result.remarks.end(), told), 1);
}

TEST(NearAndFar, DiametersHoldIt) {
  const PassedRow row(PassedRow::Order::kFarFirst);
  const InventoryResult without = row.inventory(false);
  const InventoryResult with = row.inventory(true);
  ASSERT_EQ(with.stems.size(), without.stems.size());
  EXPECT_FALSE(without.bark.learnt);
  for (std::size_t i = 0; i < with.stems.size(); ++i) {
    EXPECT_NEAR(with.stems[i].beam.signal, with.bark.times * without.stems[i].beam.signal, 1e-9);
    EXPECT_GT(with.stems[i].beam_excess_m, without.stems[i].beam_excess_m);
    EXPECT_LT(with.trees[i].dbh_m, without.trees[i].dbh_m);
    // How unsure the brightness is comes on top.
    const StemFit& stem = with.stems[i];
    Eigen::Vector3d place(with.origin.x() + stem.centre.x(), with.origin.y() + stem.centre.y(),
                          0.0);
    place.z() = with.ground.terrain.interpolate(place.x(), place.y()) + 1.3;
    const double range = mean_range_to(row.scanner(), place);
    const double sd = diameter_sd_m(stem.spread_m, stem.arc_deg, range, stem.beam);
    const double excess_sd = excess_sd_m(with.bark, footprint_at(row.config.beam, range),
                                         stem.radius_m + stem.beam_excess_m, stem.arc_deg);
    EXPECT_GT(excess_sd, 5e-4);
    EXPECT_NEAR(stem.covariance(2, 2), 0.25 * sd * sd + excess_sd * excess_sd, 1e-9);
  }
  const auto told = [](const std::string& remark) {
    return remark.find("0 stems were seen both from near and from afar: too few") == 0;
  };
  EXPECT_EQ(std::count_if(without.remarks.begin(), without.remarks.end(), told), 1);
}

TEST(NearAndFar, APairIsTheStemByAllPointsAndByThoseFromAfar) {
  const PassedRow row(PassedRow::Order::kFarFirst);
  const InventoryResult plain = row.inventory(false);
  std::vector<StemFit> stems = plain.stems;
  for (StemFit& stem : stems)
    stem.radius_m += stem.beam_excess_m;
  const MeasuredCloud measured{[&](const TimedVisitor& visit) { visit(row.points); },
                               ScannerPath(row.path)};
  const std::vector<StemSeenTwice> seen =
      look_from_afar(measured, plain.ground, plain.origin, stems, row.config.stems, {});
  ASSERT_EQ(seen.size(), static_cast<std::size_t>(PassedRow::kStems));
  for (const StemSeenTwice& pair : seen) {
    EXPECT_NEAR(pair.far.range_m, 48.0, 0.5);
    EXPECT_LT(pair.near.range_m, 12.0);
    EXPECT_NEAR(pair.near.radius_m, stems[pair.stem].radius_m, 1e-12);
    EXPECT_GT(pair.far.radius_m, PassedRow::kRadius + 0.015);
  }
  // The order of points changes nothing.
  std::vector<TimedPoint> reversed(row.points.rbegin(), row.points.rend());
  const MeasuredCloud other{[&](const TimedVisitor& visit) { visit(reversed); },
                            ScannerPath(row.path)};
  const std::vector<StemSeenTwice> again =
      look_from_afar(other, plain.ground, plain.origin, stems, row.config.stems, {});
  ASSERT_EQ(again.size(), seen.size());
  for (std::size_t i = 0; i < seen.size(); ++i) {
    EXPECT_EQ(again[i].stem, seen[i].stem);
    EXPECT_EQ(again[i].far.radius_m, seen[i].far.radius_m);
    EXPECT_EQ(again[i].far.range_m, seen[i].far.range_m);
  }
}

// What was measured later from afar is what the near points left over: it lies beside the stem.
TEST(NearAndFar, FarPointsThatCameLaterTellNothing) {
  const InventoryResult result = PassedRow(PassedRow::Order::kNearFirst).inventory(true);
  EXPECT_EQ(result.bark.stems, 0);
  EXPECT_FALSE(result.bark.learnt);
  EXPECT_EQ(result.bark.times, 1.0);
}

TEST(NearAndFar, WithoutTimesOrWithTimesOfAnotherClockNothingIsTold) {
  PassedRow row(PassedRow::Order::kFarFirst);
  for (TimedPoint& point : row.points)
    point.time_s += 1e9;
  const InventoryResult result = row.inventory(true);
  EXPECT_EQ(result.bark.stems, 0);
  EXPECT_EQ(result.trees.size(), static_cast<std::size_t>(PassedRow::kStems));
}

}  // namespace
}  // namespace understory
