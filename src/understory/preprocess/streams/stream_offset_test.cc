#include "understory/preprocess/streams/stream_offset.h"

#include <gtest/gtest.h>

namespace understory {
namespace {

constexpr TimeNs kMs = 1'000'000;
using Verdict = StreamOffset::Verdict;

TEST(StreamOffset, OneLeadNearZeroAgrees) {
  StreamOffset offset;
  for (int i = 0; i < 15; ++i)
    offset.add(2000 * kMs, i * 100 * kMs, {});
  EXPECT_EQ(offset.verdict(), Verdict::kOpen);
  offset.add(100 * kMs, 1500 * kMs, {});
  EXPECT_EQ(offset.verdict(), Verdict::kAgrees);
  EXPECT_EQ(offset.offset(), 0);
  offset.add(2000 * kMs, 9000 * kMs, {});
  EXPECT_EQ(offset.verdict(), Verdict::kAgrees);
}

// Scans that come late make a lead larger, never smaller.
TEST(StreamOffset, AConstantLeadIsTheSmallestOfThem) {
  StreamOffset offset;
  for (int i = 0; i <= 20; ++i)
    offset.add((-2000 + 10 * (i % 7)) * kMs, i * 100 * kMs, {});
  EXPECT_EQ(offset.verdict(), Verdict::kConstant);
  EXPECT_EQ(offset.offset(), -2000 * kMs);
}

TEST(StreamOffset, LeadsThatRunAwayAreNoOffset) {
  StreamOffset offset;
  for (int i = 0; i < 200; ++i)
    offset.add((1000 + 90 * i) * kMs, i * 100 * kMs, {});
  EXPECT_EQ(offset.verdict(), Verdict::kOpen);
  offset.give_up();
  EXPECT_EQ(offset.verdict(), Verdict::kAgrees);
}

}  // namespace
}  // namespace understory
