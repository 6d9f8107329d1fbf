#include "understory/pipeline/georeferencing/gnss_fixes.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "understory/pipeline/source.h"
#include "understory/recording/captures/nmea.h"
#include "understory/recording/captures/rtklib.h"
#include "understory/sensor/fix_position.h"
#include "understory/util/error.h"
#include "understory/util/files/csv.h"
#include "understory/util/files/text_file.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

// The first byte that is no white space of a plain file; 0 if there is none.
char first_letter(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  char letter = 0;
  stream >> letter;
  check_readable(stream, file, "at its beginning");
  return stream ? letter : '\0';
}

std::vector<GnssFix> read_nmea(const std::string& file, Log& log) {
  std::ifstream ahead(file, std::ios::binary);
  std::ifstream stream(file, std::ios::binary);
  NmeaLogReader reader(stream, file, first_nmea_day(ahead, file), log);
  std::vector<GnssFix> fixes;
  while (auto fix = reader.next())
    fixes.push_back(*fix);
  return fixes;
}

std::vector<GnssFix> read_table(const std::string& file) {
  CsvReader table(file, {"timestamp", "latitude_deg", "longitude_deg"});
  std::vector<GnssFix> fixes;
  while (table.next()) {
    GnssFix fix;
    fix.stamp = from_seconds(table.finite("timestamp"));
    fix.latitude_deg = table.number("latitude_deg");
    fix.longitude_deg = table.number("longitude_deg");
    fix.height_m = table.number("height_m");
    fix.hdop = table.number("hdop");
    fix.vdop = table.number("vdop");
    fix.heading_deg = table.number("heading_deg");
    fix.heading_sd_deg = table.number("heading_sd_deg");
    const double c[] = {table.number("c00"), table.number("c01"), table.number("c02"),
                        table.number("c11"), table.number("c12"), table.number("c22")};
    fix.covariance << c[0], c[1], c[2], c[1], c[3], c[4], c[2], c[4], c[5];
    // The table of a folder of clouds tells standard deviations instead.
    const Eigen::Vector3d sd(table.number("sd_east_m"), table.number("sd_north_m"),
                             table.number("sd_up_m"));
    if (std::isnan(c[0]) && sd.allFinite()) fix.covariance = sd.cwiseAbs2().asDiagonal();
    fixes.push_back(fix);
  }
  return fixes;
}

std::vector<GnssFix> read_recording(const std::string& name, Log& log) {
  const auto recording = open_source(name, {}, log);
  std::vector<GnssFix> fixes;
  while (const auto event = recording->next()) {
    if (const auto* fix = std::get_if<GnssFix>(&*event)) fixes.push_back(*fix);
  }
  return fixes;
}

}  // namespace

std::vector<GnssFix> read_fixes(const std::string& file, Log& log) {
  const bool plain = fs::is_regular_file(file);
  if (!plain && !is_simulation(file) && !fs::exists(file))
    throw InputError(file, "", "expected GNSS fixes: no such file");
  std::vector<GnssFix> fixes;
  const std::string name = fs::path(file).filename().string();
  if (plain && first_letter(file) == '$') {
    fixes = read_nmea(file, log);
  } else if (plain && is_rtklib_solution(file)) {
    fixes = read_rtklib_solution(file, log);
  } else if (plain && (name.ends_with(".csv") || name.ends_with(".csv.gz"))) {
    fixes = read_table(file);
  } else {
    fixes = read_recording(file, log);
  }
  std::erase_if(fixes, [](const GnssFix& fix) { return !is_on_globe(fix); });
  if (fixes.empty()) throw InputError(file, "", "expected GNSS fixes with a position: none there");
  return fixes;
}

NamedFixes fixes_of_run(const std::string& gnss, const fs::path& folder,
                        const std::vector<GnssFix>& in_memory, Log& log) {
  if (!gnss.empty()) return {gnss, read_fixes(gnss, log)};
  const fs::path file = folder / "gnss.csv";
  if (!in_memory.empty()) return {file.string(), in_memory};
  if (!fs::exists(file))
    throw InputError(folder.string(), "",
                     "expected gnss.csv in the run, or --gnss with a recording, an NMEA log, an "
                     "RTKLIB .pos file or a table of fixes");
  return {file.string(), read_fixes(file.string(), log)};
}

std::vector<GnssRow> rows_of(const std::vector<FittedFix>& fixes, const std::string& unused) {
  std::vector<GnssRow> rows;
  for (const FittedFix& fitted : fixes) {
    GnssRow row;
    row.fix = fitted.fix;
    row.position_in_world = fitted.position_in_enu;
    row.residual = fitted.residual;
    row.used = fitted.used;
    if (!row.used) row.reason = unused;
    rows.push_back(row);
  }
  return rows;
}

std::map<std::string, Figure> figures_of(const GnssFit& fit) {
  if (!fit.path.found) return {};
  std::map<std::string, Figure> figures{
      {"gnss_fit_rms_m", fit.path.symmetric_rms_m},
      {"gnss_fit_turned_rms_m", fit.path.turned_rms_m},
      {"gnss_fixes_rms_m", fit.path.fixes_rms_m},
      {"gnss_fixes_mean_m", fit.path.fixes_mean_m},
      {"gnss_fixes_median_m", fit.path.fixes_median_m},
      {"gnss_path_rms_m", fit.path.path_rms_m},
      {"gnss_path_mean_m", fit.path.path_mean_m},
      {"gnss_fixes_used_share",
       static_cast<double>(std::count(fit.path.fix_used.begin(), fit.path.fix_used.end(), 1)) /
           static_cast<double>(fit.path.fix_used.size())},
      {"gnss_heading_sd_deg", fit.path.heading_sd_deg},
      {"gnss_yaw_deg", yaw_of(fit.enu_from_world) * 180.0 / M_PI}};
  if (fit.fixes_in_time > 0) {
    figures["gnss_along_rms_m"] = fit.along_rms_m;
    figures["gnss_across_rms_m"] = fit.across_rms_m;
  }
  return figures;
}

}  // namespace understory
