#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "understory/georeference/satellites/gnss_fit.h"
#include "understory/output/run_summary.h"
#include "understory/output/run_tables.h"
#include "understory/sensor/gnss_fix.h"
#include "understory/util/log.h"

namespace understory {

// The fixes of a file: an NMEA log, an RTKLIB .pos file, a table, or any recording. A table has
// timestamp, latitude_deg and longitude_deg, as gnss.csv of a run or of a folder of clouds. Those
// without a position are left out. Throws InputError where there are none.
[[nodiscard]] std::vector<GnssFix> read_fixes(const std::string& file, Log& log);

// The fixes that a method places a run by: those of --gnss, else of a run that is being mapped,
// else of the run's gnss.csv. `file` names them in messages. Throws InputError where there are
// none.
struct NamedFixes {
  std::string file;
  std::vector<GnssFix> fixes;
};
[[nodiscard]] NamedFixes fixes_of_run(const std::string& gnss, const std::filesystem::path& folder,
                                      const std::vector<GnssFix>& in_memory, Log& log);

// For gnss.csv, positions in the frame east, north, up. `unused`: why a fix was not used.
[[nodiscard]] std::vector<GnssRow> rows_of(const std::vector<FittedFix>& fixes,
                                           const std::string& unused);
// For run.json: gnss_fit_rms_m and the like; empty if there was no fit.
[[nodiscard]] std::map<std::string, Figure> figures_of(const GnssFit& fit);

}  // namespace understory
