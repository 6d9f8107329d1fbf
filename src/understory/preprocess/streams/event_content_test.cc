#include "understory/preprocess/streams/event_content.h"

#include <gtest/gtest.h>

#include "understory/preprocess/streams/test_streams.h"

namespace understory {
namespace {

TEST(EventContent, StampsDoNotCount) {
  EXPECT_EQ(content_of(scan(kEpoch)), content_of(scan(kEpoch + kMs)));
  EXPECT_EQ(content_of(fix(kEpoch)), content_of(fix(kEpoch + kMs)));
  ImuSample sample = imu(kEpoch);
  sample.stamp += kMs;
  EXPECT_EQ(content_of(imu(kEpoch)), content_of(sample));
}

TEST(EventContent, EachMeasuredNumberCounts) {
  for (int axis = 0; axis < 3; ++axis) {
    ImuSample turned = imu(kEpoch);
    turned.angular_rate[axis] += 1e-9;
    EXPECT_NE(content_of(imu(kEpoch)), content_of(turned));
    ImuSample pushed = imu(kEpoch);
    pushed.specific_force[axis] += 1e-9;
    EXPECT_NE(content_of(imu(kEpoch)), content_of(pushed));
    MagSample field;
    field.field[axis] = 1e-9;
    EXPECT_NE(content_of(MagSample()), content_of(field));
  }
  for (double GnssFix::*number :
       {&GnssFix::latitude_deg, &GnssFix::longitude_deg, &GnssFix::height_m}) {
    GnssFix moved = fix(kEpoch);
    moved.*number += 1e-9;
    EXPECT_NE(content_of(fix(kEpoch)), content_of(moved));
  }
}

}  // namespace
}  // namespace understory
