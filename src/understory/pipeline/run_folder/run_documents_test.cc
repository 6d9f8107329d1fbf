#include "understory/pipeline/run_folder/run_documents.h"

#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"
#include "understory/util/version.h"

namespace understory {
namespace {

using Reasons = std::vector<std::string>;

class RunDocumentsTest : public ::testing::Test {
 protected:
  [[nodiscard]] std::string text(const std::string& name) const {
    std::ifstream file(folder_ / name);
    std::ostringstream content;
    content << file.rdbuf();
    return content.str();
  }
  [[nodiscard]] nlohmann::json json() const { return nlohmann::json::parse(text("run.json")); }
  [[nodiscard]] RunDocuments documents() const { return {"inventory", {}, times_, log_}; }

  test::TemporaryFolder folder_;
  StageTimes times_;
  Log log_;
};

TEST_F(RunDocumentsTest, WhatAllCommandsHaveInCommonIsThere) {
  ConfigRecord config;
  config.asked_yaml = "cell_m: 0.5\nname: plot\n";
  config.effective_yaml = "cell_m: 0.25\nname: plot\n";
  config.origins["cell_m"] = "--set";
  config.adapted.push_back({"cell_m", "0.5", "0.25", 0.0, "it is sparse"});
  RunDocuments documents("inventory", config, times_, log_, [] { return 12.5; });
  std::ofstream(folder_ / "cloud.laz") << "abc";
  documents.add_input(folder_ / "cloud.laz");
  documents.add_inputs({{"other.pcap", 7, ""}});
  documents.count("trees", 3);
  times_.add("reading", 100.0, 50.0);  // later than the documents: they look at the end
  log_.warn("imu.gap", "0.4 s without IMU");
  documents.remark("inventory", "ground was seen in 10 % of the cells");
  documents.write(folder_.path());
  const nlohmann::json run = json();
  EXPECT_EQ(run["command"], "inventory");
  EXPECT_EQ(run["version"], kVersion);
  EXPECT_EQ(run["status"], "complete");
  EXPECT_EQ(run["config"]["cell_m"], 0.5);
  EXPECT_EQ(run["effective_config"]["cell_m"], 0.25);
  EXPECT_EQ(run["config_origins"]["cell_m"], "--set");
  EXPECT_EQ(run["adapted"][0]["why"], "it is sparse");
  EXPECT_EQ(run["inputs"][0]["file"], "cloud.laz");
  EXPECT_EQ(run["inputs"][0]["bytes"], 3);
  EXPECT_EQ(run["inputs"][0]["sha256"],
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(run["inputs"][1]["file"], "other.pcap");
  EXPECT_EQ(run["counts"]["trees"], 3);
  EXPECT_EQ(run["stages"]["reading"]["total_wall_s"], 0.1);
  EXPECT_EQ(run["wall_s"], 12.5);
  EXPECT_GT(run["cpu_s"], 0.0);
  EXPECT_GT(run["peak_memory_mb"], 1.0);
  ASSERT_EQ(run["warnings"].size(), 2U);
  EXPECT_EQ(run["warnings"][0]["key"], "imu.gap");
  EXPECT_EQ(run["warnings"][1]["message"], "ground was seen in 10 % of the cells");
}

TEST_F(RunDocumentsTest, TheReportSaysTheSame) {
  RunDocuments all = documents();
  all.report().title = "plot <7>";
  all.report().made_from = "a cloud";
  all.remark("inventory", "ground was seen in 10 % of the cells");
  all.lower(RunStatus::kPartial, "the cloud is not whole");
  all.count("trees", 41);
  all.write(folder_.path());
  const std::string page = text("report.html");
  for (const char* part : {"plot &lt;7&gt;", "a cloud", "Partial", "the cloud is not whole",
                           "ground was seen in 10 % of the cells", "<td>41</td>", kVersion})
    EXPECT_NE(page.find(part), std::string::npos) << part;
}

TEST_F(RunDocumentsTest, TheStatusIsTheWorstThatIsSaid) {
  RunDocuments all = documents();
  all.lower(RunStatus::kUntrusted, "no stem was measured");
  all.lower(RunStatus::kPartial, "the cloud is cut off");
  all.write(folder_.path());
  EXPECT_EQ(json()["status"], "untrusted");
  EXPECT_EQ(json()["reasons"], (Reasons{"no stem was measured", "the cloud is cut off"}));
  const RunOutcome outcome = all.outcome("3 trees");
  EXPECT_EQ(outcome.status, RunStatus::kUntrusted);
  EXPECT_EQ(outcome.reasons, (Reasons{"no stem was measured", "the cloud is cut off"}));
  EXPECT_EQ(outcome.summary, "3 trees");
}

TEST_F(RunDocumentsTest, WhatIsInheritedComesFirst) {
  RunDocuments all = documents();
  all.inherit({RunStatus::kPartial, {"run a: stopped"}});
  all.lower(RunStatus::kComplete, "own");
  all.inherit({RunStatus::kUntrusted, {"run b: smeared", "run a: stopped"}});
  all.write(folder_.path());
  EXPECT_EQ(json()["status"], "untrusted");
  EXPECT_EQ(json()["reasons"], (Reasons{"run b: smeared", "run a: stopped", "own"}));
}

TEST_F(RunDocumentsTest, AJudgementComesWithItsNumbers) {
  RunDocuments all = documents();
  RunEvidence evidence;
  evidence.stopped = true;
  all.judge(evidence, {});
  all.write(folder_.path());
  EXPECT_EQ(json()["status"], "partial");
  EXPECT_EQ(json()["reasons"].size(), 1U);
  EXPECT_TRUE(json()["evidence"].contains("scans_mapped"));
}

TEST_F(RunDocumentsTest, ErrorsAgainstATruthAreFiguresToo) {
  RunDocuments all = documents();
  all.compare_with_truth(std::nullopt);
  EXPECT_TRUE(all.summary().quality.empty());
  ReportTruth truth;
  truth.ape_rmse_m = 0.125;
  truth.drift_percent = 0.5;
  all.compare_with_truth(truth);
  all.write(folder_.path());
  EXPECT_EQ(json()["quality"]["ape_rmse_m"], 0.125);
  EXPECT_EQ(json()["quality"]["drift_percent"], 0.5);
  EXPECT_NE(text("report.html").find("0.125 m"), std::string::npos);
}

// The wall time in run.json is that of the whole command: the report is written before it is taken.
TEST_F(RunDocumentsTest, TheTimeOfTheReportCounts) {
  double now = 0.0;
  RunDocuments all("map", {}, times_, log_, [&] { return now += 1.0; });
  all.write(folder_.path());
  EXPECT_EQ(json()["wall_s"], 2.0);
}

TEST_F(RunDocumentsTest, NothingIsWrittenWhereThereIsNoFolder) {
  RunDocuments all = documents();
  EXPECT_THROW(all.write(folder_ / "missing"), OutputError);
  EXPECT_THROW(all.add_input(folder_ / "missing.laz"), InputError);
}

}  // namespace
}  // namespace understory
