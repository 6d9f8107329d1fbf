#include "understory/map/range_check.h"

#include <gtest/gtest.h>

#include "understory/registration/test_stand.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

// One keyframe every half metre along x.
std::vector<Keyframe> straight_walk(std::size_t count) {
  std::vector<Keyframe> keyframes(count);
  for (std::size_t i = 0; i < count; ++i) {
    keyframes[i].world_from_body =
        Pose(Eigen::Quaterniond::Identity(), {0.5 * static_cast<double>(i) - 8.0, 0.0, 1.8});
  }
  return keyframes;
}

TEST(RangeCheck, PairsLieApartWithinASegment) {
  const std::vector<Keyframe> keyframes = straight_walk(60);
  const std::vector<std::uint64_t> segments = {0, 20};
  RangeCheckConfig config;
  config.apart_m = 6.0;
  const auto pairs = pairs_of_views(keyframes, segments, config);
  ASSERT_FALSE(pairs.empty());
  bool in_first = false;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const auto [a, b] = pairs[i];
    EXPECT_EQ(b - a, 12U);
    EXPECT_TRUE(b < 20 || a >= 20);
    in_first = in_first || b < 20;
    if (i > 0 && pairs[i - 1].first >= 20) {
      EXPECT_EQ(a - pairs[i - 1].first, 6U);
    }
  }
  EXPECT_TRUE(in_first);
  config.max_pairs = 3;
  const auto some = pairs_of_views(keyframes, segments, config);
  ASSERT_EQ(some.size(), 3U);
  EXPECT_EQ(some.front(), pairs.front());
  EXPECT_TRUE(pairs_of_views(straight_walk(12), std::vector<std::uint64_t>{0}, config).empty());
}

RangeOffset pair(double offset_m, double sd_m) {
  RangeOffset offset;
  offset.solved = true;
  offset.offset_m = offset_m;
  offset.sd_m = sd_m;
  return offset;
}

TEST(RangeCheck, PairsAreCombinedByWhatTheyTell) {
  EXPECT_EQ(combine({}).pairs, 0);
  EXPECT_EQ(combine({RangeOffset()}).pairs, 0);
  // Two that know little do not outweigh three that agree.
  const RangeCheck few = combine(
      {pair(1.0, 0.02), pair(1.02, 0.02), pair(0.98, 0.02), pair(-3.0, 2.0), pair(3.0, 2.0)});
  EXPECT_EQ(few.pairs, 5);
  EXPECT_NEAR(few.offset_m, 1.0, 0.02);
  EXPECT_LT(few.standard_error_m, 0.05);
  // One that is far off and overconfident counts as one that is off by three deviations.
  std::vector<RangeOffset> with_stray(20, pair(0.1, 0.05));
  with_stray.push_back(pair(8.0, 0.05));
  EXPECT_NEAR(combine(with_stray).offset_m, 0.1, 0.02);
}

// Pairs that contradict each other make the estimate uncertain, however sure each is.
TEST(RangeCheck, TheStandardErrorComesFromTheSpread) {
  const auto error = [](double spread) {
    std::vector<RangeOffset> pairs;
    for (int i = 0; i < 16; ++i)
      pairs.push_back(pair((i % 2 == 0 ? -1.0 : 1.0) * spread * (1.0 + 0.05 * i), 0.001));
    return combine(pairs).standard_error_m;
  };
  EXPECT_LT(error(0.002), 0.002);
  EXPECT_GT(error(1.0), 0.25);
  EXPECT_LT(error(1.0), 1.0);
}

TEST(RangeCheck, FindsWhatAllRangesOfAWalkAreTooLong) {
  const std::vector<Keyframe> keyframes = straight_walk(32);
  const std::vector<std::uint64_t> segments = {0};
  testing::Stand stand = testing::make_stand(testing::StandOptions(), 11);
  stand.bump_m = 0.3;
  testing::Pattern pattern = testing::vlp16();
  pattern.columns = 400;
  for (const double offset : {0.0, 1.0}) {
    std::vector<std::shared_ptr<const Points>> clouds;
    for (std::size_t i = 0; i < keyframes.size(); ++i) {
      Points points = testing::scan_stand(stand, keyframes[i].world_from_body, pattern, i);
      for (Eigen::Vector3f& point : points)
        point *= 1.0F + static_cast<float>(offset) / point.norm();
      clouds.push_back(std::make_shared<const Points>(std::move(points)));
    }
    const auto check = [&](int threads) {
      RangeCheck found;
      with_threads(threads, [&] {
        found = check_ranges(
            keyframes, segments, [&](std::size_t i) { return clouds[i]; }, Eigen::Vector3d::Zero(),
            RangeCheckConfig());
      });
      return found;
    };
    const RangeCheck found = check(1);
    EXPECT_GE(found.pairs, 3);
    EXPECT_NEAR(found.offset_m, offset, 0.15);
    EXPECT_LT(found.standard_error_m, 0.15);
    const RangeCheck again = check(4);
    EXPECT_EQ(again.offset_m, found.offset_m);
    EXPECT_EQ(again.standard_error_m, found.standard_error_m);
  }
}

}  // namespace
}  // namespace understory
