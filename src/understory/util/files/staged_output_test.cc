#include "understory/util/files/staged_output.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

void put_text(const fs::path& path, const std::string& text) {
  std::ofstream(path) << text;
}

std::string text_of(const fs::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

TEST(StagedFile, TheFormerFileStaysUntilTheNewOneIsWhole) {
  const test::TemporaryFolder folder;
  const fs::path path = folder / "stems.csv.gz";
  put_text(path, "former");
  StagedFile staged(path, true);
  put_text(staged.part(), "half");
  EXPECT_EQ(text_of(path), "former");
  put_text(staged.part(), "whole");
  staged.commit();
  EXPECT_EQ(text_of(path), "whole");
  EXPECT_FALSE(fs::exists(staged.part()));
}

TEST(StagedFile, WhatFailsLeavesTheFolderAsItWas) {
  const test::TemporaryFolder folder;
  const fs::path path = folder / "stems.csv.gz";
  {
    StagedFile staged(path, false);
    put_text(staged.part(), "half");
    EXPECT_FALSE(fs::exists(path));
  }
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

}  // namespace
}  // namespace understory
