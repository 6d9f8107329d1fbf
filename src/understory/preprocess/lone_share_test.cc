#include "understory/preprocess/lone_share.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "understory/util/random.h"

namespace understory {
namespace {

struct Returns {
  std::vector<std::uint16_t> ring;
  std::vector<std::uint32_t> t_ns;
  std::vector<float> range;
  std::vector<std::uint8_t> alone;
};

// Rings of two lidars, in no order.
Returns random_returns(std::uint64_t seed) {
  Random random(seed);
  Returns returns;
  for (int i = 0; i < 4000; ++i) {
    const auto ring = static_cast<std::uint16_t>(random.uniform(0.0, 12.0));
    returns.ring.push_back(ring < 8 ? ring : static_cast<std::uint16_t>(1017 + ring));
    returns.t_ns.push_back(static_cast<std::uint32_t>(random.uniform(5e6, 1e8)));
    returns.range.push_back(static_cast<float>(random.uniform(0.0, 100.0)));
    returns.alone.push_back(random.uniform() < 0.3 ? 1 : 0);
  }
  returns.t_ns[7] = 5'000'000;
  returns.t_ns[8] = 100'000'000;
  return returns;
}

LoneShare share_of(const Returns& returns) {
  return {returns.ring, returns.t_ns, returns.range, returns.alone};
}

int column_of(std::uint32_t t_ns) {
  return static_cast<int>((t_ns - 5e6) * 180.0 / (1e8 - 5e6 + 1.0));
}

// 0 below 0.9 m, then one each time that 0.1 m + range doubles.
int octave_of(float range) {
  int octave = 0;
  for (float limit = 1.0F; 0.1F + range >= limit; limit *= 2.0F)
    ++octave;
  return octave;
}

TEST(LoneShare, IsTheShareOfThoseAroundThatAreNotMuchNearer) {
  const Returns returns = random_returns(3);
  const LoneShare share = share_of(returns);
  for (std::size_t i = 0; i < returns.ring.size(); i += 13) {
    int all = 0;
    int alone = 0;
    for (std::size_t j = 0; j < returns.ring.size(); ++j) {
      if (j == i || std::abs(returns.ring[j] - returns.ring[i]) > 2) continue;
      const int columns = std::abs(column_of(returns.t_ns[j]) - column_of(returns.t_ns[i]));
      if (std::min(columns, 180 - columns) > 10) continue;
      ++all;
      if (octave_of(returns.range[j]) >= octave_of(returns.range[i]) - 1) alone += returns.alone[j];
    }
    ASSERT_GT(all, 0);
    EXPECT_NEAR(share.around(i), static_cast<double>(alone) / all, 1e-12) << i;
  }
}

TEST(LoneShare, AReturnByItselfHasNoneAround) {
  const Returns one = {{5}, {0}, {3.0F}, {1}};
  EXPECT_EQ(share_of(one).around(0), 0.0);
  const Returns none;
  share_of(none);
}

// A source without times for its points, and a range that is no number.
TEST(LoneShare, WithoutTimesTheRingsTell) {
  const Returns returns = {
      {0, 0, 0, 9}, {0, 0, 0, 0}, {0.3F, std::nanf(""), 0.3F, 0.3F}, {0, 1, 1, 1}};
  const LoneShare share = share_of(returns);
  EXPECT_DOUBLE_EQ(share.around(0), 1.0);
  EXPECT_DOUBLE_EQ(share.around(2), 0.5);
  EXPECT_EQ(share.around(3), 0.0);
}

}  // namespace
}  // namespace understory
