#include "understory/util/files/output_guard.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <fstream>

#include "understory/util/files/file_lock.h"
#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

void put_mine(const fs::path& path) {
  fs::create_directories(path.parent_path());
  std::ofstream(path) << "mine";
}

class OutputGuard : public ::testing::Test {
 protected:
  OutputGuard() {
    put_mine(home_ / "data" / "walk.mcap");
    put_mine(home_ / "data" / "clouds" / "000000.pcd");
    put_mine(home_ / "other.mcap");
  }
  void expect_refused(const fs::path& output, const fs::path& input) const {
    EXPECT_THROW(refuse_input_as_output(output, {input}), RefusedOutput) << output << " " << input;
  }
  void expect_taken(const fs::path& output, const fs::path& input) const {
    EXPECT_NO_THROW(refuse_input_as_output(output, {input})) << output << " " << input;
  }

  test::TemporaryFolder folder_;
  fs::path home_ = folder_.path();
  fs::path walk_ = home_ / "data" / "walk.mcap";
  fs::path clouds_ = home_ / "data" / "clouds";
};

TEST_F(OutputGuard, RefusesTheInputByAnyName) {
  expect_refused(walk_, walk_);
  expect_refused(home_ / "data" / ".." / "data" / "walk.mcap", walk_);
  expect_refused(home_ / "data" / "." / "walk.mcap", walk_);
  expect_refused(clouds_.string() + "/", clouds_);
  expect_refused(fs::relative(walk_), walk_);
  fs::create_symlink(walk_, home_ / "link.mcap");
  expect_refused(home_ / "link.mcap", walk_);
  expect_refused(walk_, home_ / "link.mcap");
  fs::create_hard_link(walk_, home_ / "hard.mcap");
  expect_refused(home_ / "hard.mcap", walk_);
}

TEST_F(OutputGuard, RefusesWhatLiesInAnInput) {
  expect_refused(clouds_ / "run", clouds_);
  expect_refused(clouds_ / "a" / "b" / "out.mcap", clouds_);
  fs::create_directory_symlink(clouds_, home_ / "link");
  expect_refused(home_ / "link" / "run", clouds_);
  expect_refused(clouds_ / "run", home_ / "link");
}

TEST_F(OutputGuard, RefusesWhatHoldsAnInput) {
  expect_refused(home_ / "data", walk_);
  expect_refused(home_, walk_);
  expect_refused("/", walk_);
  expect_refused(home_ / "data", clouds_);
  // A link to the input is lost with the folder that holds it.
  put_mine(home_ / "elsewhere" / "notes");
  fs::create_symlink(walk_, home_ / "elsewhere" / "walk.mcap");
  expect_refused(home_ / "elsewhere", home_ / "elsewhere" / "walk.mcap");
}

TEST_F(OutputGuard, RefusesWhatAnInputFolderLinksTo) {
  fs::create_symlink(home_ / "other.mcap", clouds_ / "part.mcap");
  expect_refused(home_ / "other.mcap", clouds_);
  put_mine(home_ / "hard.mcap");
  fs::create_hard_link(home_ / "hard.mcap", clouds_ / "hard.mcap");
  expect_refused(home_ / "hard.mcap", clouds_);
}

TEST_F(OutputGuard, TakesAPlaceOfItsOwn) {
  expect_taken(home_ / "run", walk_);
  expect_taken(home_ / "data" / "run", walk_);
  expect_taken(home_ / "data" / "clouds2", clouds_);
  expect_taken(home_ / "data" / "walk.mcap2", walk_);
  expect_taken(home_ / "run", "");
  expect_taken(home_ / "run", home_ / "missing");
  expect_taken(home_ / "run", "sim:demo");
}

TEST_F(OutputGuard, ReplacesARegularFileOnlyWhenAsked) {
  EXPECT_EQ(place_of_file(home_ / "new.mcap", false), home_ / "new.mcap");
  EXPECT_THROW((void)place_of_file(walk_, false), RefusedOutput);
  EXPECT_EQ(place_of_file(walk_, true), walk_);
  EXPECT_THROW((void)place_of_file(clouds_, true), RefusedOutput);
  EXPECT_THROW((void)place_of_file(home_ / "missing" / "x", true), OutputError);
  EXPECT_THROW((void)place_of_file(walk_ / "x", true), OutputError);
  EXPECT_THROW((void)place_of_file("", true), ConfigError);
  EXPECT_THROW((void)place_of_file("/dev/null", true), RefusedOutput);
  fs::create_symlink(walk_, home_ / "link.mcap");
  EXPECT_EQ(place_of_file(home_ / "link.mcap", true), fs::canonical(walk_));
  fs::create_symlink(home_ / "nothing", home_ / "dangling.mcap");
  EXPECT_THROW((void)place_of_file(home_ / "dangling.mcap", true), RefusedOutput);
  ASSERT_EQ(::mkfifo((home_ / "pipe").c_str(), 0600), 0);
  EXPECT_THROW((void)place_of_file(home_ / "pipe", true), RefusedOutput);
}

TEST_F(OutputGuard, FoldersThatWereMadeGoAgainUnlessTheyAreUsed) {
  { const MadeFolders made(home_ / "a" / "b"); }
  EXPECT_FALSE(fs::exists(home_ / "a"));
  {
    const MadeFolders made(home_ / "a" / "b" / "");
    put_mine(home_ / "a" / "mine");
  }
  EXPECT_TRUE(fs::exists(home_ / "a" / "mine"));
  EXPECT_FALSE(fs::exists(home_ / "a" / "b"));
  { const MadeFolders made(home_ / "data"); }
  EXPECT_TRUE(fs::exists(home_ / "data"));
  EXPECT_THROW(MadeFolders(walk_ / "x"), OutputError);
}

TEST_F(OutputGuard, ALockIsHeldByOneAndFallsWithItsProcess) {
  const fs::path path = home_ / "lock";
  EXPECT_FALSE(FileLock::holder(path).has_value());
  {
    const std::optional<FileLock> lock = FileLock::take(path);
    ASSERT_TRUE(lock.has_value());
    EXPECT_FALSE(FileLock::take(path).has_value());
    EXPECT_EQ(FileLock::holder(path), ::getpid());
  }
  EXPECT_FALSE(FileLock::holder(path).has_value());
  int ready[2];
  ASSERT_EQ(::pipe(ready), 0);
  const pid_t child = ::fork();
  if (child == 0) {
    const std::optional<FileLock> lock = FileLock::take(path);
    (void)!::write(ready[1], "x", 1);
    ::pause();
    ::_exit(lock.has_value() ? 0 : 1);
  }
  char byte = 0;
  ASSERT_EQ(::read(ready[0], &byte, 1), 1);
  EXPECT_EQ(FileLock::holder(path), child);
  EXPECT_FALSE(FileLock::take(path).has_value());
  ::kill(child, SIGKILL);
  ::waitpid(child, nullptr, 0);
  EXPECT_TRUE(FileLock::take(path).has_value());
}

// It was said of a hidden folder below it that it cannot be made.
TEST_F(OutputGuard, NamesTheFileThatAFolderWouldLieIn) {
  for (const fs::path& output : {walk_ / "run", walk_ / "a" / "run", fs::relative(walk_) / "run"}) {
    try {
      refuse_folder_in_file(output);
      ADD_FAILURE() << output << " was taken";
    } catch (const RefusedOutput& refusal) {
      EXPECT_NE(std::string(refusal.what()).find("walk.mcap is a file"), std::string::npos)
          << refusal.what();
    }
  }
  EXPECT_NO_THROW(refuse_folder_in_file(home_ / "data" / "run"));
  EXPECT_NO_THROW(refuse_folder_in_file(home_ / "not there" / "run"));
  EXPECT_NO_THROW(refuse_folder_in_file("run"));
}

}  // namespace
}  // namespace understory
