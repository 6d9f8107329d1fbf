#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <variant>

#include "understory/output/report/report_parts.h"
#include "understory/output/report/svg_plot.h"

namespace understory {
namespace {

struct Verdict {
  const char* word;
  const char* css;
  const char* text;
};

Verdict verdict_of(RunStatus status) {
  switch (status) {
    case RunStatus::kComplete:
      return {"Complete", "good", "Everything was processed; the result can be used."};
    case RunStatus::kPartial:
      return {"Partial", "fair", "What is here can be used, but some of it is missing."};
    case RunStatus::kUntrusted:
      break;
  }
  return {"Untrusted", "bad", "Do not rely on this result without checking it."};
}

std::string adapted_table(const std::vector<ConfigAdaptation>& changes) {
  if (changes.empty()) return "";
  std::string html =
      "<h3>Settings adapted to the sensor</h3><div "
      "class=\"scroll\"><table><tr><th>key</th><th>asked "
      "for</th><th>ran</th><th>why</th></tr>";
  for (const ConfigAdaptation& change : changes) {
    std::string why = change.why;
    if (change.when_s > 0.0) why += fmt::format(" (found at {:.1f} s)", change.when_s);
    html += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
                        escape_html(change.key), escape_html(change.from), escape_html(change.to),
                        escape_html(why));
  }
  return html + "</table></div>";
}

// What a kind of warning means for the result, by the prefix of its key.
std::string consequence_of(const std::string& key) {
  constexpr std::array<std::pair<const char*, const char*>, 23> kMeanings = {
      {{"recording.damaged", "That part of the recording is missing from the map."},
       {"recording.truncated", "What was scanned later is missing from the map."},
       {"recording.unfinished", "Nothing is known to be missing."},
       {"recording.mended", "Nothing is missing."},
       {"recording.no_point_times",
        "Motion within a scan could not be taken out: stems may look thick or doubled."},
       {"recording.point_times",
        "If the times of points were understood wrongly, stems look thick."},
       {"recording.no_imu_extrinsics",
        "The IMU was not used: tilt and fast turns are less certain."},
       {"imu.silent", "In such gaps the path rests on the lidar alone; look there for bent stems."},
       {"imu.stopped", "From there on the path rests on the lidar alone; height may drift."},
       {"imu.none", "The map may be tilted as a whole; fast turns are less certain."},
       {"imu.in_g", "Nothing is wrong with the result."},
       {"imu.untrusted", "The recording was mapped without the IMU, or should have been."},
       {"imu", "Tilt and fast turns are less certain."},
       {"map.segment", "How the pieces of the map lie to each other is a guess."},
       {"points.no_return", "Nothing is wrong with the result."},
       {"time.gap_lidar", "The path over such a gap is predicted, not measured."},
       {"time", "Stamps were mended; if they were wrong by more, the map is smeared."},
       {"gnss.not_placed", "The layers are in a local frame, without a coordinate system."},
       {"gnss", "Satellite positions were not used there."},
       {"georeference", "Look at the layers over a known map before you use them."},
       {"loop", "Places seen twice may not lie exactly on each other."},
       {"match", "Positions there are less certain; see where the path is marked as weak."},
       {"recording.assumed_rate", "Times were assumed; speeds and deskewing depend on them."}}};
  for (const auto& [prefix, meaning] : kMeanings) {
    if (key.rfind(prefix, 0) == 0) return meaning;
  }
  return "";
}

// Figures at the top of the page, and below them what each means.
class Tiles {
 public:
  void add(const std::string& value, const std::string& label, const std::string& meaning) {
    tiles_ +=
        "<div class=\"tile\"><b>" + value + "</b><span>" + escape_html(label) + "</span></div>";
    meanings_ += "<dt>" + escape_html(label) + "</dt><dd>" + escape_html(meaning) + "</dd>";
  }

  [[nodiscard]] std::string html() const {
    if (tiles_.empty()) return "";
    return "<section><div class=\"tiles\">" + tiles_ +
           "</div><details class=\"meanings\"><summary>What these figures mean</summary><dl>" +
           meanings_ + "</dl></details></section>\n";
  }

 private:
  std::string tiles_;
  std::string meanings_;
};

void add_stand(Tiles& tiles, const std::vector<Tree>& all_trees, double area_m2) {
  std::vector<Tree> trees = all_trees;
  std::erase_if(trees, [](const Tree& tree) { return std::isnan(tree.dbh_m); });
  if (const std::size_t by_crown = all_trees.size() - trees.size(); by_crown > 0)
    tiles.add(count_text(by_crown), "trees found by their crowns",
              "Trees whose top stands out of the canopy, and whose stem was not seen. They have no "
              "diameter. Trees below other crowns are not counted.");
  if (!trees.empty() || all_trees.empty())
    tiles.add(count_text(trees.size()), "trees with a measured stem",
              "Trees whose stem shows its surface at several heights around 1.3 m. A tree without "
              "a visible stem is not counted here.");
  const double hectares = area_m2 / 1e4;
  double dbh = 0.0;
  double basal = 0.0;
  double volume = 0.0;
  std::size_t with_volume = 0;
  for (const Tree& tree : trees) {
    dbh += tree.dbh_m;
    if (std::isfinite(tree.stem_volume_m3)) {
      volume += tree.stem_volume_m3;
      ++with_volume;
    }
    basal += 0.25 * M_PI * tree.dbh_m * tree.dbh_m;
  }
  const auto n = static_cast<double>(trees.size());
  if (hectares > 0.0) {
    tiles.add(
        fmt::format("{:.2f} ha", hectares), "area with points (not a plot's border)",
        "Squares of 2 m that hold points. The lidar looks beyond the border of a plot, so this "
        "area is larger.");
    if (n > 0) {
      tiles.add(fmt::format("≈ {:.0f}", n / hectares), "stems per hectare seen",
                "Measured trees divided by that area. Far from the path stems are missed, so the "
                "stand has more. For a plot, count the trees of trees.csv within its border.");
    }
  }
  if (n > 0 && hectares > 0.0) {
    tiles.add(fmt::format("{:.1f} cm", 100.0 * dbh / n), "mean diameter at 1.3 m",
              "Mean of the measured diameters, 1.3 m above the ground.");
    tiles.add(fmt::format("≈ {:.1f} m²/ha", basal / hectares), "basal area",
              "Cross sections of all measured stems at 1.3 m, per hectare of that area. Too small "
              "where stems are missed.");
  }
  if (with_volume > 0 && hectares > 0.0) {
    tiles.add(fmt::format("≈ {:.0f} m³/ha", volume / hectares), "stem volume over bark",
              fmt::format("Volume of the {} stems whose height is known, from the ground to the "
                          "top, per hectare of that area. Too small where stems or heights are "
                          "missing.",
                          with_volume));
  }
}

// What stands for a hectare, and the mean diameter: of the area in which stems could be seen.
void add_figures(Tiles& tiles, const StandFigures& seen) {
  if (!(seen.seen_m2 > 0.0)) return;
  tiles.add(fmt::format("{:.2f} ha", seen.seen_m2 / 1e4), "area seen (not a plot's border)",
            "Where returns reached the ground or the stems densely enough to find stems. What lies "
            "behind stems or farther away does not count, nor do trees there. For a plot of your "
            "own give --plots.");
  const auto add = [&](const Measured& figure, int decimals, const char* label, const char* meaning,
                       double scale = 1.0) {
    if (std::isfinite(figure.value))
      tiles.add(fmt::format("{:.{}f} ± {:.{}f}", scale * figure.value, decimals, scale * figure.sd,
                            decimals),
                label, meaning);
  };
  add(seen.stems_per_ha, 0, "stems per hectare",
      "Trees in the area seen over that area. ± is one standard deviation of the errors of "
      "measurement.");
  add(seen.mean_dbh_m, 1, "mean diameter at 1.3 m, cm",
      "Mean of the diameters of these trees, 1.3 m above the ground.", 100.0);
  add(seen.basal_area_m2_per_ha, 1, "basal area, m² per hectare",
      "Cross sections of these stems at 1.3 m, per hectare of the area seen.");
  add(seen.volume_m3_per_ha, 0, "stem volume over bark, m³ per hectare",
      "Volume of these stems from the ground to the top, per hectare of the area seen.");
}

void add_run(Tiles& tiles, const ReportInput& input) {
  if (!input.scans.empty()) {
    tiles.add(fmt::format("{:.0f} m", path_length_m(input.scans)), "length of the path",
              "How far the scanner was carried. Movements of less than 10 cm are left out.");
    // By stems the scans shown are the views that were kept: a machine may stand at the end.
    const double shown_s = to_seconds(input.scans.back().stamp - input.scans.front().stamp);
    tiles.add(duration_text(std::max(shown_s, input.summary.recording_s)), "of recording",
              "Time from the first scan to the last.");
    tiles.add(count_text(input.summary.scans), "scans",
              "A scan is one look of the lidar all around, often a tenth of a second.");
  }
  const auto carrier = input.summary.quality.find("carrier_points_percent");
  if (carrier != input.summary.quality.end()) {
    tiles.add(fmt::format("{:.1f} %", std::get<double>(carrier->second)),
              "of the points are of the carrier",
              "What carries the lidar stays at one place beside it, and other scans show nothing "
              "where it was. These points are left out of the map.");
  }
  const auto scan = input.summary.stages.find("scan");
  if (scan != input.summary.stages.end()) {
    tiles.add(fmt::format("{:.0f} ms", scan->second.wall_ms.mean),
              input.sensor_period_ms > 0.0
                  ? fmt::format("per scan; a new one comes every {:.0f} ms", input.sensor_period_ms)
                  : "per scan",
              "Time of computing. Where it is shorter than the time between scans, the program can "
              "work while the scanner is carried.");
  }
  if (!input.loops.empty()) {
    const auto closed = std::count_if(input.loops.begin(), input.loops.end(),
                                      [](const ReportLoop& loop) { return loop.accepted; });
    tiles.add(std::to_string(closed), "loops closed",
              "How often a place was seen again and the path was corrected by it.");
  }
}

}  // namespace

double path_length_m(const std::vector<ReportScan>& scans) {
  constexpr float kStep = 0.1F;  // a sensor at rest jitters by millimetres ten times a second
  double length = 0.0;
  if (scans.empty()) return length;
  Eigen::Vector3f last = scans.front().position;
  for (const ReportScan& scan : scans) {
    const float step = (scan.position - last).norm();
    if (step < kStep) continue;
    length += static_cast<double>(step);
    last = scan.position;
  }
  return length;
}

std::string duration_text(double seconds) {
  if (seconds < 60.0) return fmt::format("{:.1f} s", seconds);
  const auto whole = static_cast<long>(std::lround(seconds));
  if (whole < 3600) return fmt::format("{} min {:02d} s", whole / 60, whole % 60);
  return fmt::format("{} h {:02d} min", whole / 3600, whole % 3600 / 60);
}

std::string count_text(std::uint64_t value) {
  std::string text = std::to_string(value);
  for (auto i = static_cast<int>(text.size()) - 3; i > 0; i -= 3)
    text.insert(static_cast<std::size_t>(i), ",");
  return text;
}

std::string verdict_section(const ReportInput& input) {
  const Verdict verdict = verdict_of(input.summary.status);
  std::string html = fmt::format("<section class=\"verdict {}\"><h2>{}</h2><p>{}</p>", verdict.css,
                                 verdict.word, verdict.text);
  if (!input.summary.reasons.empty()) {
    html += "<ul>";
    for (const std::string& reason : input.summary.reasons)
      html += "<li>" + escape_html(reason) + "</li>";
    html += "</ul>";
  }
  if (!input.summary.notes.empty()) {
    html += "<p>Look at these first:</p><ul class=\"notes\">";
    for (const std::string& note : input.summary.notes)
      html += "<li>" + escape_html(note) + "</li>";
    html += "</ul>";
  }
  return html + "</section>\n";
}

std::string figures_section(const ReportInput& input) {
  Tiles tiles;
  if (input.inventory != nullptr || (input.trees != nullptr && input.trees_of_cloud)) {
    const bool seen = input.stand != nullptr && input.stand->seen.trees > 0;
    const double area_m2 = input.inventory != nullptr ? input.inventory->area_m2 : input.area_m2;
    add_stand(tiles, *report_trees(input), seen ? 0.0 : area_m2);
    if (seen) add_figures(tiles, input.stand->seen);
  } else if (input.trees != nullptr) {
    tiles.add(count_text(input.trees->size()), "trees",
              "Trees whose stem was seen in many of the scans that could see it.");
  }
  if (!input.falls.empty()) {
    tiles.add(count_text(input.falls.size()), "of them felled meanwhile",
              "Trees that stood at first and were gone later.");
  }
  add_run(tiles, input);
  return tiles.html();
}

namespace {

// What the place on the globe rests on, in one item of the list. `add` takes what and meaning.
template <typename Add>
void add_place(const ReportInput& input, const Add& add) {
  const std::optional<RunPlace>& place = input.summary.place;
  if (place && place->on_globe) {
    if (!std::isfinite(place->heading_sd_deg)) return;
    constexpr double kAtM = 50.0;
    constexpr double kLeastM = 0.05;  // what the page would round to nothing
    const double off_m = kAtM * std::tan(place->heading_sd_deg * M_PI / 180.0);
    if (off_m < kLeastM) return;
    add(fmt::format("The heading of the map on the globe is known to {:.1f}° (one standard "
                    "deviation).",
                    place->heading_sd_deg),
        fmt::format("{:.0f} m from the middle of the path that is {:.1f} m on the ground.", kAtM,
                    off_m));
    return;
  }
  if (!input.summary.crs_wkt.empty() || input.north_is_up) return;
  add(input.has_fixes
          ? "The map is in a local frame, though the recording has satellite positions: see "
            "“Where it is”."
          : "The map is in a local frame: without satellite positions its heading and place on the "
            "earth are arbitrary.",
      input.remarks.empty() ? "Distances and heights within it hold." : "");
}

}  // namespace

std::string distrust_section(const ReportInput& input) {
  std::string items;
  const auto add = [&](const std::string& what, const std::string& meaning) {
    items += "<li>" + escape_html(what);
    if (!meaning.empty()) {
      const bool ended = !what.empty() && std::string(".!?").find(what.back()) != std::string::npos;
      items += (ended ? " <span class=\"so\">" : ". <span class=\"so\">") + escape_html(meaning) +
               "</span>";
    }
    items += "</li>";
  };
  for (const Log::Warning& warning : input.summary.warnings) {
    const std::string times =
        warning.count > 1 ? fmt::format(" ({} times; the first is shown)", warning.count) : "";
    add(warning.first_message + times, consequence_of(warning.key));
  }
  for (const std::string& remark : input.remarks)
    add(remark, "");
  if (!input.scans.empty() && !input.loop_closure_enabled) {
    add("Loop closure was switched off.", "Places seen twice need not lie on each other.");
  }
  if (!input.scans.empty()) add_place(input, add);
  if (items.empty()) {
    items = "<li>Nothing stood out: no warning was given during processing.</li>";
  }
  return "<section><h2>What to distrust</h2><ul class=\"warn\">" + items + "</ul></section>\n";
}

std::string made_section(const ReportInput& input) {
  const RunSummary& s = input.summary;
  std::string html = "<section><details><summary>How this was made</summary>";
  html += fmt::format(
      "<p>understory {} · <code>{}</code> · {} of computing ({} of CPU time) · peak "
      "memory {:.0f} MB</p>",
      escape_html(s.version), escape_html(s.command), duration_text(s.wall_s),
      duration_text(s.cpu_s), s.peak_memory_mb);
  if (!s.inputs.empty()) {
    html +=
        "<h3>Inputs</h3><div class=\"wide\"><table><tr><th>file</th><th "
        "class=\"n\">bytes</th><th>SHA-256</th></tr>";
    for (const InputHash& file : s.inputs) {
      html += fmt::format("<tr><td>{}</td><td class=\"n\">{}</td><td><code>{}</code></td></tr>",
                          escape_html(file.file), count_text(file.bytes), file.sha256);
    }
    html += "</table></div>";
  }
  const auto listed = [&](const char* title, const std::map<std::string, Figure>& figures) {
    if (figures.empty()) return;
    html += fmt::format("<h3>{}</h3><div class=\"wide\"><table>", title);
    for (const auto& [name, value] : figures) {
      const std::string text =
          std::visit([](const auto& v) { return fmt::format("{}", v); }, value);
      html += "<tr><td>" + escape_html(name) + "</td><td>" + escape_html(text) + "</td></tr>";
    }
    html += "</table></div>";
  };
  listed("Counts", s.counts);
  listed("Quality figures", s.quality);
  html += adapted_table(s.config.adapted);
  const std::string& ran =
      s.config.effective_yaml.empty() ? s.config.asked_yaml : s.config.effective_yaml;
  html += "<h3>Configuration that ran</h3><pre>" + escape_html(ran) + "</pre>";
  return html + "</details></section>\n";
}

}  // namespace understory
