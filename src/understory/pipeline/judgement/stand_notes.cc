#include "understory/pipeline/judgement/stand_notes.h"

#include <fmt/format.h>

#include <cstdint>

#include "understory/forest/stems/blurred_stems.h"
#include "understory/forest/trees/tree_doubt.h"
#include "understory/pipeline/pipeline_constants.h"

namespace understory {
namespace {

using namespace pipeline_constants::stand_notes;

std::size_t trees_at(const std::vector<LookAgain>& places) {
  std::size_t trees = 0;
  for (const LookAgain& place : places)
    trees += place.trees.size();
  return trees;
}

std::string doubts_text(const StandDoubts& doubts) {
  std::string text;
  if (doubts.weak_diameters > 0)
    text = fmt::format("{} of {} diameters are doubtful (standard deviation over 30 %)",
                       doubts.weak_diameters, doubts.diameters);
  const auto add = [&](std::size_t count, const char* what) {
    if (count > 0)
      text +=
          fmt::format("{}{} of {} trees {}", text.empty() ? "" : "; ", count, doubts.trees, what);
  };
  add(doubts.without_height, "have no height");
  add(doubts.by_crown, "were found by their crowns alone");
  return text;
}

}  // namespace

namespace {

void note_dead_wood(const std::vector<DeadWood>& pieces, RunSummary& summary) {
  std::int64_t stumps = 0;
  std::int64_t logs = 0;
  double volume_m3 = 0.0;
  for (const DeadWood& piece : pieces) {
    const bool log = piece.kind == DeadWoodKind::kLog;
    ++(log ? logs : stumps);
    if (log) volume_m3 += piece.volume_m3();
  }
  summary.counts["stumps"] = stumps;
  summary.counts["logs"] = logs;
  summary.quality["logs_volume_m3"] = volume_m3;
}

}  // namespace

StandNotes notes_on(const InventoryResult& inventory) {
  StandNotes notes;
  const StandDoubts doubts = doubts_of(inventory.trees);
  notes.doubts = doubts_text(doubts);
  if (inventory.blur_m > 0.0) notes.blur = blur_note(inventory.blur_m, inventory.range_noise_m);
  if (const std::vector<LookAgain>& places = inventory.look_again; !places.empty())
    notes.look_again = fmt::format(
        "walk here: {} {} would show {} of the {} doubtful stems from an unseen side, or from "
        "near. See the numbers on the map of report.html, and layer look_again of trees.gpkg",
        places.size(), places.size() == 1 ? "place" : "places", trees_at(places),
        doubts.weak_diameters);
  if (inventory.thin.share > kThinShare)
    notes.thin = fmt::format(
        "coverage is thin on {:.0f} % of the area with points: fewer than 5 per square metre near "
        "the ground, so stems may be missing there",
        100.0 * inventory.thin.share);
  return notes;
}

void note_doubts(const InventoryResult& inventory, RunSummary& summary) {
  const StandNotes notes = notes_on(inventory);
  for (const std::string& note : {notes.blur, notes.doubts, notes.look_again, notes.thin})
    if (!note.empty()) summary.notes.push_back(note);
  const StandDoubts doubts = doubts_of(inventory.trees);
  const auto count = [&](const char* name, std::size_t value) {
    summary.counts[name] = static_cast<std::int64_t>(value);
  };
  count("diameters_doubtful", doubts.weak_diameters);
  count("heights_missing", doubts.without_height);
  count("trees_by_crown", doubts.by_crown);
  count("look_again_places", inventory.look_again.size());
  count("look_again_trees", trees_at(inventory.look_again));
  if (inventory.dead_wood) note_dead_wood(*inventory.dead_wood, summary);
  summary.quality["thin_coverage_share"] = inventory.thin.share;
  summary.quality["range_noise_m"] = inventory.range_noise_m;
}

std::string terminal_notes(const InventoryResult& inventory) {
  const StandNotes notes = notes_on(inventory);
  std::string text;
  for (const std::string& note : {notes.blur, notes.doubts, notes.look_again})
    if (!note.empty()) text += note + "\n";
  return text;
}

}  // namespace understory
