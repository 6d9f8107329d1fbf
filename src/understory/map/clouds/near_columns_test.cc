#include "understory/map/clouds/near_columns.h"

#include <gtest/gtest.h>

namespace understory {
namespace {

// `count` points of one stem, in the body frame.
KeyframeCloud stem_at(float x, int count) {
  KeyframeCloud cloud;
  for (int i = 0; i < count; ++i)
    cloud.points.push_back({x, 0.1F, 0.02F * static_cast<float>(i), 0, 0});
  return cloud;
}

const Pose kThere(Eigen::Quaterniond::Identity(), {-30.0, 5.0, 1.0});

TEST(NearColumns, HoldWhatIsNear) {
  NearColumns columns(12.0);
  columns.add(stem_at(5.1F, 100), kThere);
  EXPECT_TRUE(columns.hold({-24.9, 5.1, 20.0}));
  EXPECT_FALSE(columns.hold({-23.9, 5.1, 1.0}));
  EXPECT_FALSE(columns.hold({-24.9, 4.4, 1.0}));
}

TEST(NearColumns, DoNotHoldWhatIsFarOrHardlySeen) {
  NearColumns columns(12.0);
  columns.add(stem_at(13.1F, 100), kThere);
  columns.add(stem_at(5.1F, 8), kThere);
  EXPECT_FALSE(columns.hold({-16.9, 5.1, 1.0}));
  EXPECT_FALSE(columns.hold({-24.9, 5.1, 1.0}));
}

}  // namespace
}  // namespace understory
