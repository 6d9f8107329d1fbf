#include "understory/recording/captures/rtklib.h"

#include <gtest/gtest.h>

#include <cmath>
#include <sstream>

#include "understory/util/error.h"

namespace understory {
namespace {

const std::string kHeader =
    "% program   : rnx2rtkp ver.2.4.3 b34\n"
    "% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix,2:float,3:sbas,4:dgps,5:single,6:ppp,ns=# of "
    "satellites)\n"
    "%  GPST                  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   "
    "sdu(m)  sdne(m)  sdeu(m)  sdun(m) age(s)  ratio\n";

std::vector<GnssFix> read_solution(const std::string& text, Log& log) {
  std::istringstream stream(text);
  return read_rtklib_solution(stream, "test.pos", log);
}

TEST(Rtklib, ReadsPositionsWithTheirCovariances) {
  Log log;
  const auto fixes = read_solution(kHeader +
                                       "2019/08/10 08:30:00.250   61.201234567   25.101234567   "
                                       "160.1234   2   9   0.5000   0.4000   1.2000  -0.3000   "
                                       "0.2000  -0.1000   0.50    1.4\n",
                                   log);
  ASSERT_EQ(fixes.size(), 1U);
  // GPS time is 18 s ahead of UTC in 2019; 2019-08-10 is day 18118.
  EXPECT_EQ(fixes[0].stamp,
            (18'118LL * 86'400 + 8 * 3600 + 30 * 60 - 18) * kNsPerSecond + 250'000'000);
  EXPECT_DOUBLE_EQ(fixes[0].latitude_deg, 61.201234567);
  EXPECT_DOUBLE_EQ(fixes[0].height_m, 160.1234);
  EXPECT_EQ(fixes[0].quality, 5);  // float, by the numbers of NMEA
  EXPECT_EQ(fixes[0].satellites, 9);
  EXPECT_NEAR(fixes[0].covariance(0, 0), 0.16, 1e-12);
  EXPECT_NEAR(fixes[0].covariance(1, 1), 0.25, 1e-12);
  EXPECT_NEAR(fixes[0].covariance(0, 1), -0.09, 1e-12);
  EXPECT_NEAR(fixes[0].covariance(0, 2), 0.04, 1e-12);
  EXPECT_NEAR(fixes[0].covariance(1, 2), -0.01, 1e-12);
}

// One place in each way of writing it.
TEST(Rtklib, ReadsEveryWayOfWritingPlacesAndTimes) {
  Log log;
  const auto plain =
      read_solution(kHeader + "2019/08/10,08:30:18.000,61.5,-25.25,100.0,1,9\n", log);
  const auto week = read_solution(
      "%  GPST latitude(deg) longitude(deg) height(m)\n"
      "2065 549018.000 61.5 -25.25 100.0 1 9\n",
      log);
  const auto minutes = read_solution(
      "%  UTC latitude(d'\") longitude(d'\") height(m)\n"
      "2019/08/10 08:30:00.000 61 30 00.0 -25 15 00.0 100.0 1 9\n",
      log);
  const auto japan = read_solution(
      "%  JST latitude(deg) longitude(deg) height(m)\n"
      "2019/08/10 17:30:00.000 61.5 -25.25 100.0 1 9\n",
      log);
  const auto centred = read_solution(
      "%  UTC x-ecef(m) y-ecef(m) z-ecef(m)\n"
      "2019/08/10 08:30:00.000 2759790.8939 -1301601.8870 5582229.4743 1 9\n",
      log);
  for (const auto* one : {&week, &minutes, &japan, &centred}) {
    ASSERT_EQ(one->size(), 1U);
    EXPECT_EQ(one->front().stamp, plain.front().stamp);
    EXPECT_NEAR(one->front().latitude_deg, 61.5, 1e-8);
    EXPECT_NEAR(one->front().longitude_deg, -25.25, 1e-8);
    EXPECT_NEAR(one->front().height_m, 100.0, 1e-3);
  }
  EXPECT_TRUE(log.warnings().empty());
}

TEST(Rtklib, DamagedLinesAreLeftOutAndBaselinesAreRefused) {
  Log log;
  const auto fixes = read_solution(kHeader +
                                       "2019/08/10 08:30:00.000 61.5 25.2 100.0 1 9\n"
                                       "2019/08/10 08:30:01.000 61.5 25\x01.2 100.0 1 9\n"
                                       "2019/13/10 08:30:02.000 61.5 25.2 100.0 1 9\n"
                                       "2019/08/10 08:30:03.000 161.5 25.2 100.0 1 9\n"
                                       "2019/08/10 08:30:04.000 61.5 25.2\n"
                                       "\n2019/08/10 08:30:05.000 61.5 25.2 nan 1 9\n",
                                   log);
  EXPECT_EQ(fixes.size(), 1U);
  EXPECT_FALSE(log.warnings().empty());
  EXPECT_THROW((void)read_solution("%  GPST e-baseline(m) n-baseline(m) u-baseline(m)\n"
                                   "2019/08/10 08:30:00.000 1.0 2.0 3.0 1 9\n",
                                   log),
               InputError);
}

}  // namespace
}  // namespace understory
