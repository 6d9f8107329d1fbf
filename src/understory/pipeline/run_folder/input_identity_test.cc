#include "understory/pipeline/run_folder/input_identity.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>

#include "understory/pipeline/source.h"
#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"
#include "understory/util/log.h"

namespace understory {
namespace {

class InputIdentityTest : public ::testing::Test {
 protected:
  std::string file(const std::string& name, const std::string& content) const {
    const std::filesystem::path path = folder_ / name;
    std::filesystem::create_directories(path.parent_path());
    std::ofstream(path, std::ios::binary) << content;
    return path.string();
  }
  static bool same(const std::string& a, const std::string& b) {
    return identify("the recording", a).mark == identify("the recording", b).mark;
  }
  const test::TemporaryFolder folder_;
};

TEST_F(InputIdentityTest, AFileIsKnownBySizeHeadAndTail) {
  const std::string long_file(3'000'000, 'a');
  const std::string a = file("a", long_file);
  EXPECT_TRUE(same(a, file("copy", long_file)));
  EXPECT_FALSE(same(a, file("longer", long_file + "a")));
  for (const std::size_t at : {std::size_t{0}, long_file.size() - 1}) {
    std::string other = long_file;
    other[at] = 'b';
    EXPECT_FALSE(same(a, file("other", other))) << at;
  }
  EXPECT_TRUE(same(file("empty", ""), file("empty too", "")));
  EXPECT_THROW(static_cast<void>(identify("the recording", folder_ / "none")), InputError);
}

TEST_F(InputIdentityTest, AFolderIsKnownByNamesAndSizes) {
  for (const char* name : {"x/1.pcd", "x/deep/2.pcd", "y/1.pcd", "y/deep/2.pcd"})
    file(name, "cloud");
  EXPECT_TRUE(same(folder_ / "x", folder_ / "y"));
  file("y/3.pcd", "");
  EXPECT_FALSE(same(folder_ / "x", folder_ / "y"));
}

// Parts of a bag that lie elsewhere were read, but neither guarded, nor known again, nor hashed.
TEST_F(InputIdentityTest, PartsOfABagElsewhereAreInputs) {
  file("bag/a_0.db3", "part");
  const std::string other = file("other/a_1.db3", "part");
  const auto metadata = [&](const std::string& second) {
    file("bag/metadata.yaml",
         "rosbag2_bagfile_information:\n  relative_file_paths: [a_0.db3, " + second + "]\n");
  };
  const std::string bag = folder_ / "bag";
  metadata("missing.db3");
  EXPECT_EQ(files_of(bag, {}).size(), 3U);  // metadata and extrinsics are not named
  for (const std::string& name : {std::string("../other/a_1.db3"), other}) {
    metadata(name);
    const auto files = files_of(bag, {});
    ASSERT_EQ(files.size(), 4U) << name;
    EXPECT_EQ(files.back(), other);
    Log log;
    const auto hashes = hash_inputs(bag, log);
    ASSERT_EQ(hashes.size(), 3U);
    EXPECT_EQ(std::count_if(hashes.begin(), hashes.end(),
                            [](const InputHash& hash) { return hash.file == "a_1.db3"; }),
              1);
    const InputIdentity then = identify("the recording", bag);
    EXPECT_NO_THROW(expect_same({then}, {identify("the recording", bag)}));
    file("other/a_1.db3", "longer part");
    EXPECT_THROW(expect_same({then}, {identify("the recording", bag)}), InputError);
    file("other/a_1.db3", "part");
  }
}

// A site's own file and its list of trees were looked for in the folder of the resuming call.
TEST_F(InputIdentityTest, ASimulationIsFoundFromElsewhere) {
  EXPECT_EQ(named_from("/begun", "a.mcap"), "/begun/a.mcap");
  EXPECT_EQ(named_from("/begun", "/b/a.mcap"), "/b/a.mcap");
  EXPECT_EQ(named_from("/begun", "sim:demo?seed=3"), "sim:demo?seed=3");
  EXPECT_EQ(named_from("/begun", "sim:s.yaml?cache=c&stand.trees=t/x.csv&seed=3"),
            "sim:/begun/s.yaml?cache=/begun/c&stand.trees=/begun/t/x.csv&seed=3");
  const std::string site = file("s.yaml", "stand:\n  trees: t.csv\n");
  EXPECT_EQ(named_from(folder_.path(), "sim:s.yaml"),
            "sim:" + site + "?stand.trees=" + (folder_.path() / "t.csv").string());
}

// An end of the recording that a failing disk kept back when the run began, or keeps back now.
TEST_F(InputIdentityTest, AnEndThatCannotBeReadTellsNothing) {
  const auto recording = [](const std::string& mark) {
    return std::vector<InputIdentity>{{"the recording", "a.mcap", mark}};
  };
  const auto whole = recording("9 bytes, 01234567 89abcdef");
  const auto cut_off = recording("9 bytes, 01234567 --------");
  EXPECT_NO_THROW(expect_same(cut_off, whole));
  EXPECT_NO_THROW(expect_same(whole, cut_off));
  EXPECT_NO_THROW(expect_same(cut_off, cut_off));
  EXPECT_THROW(expect_same(cut_off, recording("9 bytes, 76543210 89abcdef")), InputError);
  EXPECT_THROW(expect_same(cut_off, recording("8 bytes, 01234567 89abcdef")), InputError);
}

TEST_F(InputIdentityTest, AnotherInputIsRefusedByName) {
  const InputIdentity then = identify("the extrinsics", file("e.yaml", "one"));
  EXPECT_NO_THROW(expect_same({then}, {then}));
  const InputIdentity now = identify("the extrinsics", file("e.yaml", "two"));
  try {
    expect_same({then}, {now});
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("is not the extrinsics that the run was begun with"),
              std::string::npos);
  }
}

// A disk that goes away after the last scan costs a hash, not the run.
TEST_F(InputIdentityTest, WhatCannotBeReadAtTheEndHasNoHash) {
  Log log;
  const auto there = hash_inputs(file("there", "bytes"), log);
  ASSERT_EQ(there.size(), 1U);
  EXPECT_EQ(there[0].sha256.size(), 64U);
  EXPECT_TRUE(log.warnings().empty());
  const auto gone = hash_inputs(folder_ / "gone", log);
  ASSERT_EQ(gone.size(), 1U);
  EXPECT_EQ(gone[0].file, "gone");
  EXPECT_TRUE(gone[0].sha256.empty());
  ASSERT_EQ(log.warnings().size(), 1U);
  EXPECT_EQ(log.warnings()[0].key, "recording.no_hash");
}

}  // namespace
}  // namespace understory
