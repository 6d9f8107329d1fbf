#include "understory/registration/wide_steps.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <numeric>
#include <vector>

#include "understory/registration/gicp/gicp.h"

namespace understory::internal {
namespace {

std::vector<int> numbered(int count) {
  std::vector<int> numbers(static_cast<std::size_t>(count));
  std::iota(numbers.begin(), numbers.end(), 0);
  return numbers;
}

TEST(WideSteps, TakeAllOfASparseScanAndAPartOfADenseOne) {
  EXPECT_EQ(wide_part(numbered(15999)).size(), 15999U);
  EXPECT_EQ(wide_part(numbered(16000)).size(), 8000U);
  EXPECT_EQ(wide_part(numbered(200000)).size(), 50000U);
  EXPECT_EQ(wide_part(numbered(24000))[2], 6);
  EXPECT_TRUE(wide_part(std::vector<int>()).empty());
}

TEST(WideSteps, EndEarlierThanTheLastOnesButNotBeforeThem) {
  GicpConfig config;
  EXPECT_GT(wide_steps(config).step_translation_m, config.step_translation_m);
  EXPECT_GT(wide_steps(config).step_rotation_rad, config.step_rotation_rad);
  config.step_translation_m = 0.1;
  EXPECT_EQ(wide_steps(config).step_translation_m, 0.1);
}

}  // namespace
}  // namespace understory::internal
