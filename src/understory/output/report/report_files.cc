#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "understory/output/report/report_parts.h"
#include "understory/output/report/svg_plot.h"

namespace understory {
namespace {

struct ResultFile {
  const char* name;
  const char* content;
  const char* opened_with;
};

// In the order in which a user wants them; docs/reference/outputs.md has their columns.
constexpr std::array<ResultFile, 32> kResultFiles = {
    {{"trees.csv", "one row a tree: place, diameter, height", "a spreadsheet, QGIS"},
     {"stem_curves.csv", "diameters along each stem", "a spreadsheet"},
     {"dead_wood.csv", "stumps and lying stems", "a spreadsheet"},
     {"plots.csv", "figures of the stand and of its plots", "a spreadsheet"},
     {"plot_classes.csv", "stems of each class of diameters", "a spreadsheet"},
     {"map.qgs", "all layers of this folder on one map", "QGIS: double-click"},
     {"trees.gpkg", "the same trees as points on a map, places to walk to, and the path of a run",
      "QGIS: drag the file into the window"},
     {"felled.csv", "trees that were felled meanwhile", "a spreadsheet"},
     {"map.laz", "all points; ground and vegetation have classes of their own",
      "CloudCompare, QGIS"},
     {"map.copc.laz", "the same points in an octree: shown at once", "QGIS: drag it in"},
     {"dtm.tif", "height of the ground", "QGIS"},
     {"chm.tif", "height of the canopy above the ground", "QGIS"},
     {"dsm.tif", "height of the surface, treetops included", "QGIS"},
     {"obstacles.laz", "points that stand in the way along the path", "CloudCompare, QGIS"},
     {"free_height.tif", "free height above the ground along the path", "QGIS"},
     {"trajectory.tum", "the path of the scanner: time, place, attitude", "a text editor, evo"},
     {"trajectory_imu.tum", "the path predicted at each sample of the IMU", "a text editor, evo"},
     {"trajectory_partial.tum", "poses from parts of scans, sooner than the path",
      "a text editor, evo"},
     {"gnss.csv", "the fixes of the GNSS receiver", "a spreadsheet"},
     {"global.csv.gz", "place on the globe at each scan, while the run went on",
      "a spreadsheet, QGIS"},
     {"run.json", "verdict, settings and all figures of this page", "a text editor"},
     {"keyframes.tum", "poses of the keyframes, for checking", "a text editor, evo"},
     {"states.csv.gz", "velocity and uncertainty of each scan, for checking", "a spreadsheet"},
     {"graph.g2o", "the graph of poses, for checking", "g2o_viewer"},
     {"stems.csv.gz", "the stems of each view", "understory correct"},
     {"odometry.tum", "the path before it was corrected, for checking", "a text editor, evo"},
     {"steps.csv", "how each view was matched, for checking", "a spreadsheet"},
     {"loops.csv", "places seen again, for checking", "a spreadsheet"},
     {"corrections.csv", "views that were matched again, for checking", "a spreadsheet"},
     {"cuts.csv", "cuts of the harvester's head", "a spreadsheet"},
     {"deformation.csv", "by how much one map was bent onto the other", "a spreadsheet"},
     {"report.html", "this page", "a browser"}}};

// What of a run that was moved lies in its own folder alone.
std::string left_behind(const std::vector<std::string>& names) {
  if (names.empty()) return "";
  std::string list;
  for (const std::string& name : names)
    list += (list.empty() ? "<code>" : ", <code>") + escape_html(name) + "</code>";
  return "<p>Only the folder of the run that was moved holds " + list + ".</p>";
}

}  // namespace

std::string files_section(const ReportInput& input, const std::vector<std::string>& files) {
  std::string rows;
  for (const ResultFile& file : kResultFiles) {
    if (std::find(files.begin(), files.end(), file.name) == files.end()) continue;
    rows += fmt::format("<tr><td><code>{}</code></td><td>{}</td><td>{}</td></tr>", file.name,
                        escape_html(file.content), escape_html(file.opened_with));
  }
  if (rows.empty()) return "";
  return "<section><h2>The files of this folder</h2><p>They lie beside this page.</p><div "
         "class=\"wide\"><table class=\"files\"><thead><tr><th>file</th><th>what it "
         "holds</th><th>open it "
         "with</th></tr></thead><tbody>" +
         rows + "</tbody></table></div>" + left_behind(input.not_moved) + "</section>\n";
}

}  // namespace understory
