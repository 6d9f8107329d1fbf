#pragma once

#include <string>
#include <vector>

#include "understory/forest/inventory.h"
#include "understory/output/run_summary.h"

namespace understory {

// What a list of trees leaves in doubt, in words for someone still in the forest: doubtful
// diameters and missing heights. Places from where to look again. Where coverage is thin, and
// whether the cloud is blurred. They do not lower the verdict. Empty where nothing is in doubt.
struct StandNotes {
  std::string blur;
  std::string doubts;
  std::string look_again;
  std::string thin;
};
[[nodiscard]] StandNotes notes_on(const InventoryResult& inventory);

// Fills in the notes of a run, its counts diameters_doubtful, heights_missing, trees_by_crown,
// look_again_places and look_again_trees, and the figures thin_coverage_share and range_noise_m.
void note_doubts(const InventoryResult& inventory, RunSummary& summary);

// The lines of the notes for the terminal, each with its end: a blurred cloud, doubts, and where
// to look again.
[[nodiscard]] std::string terminal_notes(const InventoryResult& inventory);

}  // namespace understory
