// What the dense front end makes of a recording that was read.
#include <fmt/format.h>

#include "understory/pipeline/judgement/input_remarks.h"
#include "understory/pipeline/mapping/dense_front_end.h"
#include "understory/pipeline/run_folder/run_writer.h"

namespace understory {
namespace {

class DenseMap : public MapMaker {
 public:
  DenseMap(DenseFrontEnd& front_end, const ReadRecording& recording)
      : front_end_(front_end), recording_(recording) {}

  void close_loops() override { front_end_.map().finish(); }
  void finish_map() override {}
  void list_trees() override {}
  RunOutcome write() override { return write_run(recording_, front_end_); }

 private:
  DenseFrontEnd& front_end_;
  ReadRecording recording_;
};

}  // namespace

std::string DenseFrontEnd::why_no_map(const Recording& source) const {
  std::string topics;
  std::uint64_t empty = 0;
  for (const TopicReport& topic : source.topics()) {
    topics += (topics.empty() ? "" : ", ") + topic.name + " (" + topic.type + ")";
    empty += topic.empty_points;
  }
  if (counts_.scans > 0) {
    return fmt::format(
        "none of its {} scans has points to map: {} points are not a number or at zero range, the "
        "others too near, too far or on the machine",
        counts_.scans, empty);
  }
  return "no lidar scan could be read from it" +
         (topics.empty() ? std::string() : "; it holds " + topics);
}

std::unique_ptr<MapMaker> DenseFrontEnd::map_maker(const ReadRecording& recording) {
  if (traits_.scan_points == 0) {
    log_.warn("lidar.unknown",
              recording.request.recording +
                  ": its first messages hold no scan that tells what lidar this is: nothing was "
                  "adapted to it");
  }
  if (!recording.facts.stopped) {
    remark_on_input(*this, recording.source, recording.facts.time_repair,
                    recording.request.recording, log_);
  }
  return std::make_unique<DenseMap>(*this, recording);
}

}  // namespace understory
