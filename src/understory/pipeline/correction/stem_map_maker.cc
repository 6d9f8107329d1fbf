#include "understory/pipeline/correction/stem_map_maker.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "understory/forest/stems/beam_footprint.h"
#include "understory/forest/trees/tree_doubt.h"
#include "understory/output/layers/layer_files.h"
#include "understory/output/run_tables.h"
#include "understory/pipeline/correction/correction_report.h"
#include "understory/pipeline/correction/correction_summary.h"
#include "understory/pipeline/correction/correction_tables.h"
#include "understory/util/error.h"

namespace understory {
namespace {

// By how much wide beams make a stem look too thick, metres.
double excess_of(const MappedStem& stem, const BeamConfig& beams) {
  return 2.0 * excess_width_m(footprint_at(beams, stem.dbh_range_m), 0.5 * stem.dbh_m);
}

std::vector<Tree> trees_of(const std::vector<MappedStem>& stems, const BeamConfig& beams) {
  std::vector<Tree> trees;
  for (const MappedStem& stem : stems) {
    Tree tree;
    tree.id = static_cast<int>(trees.size()) + 1;
    tree.x = stem.point_in_world.x();
    tree.y = stem.point_in_world.y();
    tree.z = stem.point_in_world.z();
    tree.dbh_m = stem.dbh_m;
    tree.dbh_sd_m = dbh_sd_m(stem, excess_of(stem, beams));
    tree.lean_deg = std::acos(std::clamp(stem.axis_in_world.z(), -1.0, 1.0)) * 180.0 / M_PI;
    tree.observations = stem.sights;
    tree.x_sd_m = std::sqrt(stem.variance_m2.x() / stem.sights);
    tree.y_sd_m = std::sqrt(stem.variance_m2.y() / stem.sights);
    tree.quality = quality_of(tree, Tree::kUnknown);
    trees.push_back(tree);
  }
  return trees;
}

}  // namespace

StemMapMaker::StemMapMaker(CorrectionInput input, RunDocuments documents,
                           const CorrectionConfig& config, const StemMapPlace& place)
    : run_{std::move(input), {}, {}, {}, {}, {}},
      documents_(std::move(documents)),
      config_(config),
      place_(place) {
  UNDERSTORY_CHECK(run_.steps.size() == run_.views.size());
  documents_.summary().lidar_model = run_.lidar_model;
}

void StemMapMaker::close_loops() {
  if (run_.stopped) {
    for (const SparseStep& step : run_.steps)
      run_.correction.world_from_body.push_back(step.world_from_body);
    return;
  }
  place_.progress({"correction", 0.0, 0.0, "", ""});
  run_.correction =
      correct_stems(run_.views, run_.steps, config_.stems, place_.times, place_.progress);
}

void StemMapMaker::finish_map() {
  const ScopedTimer timer(place_.times, "tree_map");
  const std::vector<char>& use = run_.correction.self.use;  // P0 (33)
  for (std::size_t i = 0; i < run_.views.size(); ++i) {
    if (!use.empty() && use[i] == 0) continue;
    run_.seen.push_back(run_.views[i]);
    run_.seen_from.push_back(run_.correction.world_from_body[i]);
  }
  run_.stems = build_stem_map(run_.seen, run_.seen_from, config_.tree_list);
}

void StemMapMaker::list_trees() {
  run_.trees = trees_of(run_.stems, usual_beams(run_.lidar_model));
}

PlacedMap StemMapMaker::place_on_globe(const Trajectory& trajectory) {
  const ScopedTimer timer(place_.times, "gnss_fit");
  PlacedMap map = place_map({place_.results, trajectory, run_.fixes, run_.antenna_in_body,
                             run_.second_antenna_in_body, LevelledBy::kStems},
                            place_.georeference, place_.log);
  documents_.summary().quality.merge(map.figures);
  documents_.report().fixes = std::move(map.fixes);
  documents_.report().has_fixes = !run_.fixes.empty();
  return map;
}

RunOutcome StemMapMaker::write() {
  const std::filesystem::path& folder = place_.results;
  Trajectory trajectory;
  std::vector<HeadCut> cuts;
  {
    const ScopedTimer timer(place_.times, "writing");
    trajectory = write_correction_tables(folder, run_);
    cuts = place_cuts(run_.head_cuts, trajectory, place_.log);
  }
  summarise_correction(config_, run_, documents_);
  documents_.judge_path();
  std::vector<TreeFall> falls =
      write_felled_trees(folder, {run_.seen, run_.seen_from, run_.stems, run_.trees}, cuts,
                         config_.harvester, documents_.summary(), place_.log);
  {
    const ScopedTimer timer(place_.times, "writing");
    write_trees_csv(folder / "trees.csv", run_.trees);
  }
  const PlacedMap map = place_on_globe(trajectory);
  write_tree_layers(folder, run_.trees, trajectory, map.frames.layers);
  write_layer_project(folder, documents_.report().title, trajectory, map.frames.layers);
  report_correction(config_.stems, run_, trajectory, documents_);
  documents_.place(map.place, map.frames);
  documents_.report().falls = std::move(falls);
  documents_.write(folder);
  return documents_.outcome(
      fmt::format("{} views over {:.0f} m, {} trees, in {:.1f} s; see {}", run_.views.size(),
                  length_through(run_.correction.world_from_body), run_.stems.size(),
                  documents_.summary().wall_s, (place_.run_folder / "report.html").string()));
}

}  // namespace understory
