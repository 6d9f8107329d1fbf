#include "understory/pipeline/judgement/inherited_trust.h"

#include <gtest/gtest.h>

#include <fstream>

#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

using Reasons = std::vector<std::string>;

class InheritedTrustTest : public ::testing::Test {
 protected:
  InheritedTrustTest() { std::filesystem::create_directories(run_); }
  void put(const std::string& name, const std::string& text) { std::ofstream(run_ / name) << text; }

  test::TemporaryFolder folder_;
  std::filesystem::path run_ = folder_ / "forest";
};

TEST_F(InheritedTrustTest, StatusAndReasonsComeWithTheNameOfTheRun) {
  put("run.json", R"({"status": "partial", "reasons": ["cut off", "stopped"]})");
  for (const std::filesystem::path& given : {run_, run_ / "", run_ / "map.laz", run_ / "."}) {
    const InheritedTrust trust = trust_of_run(given);
    EXPECT_EQ(trust.status, RunStatus::kPartial) << given;
    EXPECT_EQ(trust.reasons, (Reasons{"run forest: cut off", "run forest: stopped"})) << given;
  }
  put("run.json", R"({"status": "untrusted"})");
  EXPECT_EQ(trust_of_run(run_).reasons, Reasons{"run forest: it is untrusted"});
  put("run.json", R"({"status": "complete", "reasons": []})");
  EXPECT_EQ(trust_of_run(run_).status, RunStatus::kComplete);
  EXPECT_TRUE(trust_of_run(run_).reasons.empty());
}

TEST_F(InheritedTrustTest, WhatCannotBeReadIsNotTrusted) {
  for (const char* text :
       {"", "{\"status\": ", "[]", "{}", R"({"status": 3})", R"({"status": "fine"})"}) {
    put("run.json", text);
    EXPECT_EQ(trust_of_run(run_).status, RunStatus::kUntrusted) << text;
    ASSERT_EQ(trust_of_run(run_).reasons.size(), 1U) << text;
    EXPECT_EQ(trust_of_run(run_).reasons[0].rfind("run forest: its run.json ", 0), 0U) << text;
  }
}

TEST_F(InheritedTrustTest, ARunFolderHasToHaveARunJson) {
  EXPECT_EQ(trust_of_run(run_).status, RunStatus::kComplete);  // a folder with nothing of a run
  EXPECT_EQ(trust_of_run(run_, true).status, RunStatus::kUntrusted);
  put("trajectory.tum", "");
  ASSERT_EQ(trust_of_run(run_).reasons.size(), 1U);
  EXPECT_NE(trust_of_run(run_).reasons[0].find("no run.json"), std::string::npos);
  EXPECT_EQ(trust_of_run(run_ / "trees.csv", true).status, RunStatus::kComplete);  // just a file
  put("site.yaml", "");  // the truth of the simulator
  EXPECT_EQ(trust_of_run(run_).status, RunStatus::kComplete);
}

TEST_F(InheritedTrustTest, TheLowerStatusStays) {
  RunStatus status = RunStatus::kPartial;
  Reasons reasons = {"own", "run a: old"};
  inherit({RunStatus::kComplete, {}}, status, reasons);
  EXPECT_EQ(status, RunStatus::kPartial);
  inherit({RunStatus::kUntrusted, {"run a: old", "run b: older"}}, status, reasons);
  EXPECT_EQ(status, RunStatus::kUntrusted);
  EXPECT_EQ(reasons, (Reasons{"run a: old", "run b: older", "own"}));
  inherit({RunStatus::kPartial, {"run c: cut"}}, status, reasons);
  EXPECT_EQ(status, RunStatus::kUntrusted);
}

}  // namespace
}  // namespace understory
