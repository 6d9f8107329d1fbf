#include "understory/pipeline/run_folder/run_json.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cmath>
#include <fstream>

#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

using Texts = std::vector<std::string>;

class RunJsonTest : public ::testing::Test {
 protected:
  void write(const std::string& text) { std::ofstream(folder_ / "run.json") << text; }
  [[nodiscard]] RunJson read() const { return RunJson(folder_.path()); }

  test::TemporaryFolder folder_;
};

TEST_F(RunJsonTest, AMissingOneIsAbsent) {
  EXPECT_FALSE(read().is_present());
  EXPECT_FALSE(read().is_object());
  EXPECT_FALSE(read().has("/status"));
}

TEST_F(RunJsonTest, APipeIsNotWaitedFor) {
  ASSERT_EQ(::mkfifo((folder_ / "run.json").c_str(), 0600), 0);
  EXPECT_FALSE(read().is_present());
}

TEST_F(RunJsonTest, ABrokenOneIsThereAndNoObject) {
  for (const char* text : {"", "{\"status\": ", "[1, 2]", "7"}) {
    write(text);
    EXPECT_TRUE(read().is_present()) << text;
    EXPECT_FALSE(read().is_object()) << text;
    EXPECT_TRUE(read().find_text("/status").empty()) << text;
    EXPECT_TRUE(std::isnan(read().find_number("/status"))) << text;
  }
}

TEST_F(RunJsonTest, OnlyOneWithCommandStatusAndVersionIsOurs) {
  write(R"({"command": "map", "status": "partial", "version": "1"})");
  EXPECT_TRUE(read().is_ours());
  for (const char* text : {R"({"command": "mop", "status": "partial", "version": "1"})",
                           R"({"command": "map", "status": "ready", "version": "1"})",
                           R"({"command": "map", "status": "partial"})"}) {
    write(text);
    EXPECT_FALSE(read().is_ours()) << text;
  }
}

TEST_F(RunJsonTest, WhatIsFoundHasItsType) {
  write(R"({"quality": {"area_m2": 836.5, "name": "plot"}, "reasons": ["a", 1, "b"],
            "inputs": [{"file": "x.mcap"}, {"other": 1}, 5, {"file": 3}, {"file": "y.mcap"}]})");
  const RunJson json = read();
  EXPECT_EQ(json.find_number("/quality/area_m2"), 836.5);
  EXPECT_TRUE(std::isnan(json.find_number("/quality/name")));
  EXPECT_TRUE(std::isnan(json.find_number("/quality/name/deeper")));
  EXPECT_EQ(json.find_text("/quality/name"), "plot");
  EXPECT_EQ(json.find_text("/quality/area_m2"), "");
  EXPECT_EQ(json.find_texts("/reasons"), (Texts{"a", "b"}));
  EXPECT_EQ(json.find_texts_of("/inputs", "file"), (Texts{"x.mcap", "y.mcap"}));
  EXPECT_TRUE(json.find_texts("/quality").empty());
}

TEST_F(RunJsonTest, WhatIsNeededAndWrongIsNamed) {
  write(R"({"yes": true, "three": [1, null, 3], "pose": {"translation_m": [1, 2, 3],
            "rotation_xyzw": [0, 0, 0, 1]}, "lost": {"translation_m": [1, null, 3],
            "rotation_xyzw": [0, 0, 0, 1]}})");
  const RunJson json = read();
  EXPECT_TRUE(json.get_flag("/yes"));
  EXPECT_TRUE(std::isnan(json.get_numbers("/three", 3)[1]));
  EXPECT_EQ(json.get_pose("/pose").translation(), Eigen::Vector3d(1, 2, 3));
  EXPECT_THROW((void)json.get_numbers("/three", 4), InputError);
  EXPECT_THROW((void)json.get_flag("/three"), InputError);
  EXPECT_THROW((void)json.get_pose("/lost"), InputError);
  try {
    (void)json.get_number("/quality/area_m2");
    FAIL() << "a missing number was read";
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()),
              (folder_ / "run.json").string() + ": /quality/area_m2: expected a number");
  }
}

TEST_F(RunJsonTest, TheListOfFilesIsWrittenAnew) {
  write(R"({"command": "map", "status": "partial", "version": "1", "files": ["old"]})");
  write_file_list(folder_.path(), {"map.laz", "run.json"});
  EXPECT_EQ(read().find_texts("/files"), (Texts{"map.laz", "run.json"}));
  EXPECT_EQ(read().find_text("/status"), "partial");
}

}  // namespace
}  // namespace understory
