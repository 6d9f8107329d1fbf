#include "understory/recording/clouds/stems_file.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

class StemsFile : public ::testing::Test {
 protected:
  const test::TemporaryFolder folder_;

  fs::path plain(const std::string& text) {
    const fs::path path = folder_ / "stems.csv";
    std::ofstream(path) << text;
    return path;
  }
  fs::path packed(const std::string& text) {
    fs::path path = folder_ / "stems.csv.gz";
    gzFile file = gzopen(path.c_str(), "wb");
    gzwrite(file, text.data(), static_cast<unsigned>(text.size()));
    gzclose(file);
    return path;
  }
  // The complaint about a file with these rows after a header of all known columns.
  std::string complaint(const std::string& text) {
    Log log;
    try {
      (void)read_stem_views(plain(text), log);
    } catch (const InputError& error) {
      return error.what();
    }
    return "none";
  }
};

TEST_F(StemsFile, ReadsWhatIsNeededAndWhatIsKnown) {
  Log log;
  const auto views = read_stem_views(packed("frame,timestamp,x,y,z,axis_x,axis_y,axis_z,length_m,"
                                            "dbh_m,score\n"
                                            "3,7.5,1,-2,3,0,0,2,4,0.31,0.9\n"
                                            "3,7.5,5,6,7,,,,,,\n"
                                            "9,8.25,1e1,0,0,0.6,0,0.8,,,0.5\n"),
                                     log);
  ASSERT_EQ(views.size(), 2U);
  EXPECT_EQ(views[0].frame, 3);
  EXPECT_EQ(views[0].stamp, 7'500'000'000);
  ASSERT_EQ(views[0].stems.size(), 2U);
  EXPECT_EQ(views[0].stems[0].point, Eigen::Vector3f(1, -2, 3));
  EXPECT_EQ(views[0].stems[0].axis, Eigen::Vector3f(0, 0, 1));
  EXPECT_FLOAT_EQ(views[0].stems[0].dbh_m, 0.31F);
  EXPECT_TRUE(std::isnan(views[0].stems[1].axis.x()));
  EXPECT_TRUE(std::isnan(views[0].stems[1].score));
  EXPECT_FLOAT_EQ(views[1].stems[0].point.x(), 10.0F);
  EXPECT_TRUE(std::isnan(views[1].stems[0].length_m));
}

TEST_F(StemsFile, ReadsRadiusAndCovariance) {
  std::vector<std::string> said;
  Log log([&](LogLevel, const std::string& message) { said.push_back(message); });
  const auto views = read_stem_views(plain("frame,x,y,z,radius_m,radius_sd_m,xx,xy,yy,zz\n"
                                           "0,1,2,3,0.11,0.02,4e-4,-1e-4,9e-4,0.25\n"
                                           "0,4,5,6,,,,,,\n"),
                                     log);
  const Stem& stem = views.at(0).stems.at(0);
  EXPECT_FLOAT_EQ(stem.radius_m, 0.11F);
  EXPECT_FLOAT_EQ(stem.radius_sd_m, 0.02F);
  EXPECT_FLOAT_EQ(stem.xx, 4e-4F);
  EXPECT_FLOAT_EQ(stem.xy, -1e-4F);
  EXPECT_FLOAT_EQ(stem.yy, 9e-4F);
  EXPECT_FLOAT_EQ(stem.zz, 0.25F);
  EXPECT_TRUE(std::isnan(views[0].stems.at(1).zz));
  EXPECT_TRUE(said.empty());
  EXPECT_NE(complaint("frame,x,y,z,zz\n0,1,2,3,0\n").find("a variance above 0 in column 'zz'"),
            std::string::npos);
  for (const char* bad :
       {"radius_sd_m\n0,1,2,3,-0.1\n", "dbh_m\n0,1,2,3,-0.3\n", "length_m\n0,1,2,3,inf\n",
        "score\n0,1,2,3,inf\n", "xx\n0,1,2,3,inf\n", "xy\n0,1,2,3,-inf\n"})
    EXPECT_NE(complaint(std::string("frame,x,y,z,") + bad).find("in column '"), std::string::npos)
        << bad;
}

TEST_F(StemsFile, OnlyFrameAndPositionAreNeeded) {
  std::vector<std::string> said;
  Log log([&](LogLevel, const std::string& message) { said.push_back(message); });
  const auto views =
      read_stem_views(plain("colour,z,y,x,frame\r\nred,3,2,1,0\r\n\r\nred,6,5,4,4\r\n"), log);
  ASSERT_EQ(views.size(), 2U);
  EXPECT_EQ(views[1].stamp, 4'000'000'000);
  EXPECT_EQ(views[1].stems[0].point, Eigen::Vector3f(4, 5, 6));
  ASSERT_EQ(said.size(), 1U);
  EXPECT_NE(said[0].find("colour"), std::string::npos);
}

TEST_F(StemsFile, SaysWhatIsWrongAndWhere) {
  EXPECT_NE(complaint("").find("header"), std::string::npos);
  EXPECT_NE(complaint("frame,x,y\n0,1,2\n").find("column 'z'"), std::string::npos);
  EXPECT_NE(complaint("frame,x,y,z\n").find("at least one row"), std::string::npos);
  EXPECT_NE(complaint("frame,x,y,z\n0,1,2,3\n0,1,2\n").find("line 3: expected 4 cells"),
            std::string::npos);
  EXPECT_NE(complaint("frame,x,y,z\n0,1,two,3\n").find("line 2: expected a number in column 'y'"),
            std::string::npos);
  EXPECT_NE(complaint("frame,x,y,z\n0,1,,3\n").find("position"), std::string::npos);
  EXPECT_NE(complaint("frame,x,y,z\n0,1,nan,3\n").find("position"), std::string::npos);
  EXPECT_NE(complaint("frame,x,y,z\n0,1,1e30,3\n").find("position"), std::string::npos);
  EXPECT_NE(complaint("frame,x,y,z\nnone,1,2,3\n").find("frame number"), std::string::npos);
  EXPECT_NE(complaint("frame,x,y,z\n1,1,2,3\n0,1,2,3\n").find("line 3: expected the rows"),
            std::string::npos);
  EXPECT_NE(complaint("frame,timestamp,x,y,z\n0,5,1,2,3\n1,5,1,2,3\n").find("grows"),
            std::string::npos);
  EXPECT_NE(complaint("frame,timestamp,x,y,z\n0,5,1,2,3\n0,6,1,2,3\n").find("one timestamp"),
            std::string::npos);
  EXPECT_NE(complaint("frame,x,y,z,axis_x,axis_y,axis_z\n0,1,2,3,0,0,0\n").find("direction"),
            std::string::npos);
}

TEST_F(StemsFile, DamagedStreamIsBadInput) {
  std::string rows = "frame,x,y,z\n";
  for (int i = 0; i < 5000; ++i)
    rows += std::to_string(i / 50) + "," + std::to_string(0.37 * i) + ",2.5,1\n";
  const fs::path path = packed(rows);
  fs::resize_file(path, fs::file_size(path) / 2);
  Log log;
  try {
    (void)read_stem_views(path, log);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("undamaged gzip"), std::string::npos);
  }
  EXPECT_THROW((void)read_stem_views(folder_ / "none.csv.gz", log), InputError);
  EXPECT_THROW((void)read_stem_views(folder_.path(), log), InputError);
}

TEST_F(StemsFile, ReadsARealRecording) {
  const char* data = std::getenv("UNDERSTORY_DATA");
  const fs::path path = fs::path(data != nullptr ? data : UNDERSTORY_SOURCE_DIR "/../shared/data") /
                        "wild_places_v03/stems.csv.gz";
  if (!fs::exists(path)) GTEST_SKIP() << "no " << path;
  Log log;
  const auto views = read_stem_views(path, log);
  std::size_t stems = 0;
  for (const StemView& view : views)
    stems += view.stems.size();
  EXPECT_EQ(views.size(), 2409U);
  EXPECT_EQ(stems, 524'135U);
}

}  // namespace
}  // namespace understory
