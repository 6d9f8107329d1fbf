#include <fmt/format.h>

#include <algorithm>

#include "understory/output/report_parts.h"
#include "understory/output/svg_plot.h"

namespace understory {

std::string correction_section(const ReportInput& input) {
  if (!input.correction) return "";
  const ReportCorrection& correction = *input.correction;
  std::string html = "<section><h2>How the map corrected itself</h2>";
  html += fmt::format(
      "<p>{} pairs of views were matched again, {} of them are in the map ({:.1f} % of the views): "
      "{}. A map is sharp if all sights of a tree fall on one place; nothing from outside is used "
      "for that.</p>",
      correction.tried.size() + correction.kept.size(), correction.kept.size(),
      100.0 * static_cast<double>(correction.kept.size()) /
          static_cast<double>(std::max<std::size_t>(1, input.scans.size())),
      escape_html(correction.ended));
  html +=
      "<div class=\"wide\"><table><thead><tr><th></th><th class=\"n\">before</th><th "
      "class=\"n\">after</th></tr>"
      "</thead><tbody>";
  for (const ReportCorrection::Figure& figure : correction.figures) {
    html += fmt::format(
        "<tr><td>{}</td><td class=\"n\">{:.{}f}</td><td class=\"n\">{:.{}f}</td>"
        "</tr>",
        escape_html(figure.name), figure.before, figure.digits, figure.after, figure.digits);
  }
  html += "</tbody></table></div>";
  html += correction_figures(correction);
  if (correction.pairs.empty() && correction.kept.empty() && correction.tried.empty())
    return html + "</section>\n";
  Plot plot;
  plot.x_label = "later view";
  plot.y_label = "earlier view";
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
