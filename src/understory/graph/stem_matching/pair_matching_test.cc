#include "understory/graph/stem_matching/pair_matching.h"

#include <gtest/gtest.h>

#include <vector>

namespace understory {
namespace {

const Gathering kJoined{1.0, 10, 0.4, 0.0, 0.0, true};

// The first two sights lie farther apart than the limit, and the others between them.
TEST(GatherViews, SightsThatBeginTwoStemsAreOne) {
  std::vector<SparsePoints> views;
  for (const double x : {-0.25, 0.25, -0.15, 0.15, -0.1, 0.1})
    views.push_back({{5.0 + x, 0.0, 0.0}});
  const std::vector<Pose> still(views.size());
  const SparsePoints stems = gather_views(views, still, 0, kJoined);
  ASSERT_EQ(stems.size(), 1U);
  EXPECT_NEAR(stems[0].x(), 5.0, 1e-9);
}

TEST(GatherViews, StemsThatOneViewSeesStayTwo) {
  const std::vector<SparsePoints> views(6, {{5.0, 0.0, 0.0}, {5.3, 0.0, 0.0}});
  const std::vector<Pose> still(views.size());
  EXPECT_EQ(gather_views(views, still, 0, kJoined).size(), 2U);
}

}  // namespace
}  // namespace understory
