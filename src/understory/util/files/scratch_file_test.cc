#include "understory/util/files/scratch_file.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <vector>

#include "understory/util/error.h"

namespace understory {
namespace {

TEST(ScratchFile, PartsComeBackAndTheFolderStaysEmpty) {
  const std::filesystem::path folder = std::filesystem::temp_directory_path() / "scratch_file_test";
  std::filesystem::create_directories(folder);
  {
    ScratchFile file(folder);
    const std::vector<int> first = {1, 2, 3};
    const std::vector<int> second(100'000, 7);
    const auto a = file.append(first.data(), first.size() * sizeof(int));
    const auto b = file.append(second.data(), second.size() * sizeof(int));
    std::vector<int> read(second.size());
    file.read(b, read.data());
    EXPECT_EQ(read, second);
    read.resize(first.size());
    file.read(a, read.data());
    EXPECT_EQ(read, first);
    EXPECT_TRUE(std::filesystem::is_empty(folder));
  }
  std::filesystem::remove(folder);
}

TEST(ScratchFile, AFolderThatIsNotThereIsAnOutputError) {
  EXPECT_THROW(ScratchFile("/nonexistent/folder"), OutputError);
}

}  // namespace
}  // namespace understory
