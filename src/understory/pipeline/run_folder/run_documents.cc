#include "understory/pipeline/run_folder/run_documents.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "understory/util/version.h"

namespace understory {
namespace {

std::function<double()> seconds_from_now() {
  using Clock = std::chrono::steady_clock;
  return [start = Clock::now()] {
    return std::chrono::duration<double>(Clock::now() - start).count();
  };
}

// The frame of each file of the folder that has one. Views, graphs and figures have none.
std::map<std::string, std::string> frames_of(const std::filesystem::path& folder,
                                             const RunPlace& place, WorldFrame world) {
  const std::string layers = place.on_globe ? place.coordinate_system : "world";
  std::map<std::string, std::string> frames;
  for (const std::string& name : world_files()) {
    if (std::filesystem::exists(folder / name)) frames[name] = frame_name(world);
  }
  for (const char* name : {"map.laz", "map.copc.laz", "dtm.tif", "dsm.tif", "chm.tif",
                           "obstacles.laz", "free_height.tif", "trees.gpkg", "map.qgs"}) {
    if (std::filesystem::exists(folder / name)) frames[name] = layers;
  }
  // Latitude, longitude and height on WGS 84, whether or not the layers are on the globe.
  if (std::filesystem::exists(folder / "global.csv.gz")) frames["global.csv.gz"] = "EPSG:4979";
  return frames;
}

}  // namespace

RunDocuments::RunDocuments(const std::string& command, ConfigRecord config, const StageTimes& times,
                           const Log& log, std::function<double()> elapsed_s)
    : times_(times), log_(log), elapsed_s_(elapsed_s ? std::move(elapsed_s) : seconds_from_now()) {
  summary().command = command;
  summary().version = kVersion;
  summary().config = std::move(config);
}

void RunDocuments::add_input(const std::filesystem::path& file, const ProgressSink& progress) {
  summary().inputs.push_back(hash_input(file, progress));
}

void RunDocuments::add_inputs(const std::vector<InputHash>& files) {
  summary().inputs.insert(summary().inputs.end(), files.begin(), files.end());
}

void RunDocuments::count(const std::string& name, std::uint64_t value) {
  summary().counts[name] = static_cast<std::int64_t>(value);
}

void RunDocuments::remark(const std::string& key, const std::string& message) {
  remarks_.push_back({key, message, 1});
}

void RunDocuments::tell_world_in(WorldFrame frame) {
  world_frame_ = frame;
  report_.world_frame = frame;
}

void RunDocuments::compare_with_truth(const std::optional<ReportTruth>& truth) {
  report_.truth = truth;
  if (!truth) return;
  summary().quality["ape_rmse_m"] = truth->ape_rmse_m;
  summary().quality["drift_percent"] = truth->drift_percent;
}

void RunDocuments::place(RunPlace place, const ResultFrames& frames) {
  summary().crs_wkt = frames.layers.wkt();
  report_.north_is_up = place.on_globe;
  report_.drawing = frames.drawing().is_world() ? nullptr : &frames.drawing();
  summary().place = std::move(place);
}

void RunDocuments::lower(RunStatus status, const std::string& reason) {
  own_.status = std::max(own_.status, status);
  own_.reasons.push_back(reason);
}

void RunDocuments::judge(const RunEvidence& evidence, const JudgementConfig& config) {
  const RunJudgement judgement = judge_run(evidence, config);
  own_.status = std::max(own_.status, judgement.status);
  own_.reasons.insert(own_.reasons.end(), judgement.reasons.begin(), judgement.reasons.end());
  summary().evidence = figures_of(evidence);
}

void RunDocuments::judge_path() {
  if (summary().poses != 1) return;
  lower(
      RunStatus::kPartial,
      "the path is a single pose: nothing was matched, and nothing shows whether the map is right");
}

void RunDocuments::inherit(const InheritedTrust& trust) {
  inherited_.push_back(trust);
}

void RunDocuments::take_status() {
  summary().status = own_.status;
  summary().reasons = own_.reasons;
  for (const InheritedTrust& trust : inherited_)
    understory::inherit(trust, summary().status, summary().reasons);
}

void RunDocuments::write(const std::filesystem::path& results) {
  RunSummary& all = summary();
  take_status();
  all.warnings = log_.warnings();
  all.warnings.insert(all.warnings.end(), remarks_.begin(), remarks_.end());
  all.stages = summarise(times_);
  all.wall_s = elapsed_s_();
  all.cpu_s = process_cpu_seconds();
  all.peak_memory_mb = peak_memory_mb();
  const bool ned = world_frame_ == WorldFrame::kNed;
  if (ned) turn_to_ned(results);
  if (ned || all.place)
    all.frames = frames_of(results, all.place.value_or(RunPlace()), world_frame_);
  write_report(results / "report.html", report_);
  all.wall_s = elapsed_s_();  // all of it, the report too
  write_run_json(results / "run.json", all);
}

RunOutcome RunDocuments::outcome(std::string text) const {
  return {summary().status, summary().reasons, std::move(text)};
}

}  // namespace understory
