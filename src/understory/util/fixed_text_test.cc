#include "understory/util/fixed_text.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace understory {
namespace {

TEST(FixedText, WhatRoundsToZeroHasNoSign) {
  EXPECT_EQ(fixed_text(-0.00004, 4), "0.0000");
  EXPECT_EQ(fixed_text(-0.00006, 4), "-0.0001");
  EXPECT_EQ(fixed_text(-0.4, 0), "0");
  EXPECT_EQ(fixed_text(-0.0, 1), "0.0");
  EXPECT_EQ(fixed_text(12.3456, 2), "12.35");
  EXPECT_EQ(signed_text(-0.00004, 4), "0.0000");
  EXPECT_EQ(signed_text(0.00004, 4), "0.0000");
  EXPECT_EQ(signed_text(-0.00006, 4), "-0.0001");
  EXPECT_EQ(signed_text(0.5, 1), "+0.5");
}

TEST(FixedText, WhatIsNoNumberStaysAWord) {
  EXPECT_EQ(fixed_text(std::nan(""), 3), "nan");
  EXPECT_EQ(signed_text(-std::numeric_limits<double>::infinity(), 3), "-inf");
}

}  // namespace
}  // namespace understory
