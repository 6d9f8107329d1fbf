// What the sparse front end makes of a recording that was read.
#include <fmt/format.h>

#include <utility>

#include "understory/output/run_tables.h"
#include "understory/pipeline/correction/correction.h"
#include "understory/pipeline/judgement/input_remarks.h"
#include "understory/pipeline/judgement/run_judgement.h"
#include "understory/pipeline/mapping/sparse_front_end.h"

namespace understory {
namespace {

void write_stems(const std::filesystem::path& file, const std::vector<StemView>& views) {
  StemsWriter writer(file);
  for (const StemView& view : views) {
    for (const Stem& stem : view.stems)
      writer.add(view.frame, view.stamp, stem);
  }
  writer.commit();
}

// What the correction needs to know of the recording.
SparseScans scans_of(SparseFrontEnd& front_end, const ReadRecording& recording) {
  const RunFacts& facts = recording.facts;
  SparseScans scans;
  scans.recording = recording.request.recording;
  scans.source = &recording.source;
  scans.path = std::move(front_end.path());
  scans.steps = std::move(front_end.steps());
  scans.times = &front_end.times();
  scans.positioned = front_end.positioned();
  scans.wall_s = facts.elapsed_s();
  scans.stopped = facts.stopped;
  scans.time_repair = facts.time_repair;
  scans.last_scan_end = front_end.last_scan_end();
  scans.repeated = front_end.repeated();
  scans.imu_hearing = front_end.imu_hearing();
  scans.imu_trust = front_end.imu_trust();
  scans.imu_wanted = front_end.config().front_end.imu.use;
  scans.unreadable = facts.unreadable;
  const std::string& refused = front_end.imu_refused();
  scans.imu_distrust = refused.empty() ? scans.imu_trust.reason : imu_refusal(refused);
  scans.fixes = std::move(front_end.fixes());
  if (facts.realtime) scans.realtime = {facts.dropped_scans, distribution_of(facts.latencies_ms)};
  return scans;
}

class SparseMap : public MapMaker {
 public:
  SparseMap(SparseFrontEnd& front_end, const ReadRecording& recording)
      : front_end_(front_end), recording_(recording) {}

  void close_loops() override {}
  RunOutcome write(const std::filesystem::path& results) override {
    CorrectionRequest correction;
    correction.stems = results / "stems.csv.gz";
    write_stems(correction.stems, front_end_.views());
    const SparseScans scans = scans_of(front_end_, recording_);
    correction.run_folder = recording_.request.run_folder;
    correction.results = results;
    correction.config = front_end_.config().correction;
    correction.config_yaml = recording_.request.config_yaml;
    correction.config_origins = recording_.request.config_origins;
    correction.effective_yaml = recording_.request.effective_yaml;
    correction.adapted = recording_.request.adapted;
    correction.scans = &scans;
    // What was seen until the user stopped it is still corrected.
    return run_correction(correction, recording_.log, recording_.progress, {});
  }

 private:
  SparseFrontEnd& front_end_;
  ReadRecording recording_;
};

}  // namespace

std::string SparseFrontEnd::why_no_map(const Recording& source) const {
  if (!path_.empty())
    return fmt::format(
        "no stems in any of its {} scans: expected upright stems in scans with ring numbers",
        path_.size());
  std::string topics;
  for (const TopicReport& topic : source.topics())
    topics += (topics.empty() ? "; it holds " : ", ") + topic.name + " (" + topic.type + ")";
  return "no lidar scan could be read from it" + topics;
}

std::unique_ptr<MapMaker> SparseFrontEnd::map_maker(const ReadRecording& recording) {
  remark_on_lever_arms(recording.source.rig(), recording.request.recording, recording.log);
  return std::make_unique<SparseMap>(*this, recording);
}

}  // namespace understory
