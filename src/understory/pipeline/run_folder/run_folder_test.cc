#include "understory/pipeline/run_folder/run_folder.h"

#include <gtest/gtest.h>

#include <fstream>
#include <functional>
#include <map>
#include <sstream>
#include <string>

#include "understory/pipeline/run_folder/run_results.h"
#include "understory/util/files/folder_test_support.h"
#include "understory/util/files/output_guard.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

void put(const fs::path& path, const std::string& text) {
  fs::create_directories(path.parent_path());
  std::ofstream(path) << text;
}

std::string text_of(const fs::path& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

std::string run_json_of(const std::string& command) {
  return R"({"status": "complete", "command": ")" + command + R"(", "version": "0"})";
}

// Every path below a folder with its content.
std::map<std::string, std::string> snapshot(const fs::path& folder) {
  std::map<std::string, std::string> content;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder))
    content[entry.path().string()] = entry.is_regular_file() ? text_of(entry.path()) : "";
  return content;
}

class RunFolders : public ::testing::Test {
 protected:
  // A command that writes these files and run.json.
  void run(const std::map<std::string, std::string>& files, bool overwrite = false,
           bool keep_former = false) {
    const RunFolder place = RunFolder::claim(run_, overwrite);
    const fs::path results = place.begin_results();
    for (const auto& [name, text] : files)
      put(results / name, text);
    put(results / "run.json", run_json_of("map"));
    place.commit(log_, keep_former);
    place.forget_state();
  }
  // A run that was killed after its first checkpoint.
  void leave_unfinished() {
    const RunFolder place = RunFolder::claim(run_, false);
    put(place.work() / "checkpoint.bin", "half");
    put(place.work() / "journal.bin", "records");
  }
  void expect_refused(bool overwrite) {
    const auto before = snapshot(folder_.path());
    EXPECT_THROW((void)RunFolder::claim(run_, overwrite), RefusedOutput);
    EXPECT_EQ(snapshot(folder_.path()), before);
  }

  test::TemporaryFolder folder_;
  fs::path run_ = folder_.path() / "run";
  Log log_;
};

TEST_F(RunFolders, ResultsAppearTogetherAndTheWorkFolderGoes) {
  {
    const RunFolder place = RunFolder::claim(run_, false);
    EXPECT_TRUE(fs::exists(run_ / ".understory" / "marker"));
    const fs::path results = place.begin_results();
    put(results / "trajectory.tum", "1");
    put(results / "run.json", run_json_of("map"));
    EXPECT_FALSE(fs::exists(run_ / "trajectory.tum"));
    place.commit(log_);
  }
  EXPECT_EQ(text_of(run_ / "trajectory.tum"), "1");
  const std::set<std::string> both = {"run.json", "trajectory.tum"};
  EXPECT_EQ(former_results(run_).names, both);
  EXPECT_FALSE(fs::exists(run_ / ".understory"));
}

TEST_F(RunFolders, WhatFailsLeavesNothing) {
  {
    const RunFolder place = RunFolder::claim(run_ / "below", false);
    put(place.begin_results() / "map.laz", "half");
  }
  EXPECT_FALSE(fs::exists(run_));
  run({{"map.laz", "first"}});
  const auto before = snapshot(run_);
  { put(RunFolder::claim(run_, true).begin_results() / "map.laz", "half"); }
  EXPECT_EQ(snapshot(run_), before);
}

TEST_F(RunFolders, ARunIsReplacedOnlyWhenAsked) {
  run({{"map.laz", "first"}});
  expect_refused(false);
  run({{"map.laz", "second"}}, true);
  EXPECT_EQ(text_of(run_ / "map.laz"), "second");
  EXPECT_FALSE(fs::exists(run_ / "former-1"));
}

// A run with its map switched off took the map of the run before with it.
TEST_F(RunFolders, WhatARunDoesNotMakeIsKeptApart) {
  run({{"map.laz", "first"}, {"trees.csv", "first"}, {"trajectory.tum", "first"}});
  const std::string first = text_of(run_ / "run.json");
  run({{"trajectory.tum", "second"}}, true);
  EXPECT_EQ(text_of(run_ / "trajectory.tum"), "second");
  EXPECT_FALSE(fs::exists(run_ / "map.laz"));
  EXPECT_EQ(text_of(run_ / "former-1" / "map.laz"), "first");
  EXPECT_EQ(text_of(run_ / "former-1" / "trees.csv"), "first");
  EXPECT_EQ(text_of(run_ / "former-1" / "run.json"), first);
  ASSERT_EQ(log_.warnings().size(), 1U);
  EXPECT_EQ(log_.warnings().front().key, "run.former_results");
  run({{"map.laz", "third"}}, true);
  EXPECT_EQ(text_of(run_ / "former-1" / "map.laz"), "first");
  EXPECT_EQ(text_of(run_ / "former-2" / "trajectory.tum"), "second");
  run({{"map.laz", "stopped"}}, true, true);
  EXPECT_EQ(text_of(run_ / "former-3" / "map.laz"), "third");
}

TEST_F(RunFolders, FilesOfOthersAreNeverTouched) {
  for (const std::string& name : result_names()) {
    put(run_ / name, "mine");
    expect_refused(false);
    expect_refused(true);
    fs::remove(run_ / name);
  }
  put(run_ / "run.json", R"({"command": "train.py", "version": "1"})");
  expect_refused(true);
  fs::remove(run_ / "run.json");
  fs::create_symlink("/nowhere", run_ / "map.laz");
  expect_refused(true);
  fs::remove(run_ / "map.laz");
  put(run_ / ".understory" / "notes", "mine");
  expect_refused(true);
  put(run_ / ".understory" / "marker", "Understory: work folder of a run\nformat: 99\n");
  expect_refused(true);
}

TEST_F(RunFolders, AFileThatWasLaidBesideARunIsNotItsOwn) {
  run({{"map.laz", "first"}});
  put(run_ / "dtm.tif", "mine");
  put(run_ / "work" / "checkpoint.bin", "mine");
  expect_refused(true);
  fs::remove(run_ / "dtm.tif");
  run({{"map.laz", "second"}}, true);
  EXPECT_EQ(text_of(run_ / "work" / "checkpoint.bin"), "mine");
}

TEST_F(RunFolders, AFileThatCameWhileTheRunWasAtWorkStays) {
  const RunFolder place = RunFolder::claim(run_, false);
  put(place.begin_results() / "map.laz", "first");
  put(run_ / "map.laz", "mine");
  EXPECT_THROW(place.commit(log_), RefusedOutput);
  EXPECT_EQ(text_of(run_ / "map.laz"), "mine");
}

// --overwrite went ahead while a run was at work.
TEST_F(RunFolders, OneCommandAtATime) {
  const RunFolder place = RunFolder::claim(run_, false);
  expect_refused(false);
  expect_refused(true);
  put(place.work() / "checkpoint.bin", "half");
  expect_refused(true);
  EXPECT_THROW((void)RunFolder::reclaim(run_), RefusedOutput);
}

TEST_F(RunFolders, AnUnfinishedRunIsKeptAndResumed) {
  leave_unfinished();
  EXPECT_TRUE(holds_unfinished_run(run_));
  expect_refused(false);
  {
    const RunFolder place = RunFolder::reclaim(run_);
    EXPECT_EQ(text_of(place.work() / "journal.bin"), "records");
  }
  EXPECT_TRUE(holds_unfinished_run(run_));
  run({{"map.laz", "anew"}}, true);
  EXPECT_FALSE(fs::exists(run_ / ".understory"));
  EXPECT_THROW((void)RunFolder::reclaim(run_), InputError);
  EXPECT_THROW((void)RunFolder::reclaim(folder_.path() / "none"), InputError);
}

TEST_F(RunFolders, OtherThingsInTheWorkFolderStay) {
  leave_unfinished();
  put(run_ / ".understory" / "notes.txt", "mine");
  run({{"map.laz", "anew"}}, true);
  EXPECT_EQ(text_of(run_ / ".understory" / "notes.txt"), "mine");
  EXPECT_FALSE(fs::exists(run_ / ".understory" / "journal.bin"));
}

TEST_F(RunFolders, WhatAKilledCommandLeftIsClearedAway) {
  put(run_ / ".understory" / "lock", "");
  run({{"map.laz", "first"}});
  fs::remove_all(run_);
  put(run_ / ".understory" / "marker", "Understory: work folder of a run\nformat: 1\n");
  put(run_ / ".understory" / "results" / "map.laz", "half");
  // Killed while results were being put in place: their names are known to be its own.
  put(run_ / ".understory" / "placed", "dtm.tif\nmap.laz\nrun.json\n");
  put(run_ / "dtm.tif", "of the killed command");
  run({{"map.laz", "second"}, {"dtm.tif", "second"}});
  EXPECT_EQ(text_of(run_ / "dtm.tif"), "second");
  EXPECT_FALSE(fs::exists(run_ / ".understory"));
}

}  // namespace
}  // namespace understory
