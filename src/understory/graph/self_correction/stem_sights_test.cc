#include "understory/graph/self_correction/stem_sights.h"

#include <gtest/gtest.h>

namespace understory {
namespace {

Stem stem_at(double range_m, float score) {
  Stem stem;
  stem.point = Eigen::Vector3f(0.0F, static_cast<float>(range_m), 7.0F);
  stem.score = score;
  return stem;
}

// Ranges 1 to 100 m, of which nine of ten are within 90 m; scores 0.01 to 1.00, the far ones sure.
std::vector<StemView> hundred() {
  std::vector<StemView> views(4);
  for (int k = 1; k <= 100; ++k) {
    StemView& view = views[static_cast<std::size_t>(k % 4)];
    view.frame = k % 4;
    view.stems.push_back(stem_at(k, 0.01F * static_cast<float>(k)));
  }
  return views;
}

std::vector<int> ranges(const std::vector<StemView>& views) {
  std::vector<int> result;
  for (const StemView& view : views) {
    for (const Stem& stem : view.stems)
      result.push_back(static_cast<int>(stem.point.y()));
  }
  std::sort(result.begin(), result.end());
  return result;
}

TEST(StemSights, NearOnesByAShareOfTheUsualRangeInThePlane) {
  StemSightConfig config;
  config.range_share = 0.5;
  config.score_share = 0.0;
  const std::vector<int> near = ranges(map_sights(hundred(), config));
  ASSERT_EQ(near.size(), 45U);  // half of 90 m; the height of 7 m does not count
  EXPECT_EQ(near.back(), 45);
}

TEST(StemSights, SureOnesByAShareOfAHighScore) {
  StemSightConfig config;
  config.range_share = 10.0;
  config.score_share = 0.5;
  const std::vector<int> sure = ranges(map_sights(hundred(), config));
  ASSERT_EQ(sure.size(), 56U);  // scores from half of 0.90 on
  EXPECT_EQ(sure.front(), 45);
}

TEST(StemSights, ScoresAreComparedWithinTheRecordingOnly) {
  StemSightConfig config;
  std::vector<StemView> halved = hundred();
  for (StemView& view : halved) {
    for (Stem& stem : view.stems)
      stem.score *= 0.5F;
  }
  EXPECT_EQ(ranges(map_sights(halved, config)), ranges(map_sights(hundred(), config)));
  EXPECT_LT(ranges(map_sights(halved, config)).size(), 60U);
}

TEST(StemSights, OnesWithoutAScorePassAndViewsStayInPlace) {
  std::vector<StemView> views = hundred();
  views.push_back({});
  views.back().frame = 99;
  views[1].stems.front().score = Stem::kUnknown;
  StemSightConfig config;
  config.range_share = 10.0;
  config.score_share = 1.0;
  const std::vector<StemView> kept = map_sights(views, config);
  ASSERT_EQ(kept.size(), views.size());
  EXPECT_EQ(kept.back().frame, 99);
  EXPECT_TRUE(kept.back().stems.empty());
  EXPECT_EQ(ranges(kept).front(), 1);  // the one without a score
  EXPECT_TRUE(map_sights({}, config).empty());
}

}  // namespace
}  // namespace understory
