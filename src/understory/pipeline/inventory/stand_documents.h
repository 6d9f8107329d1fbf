#pragma once

#include <string>

#include "understory/pipeline/inventory/stand_plots.h"
#include "understory/pipeline/run_folder/run_documents.h"

namespace understory {

// Fills in the figures of a stand under "quality" of run.json, its plots under "counts", and the
// section of the report. It also adds the remarks on the stand. `stand` must live until the
// documents are written. The status becomes partial where plots have no figures.
void describe_stand(const StandResult& stand, RunDocuments& documents);

// "; 64 of them on 0.070 ha seen, 914 +- 12 stems/ha, ..."; empty where nothing is known.
[[nodiscard]] std::string stand_in_words(const StandTable& stand);

}  // namespace understory
