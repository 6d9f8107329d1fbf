#include "understory/pipeline/georeferencing/carried_stand.h"

#include <cmath>
#include <cstdint>

#include "understory/pipeline/run_folder/run_json.h"
#include "understory/util/files/csv.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

// A figure of a stand: its names in run.json and in plots.csv.
struct FigureName {
  const char* name;
  const char* sd_name;
  Measured StandFigures::*figure;
};
constexpr FigureName kFigures[] = {
    {"stems_per_ha", "stems_per_ha_sd", &StandFigures::stems_per_ha},
    {"basal_area_m2_per_ha", "basal_area_sd_m2_per_ha", &StandFigures::basal_area_m2_per_ha},
    {"mean_dbh_m", "mean_dbh_sd_m", &StandFigures::mean_dbh_m},
    {"weighted_dbh_m", "weighted_dbh_sd_m", &StandFigures::weighted_dbh_m},
    {"weighted_height_m", "weighted_height_sd_m", &StandFigures::weighted_height_m},
    {"dominant_height_m", "dominant_height_sd_m", &StandFigures::dominant_height_m},
    {"volume_m3_per_ha", "volume_sd_m3_per_ha", &StandFigures::volume_m3_per_ha},
    {"national_volume_m3_per_ha", "national_volume_sd_m3_per_ha",
     &StandFigures::national_m3_per_ha}};

constexpr const char* kCounts[] = {"trees_in_seen_area",
                                   "heights_filled_in",
                                   "volumes_filled_in",
                                   "heights_lower_bounds",
                                   "plots",
                                   "trees_by_crown",
                                   "heights_missing",
                                   "diameters_doubtful",
                                   "look_again_places",
                                   "look_again_trees",
                                   "stumps",
                                   "logs"};
constexpr const char* kOtherQuality[] = {"area_m2", "seen_area_m2", "thin_coverage_share",
                                         "range_noise_m", "logs_volume_m3"};

std::size_t count_of(const RunJson& json, const std::string& name) {
  const double value = json.find_number("/counts/" + name);
  return value > 0.0 ? static_cast<std::size_t>(value) : 0;
}

StandFigures figures_of(const RunJson& json) {
  StandFigures figures;
  figures.area_m2 = figures.seen_m2 = json.find_number("/quality/seen_area_m2");
  figures.seen_share = 1.0;
  figures.trees = count_of(json, "trees_in_seen_area");
  figures.heights_filled_in = count_of(json, "heights_filled_in");
  figures.volumes_filled_in = count_of(json, "volumes_filled_in");
  figures.heights_lower_bounds = count_of(json, "heights_lower_bounds");
  for (const FigureName& one : kFigures)
    figures.*one.figure = {json.find_number(std::string("/quality/") + one.name),
                           json.find_number(std::string("/quality/") + one.sd_name)};
  return figures;
}

// The rows of plots.csv, but that of all that was seen.
std::vector<StandPlot> plots_of(const fs::path& file) {
  std::vector<StandPlot> plots;
  if (!fs::exists(file)) return plots;
  CsvReader table(file, {"plot", "kind"});
  while (table.next()) {
    if (table.text("kind") == "seen") continue;
    StandPlot plot;
    plot.shape.id = table.text("plot");
    plot.figures.area_m2 = table.number("area_m2");
    plot.figures.seen_m2 = table.number("seen_m2");
    plot.figures.seen_share = table.number("seen_share");
    const double trees = table.number("trees");
    plot.figures.trees = trees > 0.0 ? static_cast<std::size_t>(trees) : 0;
    for (const FigureName& one : kFigures)
      plot.figures.*one.figure = {table.number(one.name), table.number(one.sd_name)};
    plots.push_back(std::move(plot));
  }
  return plots;
}

// Where the places to walk to are shown: the page of the result does not have their numbers.
std::string moved_note(const std::string& note) {
  const std::string of_page = "See the numbers on the map of report.html, and layer";
  const std::size_t at = note.find(of_page);
  return at == std::string::npos
             ? note
             : note.substr(0, at) + "See layer" + note.substr(at + of_page.size());
}

// Whether a warning is of the place on the globe, which is found anew.
bool is_of_place(const std::string& key) {
  return key.starts_with("gnss") || key.starts_with("georeference");
}

std::vector<Log::Warning> warnings_of(const RunJson& json) {
  std::vector<Log::Warning> warnings;
  for (std::size_t i = 0; json.has("/warnings/" + std::to_string(i)); ++i) {
    const std::string place = "/warnings/" + std::to_string(i);
    Log::Warning warning{json.find_text(place + "/key"), json.find_text(place + "/message"), 1};
    const double count = json.find_number(place + "/count");
    if (count > 1.0) warning.count = static_cast<std::size_t>(count);
    if (!warning.first_message.empty() && !is_of_place(warning.key)) warnings.push_back(warning);
  }
  return warnings;
}

void read_settings(const RunJson& json, StandTableConfig& config) {
  for (const char* place : {"/effective_config/stand/", "/effective_config/inventory/stand/"}) {
    const double min_dbh_m = json.find_number(std::string(place) + "min_dbh_m");
    if (min_dbh_m > 0.0) config.min_dbh_m = min_dbh_m;
  }
}

}  // namespace

CarriedStand read_carried_stand(const fs::path& run) {
  const RunJson json(run);
  CarriedStand stand;
  const auto keep = [&](const std::string& name) {
    const double value = json.find_number("/quality/" + name);
    if (std::isfinite(value)) stand.quality[name] = value;
  };
  for (const char* name : kOtherQuality)
    keep(name);
  for (const FigureName& one : kFigures) {
    keep(one.name);
    keep(one.sd_name);
  }
  for (const char* name : kCounts)
    if (std::isfinite(json.find_number(std::string("/counts/") + name)))
      stand.counts[name] = static_cast<std::int64_t>(count_of(json, name));
  const double area_m2 = json.find_number("/quality/area_m2");
  if (std::isfinite(area_m2)) stand.area_m2 = area_m2;
  for (const std::string& note : json.find_texts("/notes"))
    stand.notes.push_back(moved_note(note));
  stand.warnings = warnings_of(json);
  if (!(json.find_number("/quality/seen_area_m2") > 0.0)) return stand;
  stand.table.emplace();
  stand.table->seen = figures_of(json);
  stand.table->plots = plots_of(run / "plots.csv");
  read_settings(json, stand.table->config);
  return stand;
}

}  // namespace understory
