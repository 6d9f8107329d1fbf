// What the sparse front end makes of a recording that was read.
#include <fmt/format.h>

#include <utility>

#include "understory/output/run_tables.h"
#include "understory/pipeline/correction/stem_map_maker.h"
#include "understory/pipeline/inventory/lidar_view.h"
#include "understory/pipeline/judgement/input_remarks.h"
#include "understory/pipeline/mapping/map_documents.h"
#include "understory/pipeline/mapping/sparse/sparse_evidence.h"
#include "understory/pipeline/mapping/sparse/sparse_front_end.h"
#include "understory/pipeline/run_folder/run_truth.h"
#include "understory/sensor/second_antenna_place.h"

namespace understory {
namespace {

// Writes stems.csv.gz, and leaves in the views what a reader of that file gets: `understory
// correct` makes the same of it.
void write_stems(const std::filesystem::path& file, std::vector<StemView>& views) {
  StemsWriter writer(file);
  for (StemView& view : views) {
    for (Stem& stem : view.stems)
      stem = writer.add(view.frame, view.stamp, stem);
    view.stems.shrink_to_fit();
  }
  writer.commit();
}

// What run.json and the report say of the reading.
RunDocuments documents_of(const SparseFrontEnd& front_end, const ReadRecording& recording,
                          const StageTimes& times) {
  RunDocuments documents = map_documents(recording, times);
  const std::string& head_log = front_end.config().correction.harvester.head_log;
  if (!head_log.empty()) documents.add_input(head_log);
  documents.count("views", front_end.views().size());
  documents.count("scans_positioned", front_end.positioned());
  tell_imu_clock(front_end.clock_check(), recording.log, documents.summary());
  documents.report().made_from =
      fmt::format("{}, {} scans, stems of {} views", recording.source.format(),
                  front_end.path().size(), front_end.views().size());
  return documents;
}

// Milliseconds of work on the scan of each view; 0 where unknown.
std::vector<float> scan_times_ms(const SparseFrontEnd& front_end) {
  std::vector<float> times_ms(front_end.views().size(), 0.0F);
  const auto samples = front_end.times().samples("scan");
  // A stage that ran very often keeps a part of its samples: then they belong to no view.
  if (samples.size() != front_end.path().size()) return times_ms;
  for (std::size_t i = 0; i < times_ms.size(); ++i)
    times_ms[i] = samples[static_cast<std::size_t>(front_end.views()[i].frame)].wall_ms;
  return times_ms;
}

CorrectionInput correction_input(SparseFrontEnd& front_end, const ReadRecording& recording) {
  const Recording& source = recording.source;
  CorrectionInput input;
  gather_sparse(front_end, recording.facts, source, recording.log, input.evidence);
  input.scan_ms = scan_times_ms(front_end);
  input.truth = write_truth(recording.request.run_folder, source);
  if (const auto& antenna = source.rig().body_from_gnss)
    input.antenna_in_body = antenna->translation();
  input.second_antenna_in_body = second_antenna_of(source.rig());
  input.lidar_model = single_lidar_model(source.rig());
  input.head_cuts = read_head_log(front_end.config().correction.harvester.head_log);
  front_end.hand_over(input.views, input.steps, input.path, input.fixes);
  write_stems(recording.results / "stems.csv.gz", input.views);
  return input;
}

}  // namespace

std::string SparseFrontEnd::why_no_map(const Recording& source) const {
  if (counted_.scans > 0)
    return fmt::format(
        "no stems in any of its {} scans. Expected upright stems in scans with ring numbers, by a "
        "lidar with its rings level within 25 degrees (also upside down)",
        counted_.scans);
  std::string topics;
  for (const TopicReport& topic : source.topics())
    topics += (topics.empty() ? "; it holds " : ", ") + topic.name + " (" + topic.type + ")";
  return "no lidar scan could be read from it" + topics;
}

std::unique_ptr<MapMaker> SparseFrontEnd::map_maker(const ReadRecording& recording) {
  remark_on_lever_arms(recording.source.rig(), recording.request.recording, recording.log);
  recall();
  RunDocuments documents = documents_of(*this, recording, times_);
  CorrectionInput input = correction_input(*this, recording);
  const StemMapPlace place{recording.request.run_folder, recording.results,   times_, recording.log,
                           recording.progress,           config_.georeference};
  return std::make_unique<StemMapMaker>(std::move(input), std::move(documents), config_.correction,
                                        place);
}

}  // namespace understory
