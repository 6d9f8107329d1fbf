#include "understory/util/time.h"

#include <gtest/gtest.h>

namespace understory {
namespace {

TEST(Time, FormatsAndParsesEveryNanosecond) {
  for (const TimeNs time : {TimeNs{0}, TimeNs{1}, TimeNs{-1}, TimeNs{1'700'000'000'123'456'789},
                            TimeNs{-2'000'000'001}, TimeNs{999'999'999}}) {
    TimeNs parsed = 42;
    ASSERT_TRUE(parse_seconds(format_seconds(time), parsed)) << time;
    EXPECT_EQ(parsed, time);
  }
  EXPECT_EQ(format_seconds(1'700'000'000'000'000'001), "1700000000.000000001");
}

TEST(Time, ParsingDropsFurtherDecimalsAndRefusesOtherText) {
  TimeNs time = 0;
  ASSERT_TRUE(parse_seconds("1.1234567899", time));
  EXPECT_EQ(time, 1'123'456'789);
  ASSERT_TRUE(parse_seconds("12", time));
  EXPECT_EQ(time, 12 * kNsPerSecond);
  for (const char* text : {"", ".", "-", "1e5", "nan", "1.2.3", "99999999999999999999"}) {
    EXPECT_FALSE(parse_seconds(text, time)) << text;
  }
}

TEST(Time, SecondsRoundTrip) {
  EXPECT_EQ(from_seconds(-0.25), -250'000'000);
  EXPECT_EQ(from_seconds(to_seconds(123'456'789'012'345)), 123'456'789'012'345);
}

}  // namespace
}  // namespace understory
