#include "understory/output/report.h"

#include "understory/output/report_parts.h"
#include "understory/output/svg_plot.h"
#include "understory/util/files/atomic_file.h"

namespace understory {

std::string report_html(const ReportInput& input) {
  std::string html =
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">"
      "<title>" +
      escape_html(input.title) + " – Understory report</title>\n<style>" + report_style() +
      "</style></head><body><main>\n";
  html += "<header><h1>" + escape_html(input.title) + "</h1><p class=\"sub\">" +
          escape_html(input.made_from) + "</p></header>\n";
  // What matters first: may I use it, what is it, where, what not to trust; then the evidence.
  html += verdict_section(input);
  html += figures_section(input);
  html += map_section(input);
  html += distrust_section(input);
  html += stand_section(input);
  html += matching_section(input);
  html += loops_section(input);
  html += correction_section(input);
  html += truth_section(input);
  html += time_section(input);
  html += made_section(input);
  return html + "</main><script>" + report_script() + "</script></body></html>\n";
}

void write_report(const std::filesystem::path& path, const ReportInput& input) {
  AtomicFile file(path);
  file.write(report_html(input));
  file.commit();
}

}  // namespace understory
