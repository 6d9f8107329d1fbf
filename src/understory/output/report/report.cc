#include "understory/output/report/report.h"

#include "understory/output/report/report_parts.h"
#include "understory/output/report/svg_plot.h"
#include "understory/util/files/atomic_file.h"

namespace understory {

std::string report_html(const ReportInput& input, const std::vector<std::string>& files) {
  std::string html =
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">"
      "<title>" +
      escape_html(input.title) + " – Understory report</title>\n<style>" + report_style() +
      "</style></head><body><main>\n";
  html += "<header><h1>" + escape_html(input.title) + "</h1><p class=\"sub\">" +
          escape_html(input.made_from) + "</p></header>\n";
  // What matters first: may I use it, what is it, where, what not to trust, the trees, the files.
  // How it was computed comes last, for those who check it.
  html += verdict_section(input);
  html += figures_section(input);
  html += map_section(input);
  html += place_section(input, files);
  html += distrust_section(input);
  html += plots_section(input);
  html += stand_section(input);
  html += deformation_section(input);
  html += files_section(input, files);
  html += truth_section(input);
  html += loops_section(input);
  html += correction_section(input);
  html += matching_section(input);
  html += imu_section(input);
  html += time_section(input);
  html += made_section(input);
  return html + "</main><script>\n\"use strict\";\n" + report_script() +
         "</script></body></html>\n";
}

void write_report(const std::filesystem::path& path, const ReportInput& input) {
  std::vector<std::string> files = {"run.json", path.filename().string()};
  std::error_code ignored;  // a folder that cannot be listed: writing says why
  for (const auto& entry : std::filesystem::directory_iterator(path.parent_path(), ignored))
    files.push_back(entry.path().filename().string());
  AtomicFile file(path);
  file.write(report_html(input, files));
  file.commit();
}

}  // namespace understory
