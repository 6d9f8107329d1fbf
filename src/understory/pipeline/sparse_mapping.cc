#include "understory/pipeline/sparse_mapping.h"

#include <fmt/format.h>

#include <deque>
#include <memory>
#include <system_error>

#include "understory/output/run_tables.h"
#include "understory/pipeline/realtime_player.h"
#include "understory/pipeline/run_folder.h"
#include "understory/pipeline/source.h"
#include "understory/util/error.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

// The scans of a recording in order of time, one after another through the front end.
class SparseRun {
 public:
  SparseRun(const SparseMappingRequest& request, Log& log)
      : request_(request),
        log_(log),
        orderer_(request.config.time_repair, log),
        source_(open_source(request.recording, request.open, log)),
        pacer_(request.config.pace, request.config.front_end, &log),
        stems_(request.run_folder / "stems.csv.gz") {
    if (!request.realtime) return;
    auto player = std::make_unique<RealtimePlayer>(
        std::move(source_), static_cast<std::size_t>(request.config.realtime_queue_scans));
    player_ = player.get();
    source_ = std::move(player);
  }

  // True if it was stopped.
  bool run(const ProgressSink& progress, const StopRequested& stop_requested) {
    bool stopped = false;
    bool ended = false;
    while (!ended && !(stopped = stop_requested && stop_requested())) {
      std::optional<Event> event = source_->next();
      ended = !event;
      if (event) {
        orderer_.push(std::move(*event));
      } else {
        orderer_.finish();
      }
      while (auto ready = orderer_.pop()) {
        if (const auto* scan = std::get_if<ScanPtr>(&*ready)) take(*scan, progress);
        if (const auto* fix = std::get_if<GnssFix>(&*ready)) fixes_.push_back(*fix);
        if (const auto* sample = std::get_if<ImuSample>(&*ready)) take(*sample);
      }
    }
    record(pacer_.finish(source_->rig()));
    if (kept() > 0) stems_.commit();
    if (player_ != nullptr) {
      player_->stop();
      warn_of_dropped();
    }
    return stopped;
  }

  [[nodiscard]] std::size_t count() const { return path_.size(); }
  [[nodiscard]] std::size_t kept() const { return steps_.size(); }
  // What the correction needs to know of the recording; lives as long as this.
  [[nodiscard]] SparseScans scans(bool stopped) {
    SparseScans scans;
    scans.recording = request_.recording;
    scans.source = player_ != nullptr ? &player_->played() : source_.get();
    scans.path = std::move(path_);
    scans.steps = std::move(steps_);
    scans.times = &times_;
    scans.positioned = positioned_;
    scans.stopped = stopped;
    scans.fixes = std::move(fixes_);
    if (player_ != nullptr)
      scans.realtime = {player_->dropped_scans(), distribution_of(std::move(latencies_ms_))};
    return scans;
  }

 private:
  void take(const ScanPtr& scan, const ProgressSink& progress) {
    const ScopedTimer timer(times_, "scan");
    ++taken_;
    waiting_ends_.push_back(scan->end());
    record(pacer_.add(scan, source_->rig()));
    if (!progress) return;
    const double share = source_->progress();
    const auto done = static_cast<double>(taken_);
    progress({"stems", done, share > 0.0 ? done / share : 0.0, "scans",
              fmt::format("{} stems", last_stems_)});
  }

  // The recording has said so where it does not know the IMU's place.
  void take(const ImuSample& sample) {
    if (source_->rig().body_from_imu) pacer_.add(sample);
  }

  void warn_of_dropped() {
    const std::uint64_t dropped = player_->dropped_scans();
    if (dropped == 0) return;
    log_.warn("realtime.dropped",
              fmt::format("{} of {} scans were dropped, because the machine could not keep up",
                          dropped, dropped + taken_));
  }

  void record(const std::vector<StemScan>& results) {
    for (const StemScan& result : results) {
      if (player_ != nullptr) latencies_ms_.push_back(player_->latency_ms(waiting_ends_.front()));
      waiting_ends_.pop_front();
      path_.push_back({result.view.stamp, result.step.world_from_body});
      if (!result.positioned) continue;
      ++positioned_;
      last_stems_ = result.view.stems.size();
      if (!result.keep) continue;
      for (const Stem& stem : result.view.stems)
        stems_.add(result.view.frame, result.view.stamp, stem);
      steps_.push_back(result.step);
    }
  }

  const SparseMappingRequest& request_;
  Log& log_;
  EventOrderer orderer_;
  std::unique_ptr<Recording> source_;
  StemPacer pacer_;
  StemsWriter stems_;
  std::vector<StampedPose> path_;  // of every scan
  std::size_t taken_ = 0;          // scans, of which the last may still wait
  std::size_t positioned_ = 0;
  std::size_t last_stems_ = 0;
  std::vector<GnssFix> fixes_;
  RealtimePlayer* player_ = nullptr;  // source_, if it is one
  std::deque<TimeNs> waiting_ends_;   // of scans that have no pose yet
  std::vector<double> latencies_ms_;
  StageTimes times_;
  std::vector<SparseStep> steps_;  // of the views that were kept
};

}  // namespace

CorrectionOutcome run_sparse_mapping(const SparseMappingRequest& request, Log& log,
                                     const ProgressSink& progress,
                                     const StopRequested& stop_requested) {
  if (!request.overwrite) refuse_unfinished_run(request.run_folder);
  std::error_code error;
  fs::create_directories(request.run_folder, error);
  if (error) throw OutputError(request.run_folder.string(), "cannot be made: " + error.message());
  SparseRun run(request, log);
  const bool stopped = run.run(progress, stop_requested);
  if (run.kept() == 0) {
    throw InputError(request.recording, "",
                     fmt::format("no stems in any of its {} scans: expected upright stems in scans "
                                 "with ring numbers",
                                 run.count()));
  }
  const SparseScans scans = run.scans(stopped);
  CorrectionRequest correction;
  correction.stems = request.run_folder / "stems.csv.gz";
  correction.run_folder = request.run_folder;
  correction.overwrite = true;
  correction.config = request.config.correction;
  correction.config_yaml = request.config_yaml;
  correction.scans = &scans;
  // What was seen until the user stopped it is still corrected.
  return run_correction(correction, log, progress, stopped ? StopRequested() : stop_requested);
}

}  // namespace understory
