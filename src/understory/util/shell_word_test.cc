#include "understory/util/shell_word.h"

#include <gtest/gtest.h>

namespace understory {
namespace {

TEST(ShellWord, WhatAShellWouldSplitOrChangeStandsInQuotes) {
  for (const char* plain : {"runs/plot-7_b", "../run", "C:run", "päivä", "a@b,c=d%e+f"})
    EXPECT_EQ(shell_word(plain), plain);
  EXPECT_EQ(shell_word("my run"), "'my run'");
  EXPECT_EQ(shell_word("sim:demo?seed=4&duration_s=9"), "'sim:demo?seed=4&duration_s=9'");
  EXPECT_EQ(shell_word("Anna's $HOME"), "'Anna'\\''s $HOME'");
  EXPECT_EQ(shell_word(""), "''");
}

}  // namespace
}  // namespace understory
