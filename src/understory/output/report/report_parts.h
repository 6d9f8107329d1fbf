#pragma once

#include <string>
#include <vector>

#include "understory/output/report/map_view.h"
#include "understory/output/report/report.h"

namespace understory {

// The sections of the report, as HTML; empty where there is nothing to show.
[[nodiscard]] std::string report_style();
[[nodiscard]] std::string report_script();
[[nodiscard]] std::string verdict_section(const ReportInput& input);
[[nodiscard]] std::string figures_section(const ReportInput& input);
[[nodiscard]] std::string map_section(const ReportInput& input);
// Parts of the map: where coverage is thin, and where to stand to see doubtful stems again.
[[nodiscard]] std::string thin_svg(const InventoryResult& inventory, const MapView& view);
[[nodiscard]] std::string look_svg(const InventoryResult& inventory, const MapView& view);
// Below it, the places in words; empty where there are none.
[[nodiscard]] std::string look_list(const InventoryResult& inventory, const MapView& view);
// Stumps and lying stems: on the map, and in words and a table. Empty where there are none.
[[nodiscard]] std::string dead_wood_svg(const InventoryResult& inventory, const MapView& view);
[[nodiscard]] std::string dead_wood_part(const InventoryResult& inventory, WorldFrame world_frame);
// Where the run lies on the globe, how that was found and how sure it is; `files`: names.
[[nodiscard]] std::string place_section(const ReportInput& input,
                                        const std::vector<std::string>& files);
[[nodiscard]] std::string distrust_section(const ReportInput& input);
[[nodiscard]] std::string stand_section(const ReportInput& input);
// The sheets of single trees, to look through: a part of the stand's section.
[[nodiscard]] std::string sheets_part(const InventoryResult& inventory);
// The figures of the stand and of its sample plots.
[[nodiscard]] std::string plots_section(const ReportInput& input);
// What lies beside the report and how to open it, and what of a run was not moved; `files`: names.
[[nodiscard]] std::string files_section(const ReportInput& input,
                                        const std::vector<std::string>& files);
[[nodiscard]] std::string matching_section(const ReportInput& input);
[[nodiscard]] std::string loops_section(const ReportInput& input);
[[nodiscard]] std::string correction_section(const ReportInput& input);
// Its figures: pairs of views, sights before and after, trees over the distance from the way.
[[nodiscard]] std::string correction_figures(const ReportCorrection& correction);
// Arrows from one map of trees to the other.
[[nodiscard]] std::string deformation_section(const ReportInput& input);
[[nodiscard]] std::string truth_section(const ReportInput& input);
// Place and clock of the IMU, where they were refined.
[[nodiscard]] std::string imu_section(const ReportInput& input);
[[nodiscard]] std::string time_section(const ReportInput& input);
[[nodiscard]] std::string made_section(const ReportInput& input);

// Length of the path over the scans, without the jitter of a sensor at rest, metres.
[[nodiscard]] double path_length_m(const std::vector<ReportScan>& scans);
// "1 h 05 min", "4 min 12 s", "8.3 s".
[[nodiscard]] std::string duration_text(double seconds);
// 12,345
[[nodiscard]] std::string count_text(std::uint64_t value);

}  // namespace understory
