#include "understory/recording/captures/scan_assembly.h"

#include <gtest/gtest.h>

#include "understory/util/error.h"

namespace understory {
namespace {

ScanPoint point_at(float x) {
  ScanPoint point;
  point.x = x;
  return point;
}

TEST(GrowingScan, BeginsAtTheEarliestTimeAndIsEmptyAfterwards) {
  GrowingScan growing;
  EXPECT_EQ(growing.take(16), nullptr);
  growing.add(point_at(1.0F), 1'000'000'300);
  growing.add(point_at(2.0F), 1'000'000'100);
  growing.add(point_at(3.0F), 1'000'000'100 + 5 * kNsPerSecond);  // t_ns cannot hold it
  const ScanPtr scan = growing.take(16);
  ASSERT_NE(scan, nullptr);
  EXPECT_EQ(scan->stamp, 1'000'000'100);
  EXPECT_EQ(scan->ring_count, 16);
  ASSERT_EQ(scan->points.size(), 2U);
  EXPECT_EQ(scan->points[0].t_ns, 200U);
  EXPECT_EQ(scan->points[1].t_ns, 0U);
  EXPECT_TRUE(growing.empty());
}

TEST(GrowingScan, GoesOnWhereItWasSaved) {
  GrowingScan growing;
  growing.add(point_at(1.0F), 100);
  BinaryWriter writer;
  growing.save(writer);
  GrowingScan again;
  BinaryReader reader(writer.bytes(), "state");
  again.load(reader, "walk.pcap");
  again.add(point_at(2.0F), 300);
  EXPECT_EQ(again.take(1)->points.size(), 2U);
}

TEST(GrowingScan, AStateWithOtherNumbersOfPointsAndTimesIsRefused) {
  BinaryWriter writer;
  writer.put(std::vector<ScanPoint>(2));
  writer.put(std::vector<TimeNs>(3));
  BinaryReader reader(writer.bytes(), "state");
  GrowingScan growing;
  EXPECT_THROW(growing.load(reader, "walk.pcap"), InputError);
}

}  // namespace
}  // namespace understory
