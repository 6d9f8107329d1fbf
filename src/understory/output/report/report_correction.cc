#include <fmt/format.h>

#include <algorithm>

#include "understory/output/report/report_parts.h"
#include "understory/output/report/svg_plot.h"
#include "understory/util/fixed_text.h"

namespace understory {

std::string correction_section(const ReportInput& input) {
  if (!input.correction) return "";
  const ReportCorrection& correction = *input.correction;
  const std::size_t matched = correction.tried.size() + correction.kept.size();
  std::string html = "<section><h2>How the map corrected itself</h2>";
  html += fmt::format(
      "<p>A view is the stems of one scan, and a sight is one stem of a view. A map is sharp where "
      "all sights of a tree lie on one place. To make it sharper, the program matched {} {} of "
      "views "
      "again, of which {} {} in the map ({:.1f} % of the views). It ended there: {}.</p>",
      matched, matched == 1 ? "pair" : "pairs", correction.kept.size(),
      correction.kept.size() == 1 ? "is" : "are",
      100.0 * static_cast<double>(correction.kept.size()) /
          static_cast<double>(std::max<std::size_t>(1, input.scans.size())),
      escape_html(correction.ended));
  html +=
      "<div class=\"wide\"><table><thead><tr><th></th><th class=\"n\">before</th><th "
      "class=\"n\">after</th></tr>"
      "</thead><tbody>";
  for (const ReportCorrection::Figure& figure : correction.figures) {
    html += fmt::format("<tr><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td></tr>",
                        escape_html(figure.name), fixed_text(figure.before, figure.digits),
                        fixed_text(figure.after, figure.digits));
  }
  html += "</tbody></table></div>";
  html += correction_figures(correction);
  if (correction.pairs.empty() && correction.kept.empty() && correction.tried.empty())
    return html + "</section>\n";
  Plot plot;
  plot.x_label = "number of the later view";
  plot.y_label = "number of the earlier view";
  plot.height = 420;
  plot.width = 1100;
  const auto dots = [&](const char* name, const char* colour, ReportCorrection::Pairs pairs) {
    std::sort(pairs.begin(), pairs.end());
    if (!pairs.empty()) plot.series.push_back({name, colour, std::move(pairs), true});
  };
  ReportCorrection::Pairs promising;
  for (const ReportPair& pair : correction.pairs) {
    if (pair.acceptable) promising.emplace_back(pair.later, pair.earlier);
  }
  dots("promising, of those drawn for the report", "var(--rule)", promising);
  dots("tried", "var(--bad)", correction.tried);
  dots("in the map", "var(--line)", correction.kept);
  return html + "<h3>Which views were matched again</h3>" + svg_plot(plot) + "</section>\n";
}

}  // namespace understory
