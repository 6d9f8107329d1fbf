#pragma once

#include <filesystem>

#include "understory/pipeline/correction/correction_config.h"
#include "understory/pipeline/correction/correction_run.h"
#include "understory/pipeline/georeferencing/map_placing.h"
#include "understory/pipeline/mapping/map_maker.h"
#include "understory/pipeline/run_folder/run_documents.h"
#include "understory/util/log.h"
#include "understory/util/progress.h"
#include "understory/util/timing.h"

namespace understory {

// Where a map of stems is written, with its times, log and progress.
struct StemMapPlace {
  std::filesystem::path run_folder;  // as the user named it
  std::filesystem::path results;     // where its files are written
  StageTimes& times;                 // of the run so far; further stages are added
  Log& log;
  const ProgressSink& progress;
  GeoreferenceConfig georeference;  // how its layers lie on the globe
};

// Map, trees and files of positioned stems: of `understory correct`, and of `understory map` by the
// sparse front end. Stages "loops", "self_correction", "tree_map", "writing", "gnss_fit".
class StemMapMaker : public MapMaker {
 public:
  // `documents`: what is known of the reading.
  StemMapMaker(CorrectionInput input, RunDocuments documents, const CorrectionConfig& config,
               const StemMapPlace& place);

  // Loops, and the correction of the map by itself; not where positioning was stopped.
  void close_loops() override;
  void finish_map() override;
  void list_trees() override;
  // odometry.tum, trajectory.tum, steps.csv, loops.csv, corrections.csv, trees.csv, trees.gpkg,
  // felled.csv, gnss.csv, map.qgs, run.json, report.html.
  [[nodiscard]] RunOutcome write() override;

 private:
  // By the recording's own fixes, which do not change the path; gnss.csv.
  [[nodiscard]] PlacedMap place_on_globe(const Trajectory& trajectory);

  CorrectionRun run_;
  RunDocuments documents_;
  CorrectionConfig config_;
  StemMapPlace place_;
};

}  // namespace understory
