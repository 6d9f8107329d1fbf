#include "understory/recording/finding.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

namespace understory {
namespace {

constexpr Finding kAll[] = {Finding::kDamage,       Finding::kDamagedPacket, Finding::kCutOff,
                            Finding::kOtherSensor,  Finding::kLateSensor,    Finding::kAssumedTimes,
                            Finding::kNoPointTimes, Finding::kMixedTimes};

TEST(Finding, IsCountedByKindAndKeepsItsFirstMessage) {
  std::set<std::string> keys;
  for (const Finding finding : kAll) {
    keys.insert(key_of(finding));
    Log log;
    EXPECT_EQ(found(log, finding).count, 0U);
    report_finding(log, finding, "at byte 5");
    report_finding(log, finding, "at byte 9");
    for (const Finding other : kAll)
      EXPECT_EQ(found(log, other).count, other == finding ? 2U : 0U);
    EXPECT_EQ(found(log, finding).first, "at byte 5");
  }
  EXPECT_EQ(keys.size(), std::size(kAll));
}

TEST(Finding, OutlivesACheckpoint) {
  Log before;
  report_finding(before, Finding::kCutOff, "at byte 5");
  Log resumed;
  resumed.restore(before.warnings());
  EXPECT_EQ(found(resumed, Finding::kCutOff).count, 1U);
  EXPECT_EQ(found(resumed, Finding::kCutOff).first, "at byte 5");
}

}  // namespace
}  // namespace understory
