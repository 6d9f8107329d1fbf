#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "understory/evaluation/world_frame.h"
#include "understory/output/report/report.h"
#include "understory/output/run_summary.h"
#include "understory/pipeline/georeferencing/run_place.h"
#include "understory/pipeline/judgement/inherited_trust.h"
#include "understory/pipeline/judgement/run_evidence.h"
#include "understory/pipeline/judgement/run_judgement.h"
#include "understory/pipeline/run_folder/run_outcome.h"
#include "understory/util/log.h"
#include "understory/util/progress.h"
#include "understory/util/timing.h"

namespace understory {

// run.json and report.html of a command at work. Every command that writes a folder of results has
// one. It fills in what all commands have in common: command, version, configuration, inputs,
// status and reasons, and warnings. Stages, wall time, CPU time, memory and the frame of the report
// are among it, too. The command adds what is its own to `summary` and `report`. Not thread-safe.
class RunDocuments {
 public:
  // The wall time counts from here, or is what `elapsed_s` says: that of a resumed run has earlier
  // parts. `times` and `log` must outlive this.
  RunDocuments(const std::string& command, ConfigRecord config, const StageTimes& times,
               const Log& log, std::function<double()> elapsed_s = {});

  // The command's own part of run.json: scans, poses, recording_s, counts, quality, coordinate
  // system. `write` replaces what this class fills in.
  [[nodiscard]] RunSummary& summary() { return report_.summary; }
  [[nodiscard]] const RunSummary& summary() const { return report_.summary; }
  // The command's own part of the report: title, made_from, sections. What it points to must live
  // until `write`.
  [[nodiscard]] ReportInput& report() { return report_; }

  // A file that the result was computed from. Polls `progress`. Throws InputError.
  void add_input(const std::filesystem::path& file, const ProgressSink& progress = {});
  void add_inputs(const std::vector<InputHash>& files);
  // A number of things under "counts".
  void count(const std::string& name, std::uint64_t value);
  // Adds what a user has to know of the result and no part of the program has warned of before. It
  // stands under "warnings", beside those of the log, and in the report.
  void remark(const std::string& key, const std::string& message);
  // The same of what a run has warned of that this command goes on from.
  void remark(const Log::Warning& warning) { remarks_.push_back(warning); }
  // Where the run lies on the globe, and the frame that its map is drawn in. `frames` must live
  // until `write`.
  void place(RunPlace place, const ResultFrames& frames);
  // The axes that `write` turns the files of `world_files` to, and the lists of the report. Until
  // then all of them are written east, north, up.
  void tell_world_in(WorldFrame frame);
  // Errors against a known truth, if there is one: in the report and under "quality".
  void compare_with_truth(const std::optional<ReportTruth>& truth);

  // The status is the worst that is said of the result.
  void lower(RunStatus status, const std::string& reason);
  // Status and reasons by these numbers, which come under "evidence".
  void judge(const RunEvidence& evidence, const JudgementConfig& config);
  // Partial where the path is one pose, by `summary().poses`: then nothing was matched.
  void judge_path();
  // What a run has said that this command goes on from. Its reasons come before the command's own,
  // and those of a run that is named later before those of a run that is named earlier.
  void inherit(const InheritedTrust& trust);

  // Writes report.html and then run.json to the folder, once, when all else is written. Before, it
  // turns the files with world coordinates, where another frame than east, north, up is wanted.
  // Throws OutputError.
  void write(const std::filesystem::path& results);
  // After `write`: status, reasons, and a few lines for the terminal.
  [[nodiscard]] RunOutcome outcome(std::string text) const;

 private:
  void take_status();

  WorldFrame world_frame_ = WorldFrame::kEnu;
  ReportInput report_;
  RunJudgement own_;
  std::vector<InheritedTrust> inherited_;
  std::vector<Log::Warning> remarks_;
  const StageTimes& times_;
  const Log& log_;
  std::function<double()> elapsed_s_;
};

}  // namespace understory
