#include "understory/pipeline/run_folder/run_version.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "understory/output/run_summary.h"
#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"
#include "understory/util/version.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

class RunVersionTest : public ::testing::Test {
 protected:
  void write(const std::string& version, int format, const std::string& command = "map") {
    std::ofstream(folder_ / "run.json")
        << fmt::format(R"({{"command": "{}", "status": "complete", "version": "{}", )"
                       R"("format": {}, "files": ["trees.csv"]}})",
                       command, version, format);
  }
  void leave_work(int format) {
    fs::create_directories(folder_ / ".understory");
    std::ofstream(folder_ / ".understory" / "marker")
        << "Understory: work folder of a run\nformat: " << format << "\nversion: 1\n";
    std::ofstream(folder_ / ".understory" / "checkpoint.bin") << "half";
  }
  // What is said of a path: an error, or the warnings.
  [[nodiscard]] static std::string said_of(const fs::path& path) {
    Log log;
    try {
      check_given_run(path, log);
    } catch (const InputError& error) {
      return error.what();
    }
    std::string said;
    for (const Log::Warning& warning : log.warnings())
      said += warning.key + ": " + warning.first_message;
    return said;
  }
  [[nodiscard]] std::string said() const { return said_of(folder_.path()); }

  test::TemporaryFolder folder_;
};

TEST_F(RunVersionTest, ARunOfThisVersionOrAnOlderOneIsRead) {
  EXPECT_EQ(said(), "");
  write(kVersion, kRunFormat);
  EXPECT_EQ(said(), "");
  write("0.0.9", kRunFormat);
  EXPECT_EQ(said(), "");
  std::ofstream(folder_ / "run.json")
      << R"({"command": "map", "status": "partial", "version": "0"})";
  EXPECT_EQ(said(), "");  // of a version that named no format
}

// It was read in silence.
TEST_F(RunVersionTest, ANewerVersionIsWarnedOfAndANewerFormatRefused) {
  for (const char* version : {"0.10.0", "1.0", "2"}) {
    write(version, kRunFormat);
    EXPECT_EQ(said().rfind("run.newer_version: ", 0), 0U) << version << said();
  }
  write("1.2.3", kRunFormat + 1, "a command of the future");
  EXPECT_NE(said().find("was written by version 1.2.3"), std::string::npos) << said();
  EXPECT_EQ(said().find("run.newer_version"), std::string::npos) << said();
}

TEST_F(RunVersionTest, AFileOfARunIsCheckedAndAStrangerBesideItIsNot) {
  write("9.9", kRunFormat + 1);
  for (const char* name : {"trees.csv", "mine.csv"})
    std::ofstream(folder_ / name) << "x";
  EXPECT_NE(said_of(folder_ / "trees.csv").find("version 9.9"), std::string::npos);
  EXPECT_EQ(said_of(folder_ / "mine.csv"), "");
  EXPECT_EQ(said_of(folder_ / "nothing"), "");
}

TEST_F(RunVersionTest, AnotherProgramsRunJsonIsNoRun) {
  std::ofstream(folder_ / "run.json")
      << R"({"command": "train.py", "status": "ok", "version": "9"})";
  EXPECT_EQ(said(), "");
}

TEST_F(RunVersionTest, AnUnfinishedRunIsNamedWithTheCommandThatFinishesIt) {
  leave_work(1);
  EXPECT_NE(said().find("`understory map --resume " + folder_.path().string() + "` finishes it"),
            std::string::npos)
      << said();
  write(kVersion, kRunFormat);  // its results so far, or those of a run before it
  EXPECT_EQ(said(), "");
  leave_work(2);
  EXPECT_NE(said().find("work folder has format 2"), std::string::npos) << said();
}

}  // namespace
}  // namespace understory
