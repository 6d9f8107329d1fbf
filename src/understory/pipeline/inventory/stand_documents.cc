#include "understory/pipeline/inventory/stand_documents.h"

#include <fmt/format.h>

#include <cmath>

namespace understory {
namespace {

// Square metres, those of a circle of 5.6 m radius, which is the smallest usual sample plot
// [chosen].
constexpr double kFewestSquareMetres = 100.0;

}  // namespace

void describe_stand(const StandResult& stand, RunDocuments& documents) {
  const StandFigures& seen = stand.table.seen;
  auto& quality = documents.summary().quality;
  quality["seen_area_m2"] = seen.seen_m2;
  const auto put = [&](const std::string& name, const std::string& sd_name,
                       const Measured& figure) {
    if (!std::isfinite(figure.value)) return;
    quality[name] = figure.value;
    quality[sd_name] = figure.sd;
  };
  put("stems_per_ha", "stems_per_ha_sd", seen.stems_per_ha);
  put("basal_area_m2_per_ha", "basal_area_sd_m2_per_ha", seen.basal_area_m2_per_ha);
  put("mean_dbh_m", "mean_dbh_sd_m", seen.mean_dbh_m);
  put("weighted_dbh_m", "weighted_dbh_sd_m", seen.weighted_dbh_m);
  put("weighted_height_m", "weighted_height_sd_m", seen.weighted_height_m);
  put("dominant_height_m", "dominant_height_sd_m", seen.dominant_height_m);
  put("volume_m3_per_ha", "volume_sd_m3_per_ha", seen.volume_m3_per_ha);
  put("national_volume_m3_per_ha", "national_volume_sd_m3_per_ha", seen.national_m3_per_ha);
  documents.count("trees_in_seen_area", seen.trees);
  documents.count("heights_filled_in", seen.heights_filled_in);
  documents.count("volumes_filled_in", seen.volumes_filled_in);
  documents.count("heights_lower_bounds", seen.heights_lower_bounds);
  if (seen.heights_lower_bounds > 0)
    documents.remark(
        "plots",
        fmt::format("Heights and volumes of the stand are lower bounds. The tops of {} of {} trees "
                    "were not seen, and too few others were for a height curve.",
                    seen.heights_lower_bounds, seen.trees));
  if (seen.seen_m2 > 0.0 && seen.seen_m2 < kFewestSquareMetres)
    documents.remark("plots", fmt::format("Only {:.0f} m2 of ground were seen. Figures per hectare "
                                          "say little of a stand from so small an area.",
                                          seen.seen_m2));
  documents.count("plots", stand.table.plots.size());
  for (const std::string& remark : stand.remarks)
    documents.remark("plots", remark);
  if (!stand.complaint.empty()) documents.lower(RunStatus::kPartial, stand.complaint);
  documents.report().stand = &stand.table;
}

std::string stand_in_words(const StandTable& stand) {
  const StandFigures& seen = stand.seen;
  if (!(seen.seen_m2 > 0.0)) return "";
  const bool small = seen.seen_m2 < kFewestSquareMetres;
  std::string text = fmt::format("; {} of them on {} seen", seen.trees,
                                 small ? fmt::format("{:.0f} m2", seen.seen_m2)
                                       : fmt::format("{:.3f} ha", seen.seen_m2 / 1e4));
  if (std::isfinite(seen.stems_per_ha.value))
    text +=
        fmt::format(", {:.0f} +- {:.0f} stems/ha", seen.stems_per_ha.value, seen.stems_per_ha.sd);
  if (std::isfinite(seen.basal_area_m2_per_ha.value))
    text += fmt::format(", {:.1f} +- {:.1f} m2/ha", seen.basal_area_m2_per_ha.value,
                        seen.basal_area_m2_per_ha.sd);
  return text;
}

}  // namespace understory
