#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "understory/cli/command.h"
#include "understory/output/clouds/las_writer.h"
#include "understory/recording/bags/mcap_writer.h"
#include "understory/simulation/sensors/field_log.h"
#include "understory/simulation/simulator.h"
#include "understory/simulation/truth.h"
#include "understory/util/error.h"
#include "understory/util/files/output_guard.h"
#include "understory/util/files/staged_output.h"

namespace understory {
namespace {

struct SimulateOptions {
  std::string site;
  std::string output;
  std::vector<std::string> settings;
  std::string seed;
  std::string duration_s;
  bool list = false;
  bool keys = false;
  bool overwrite = false;
};

int list_sites() {
  for (const ShippedSite& site : shipped_sites())
    std::printf("%-12s %s\n", site.name.c_str(), site.summary.c_str());
  return kExitDone;
}

int print_keys(const SimulateOptions& options) {
  SiteConfig site = options.site.empty() ? SiteConfig() : load_site(options.site, options.settings);
  ConfigTable table;
  describe(table, site);
  std::fputs(table.to_yaml(true).c_str(), stdout);
  return kExitDone;
}

std::filesystem::path beside(std::filesystem::path output, const std::string& ending) {
  return output.replace_extension(ending);
}

// The files of one recording. They appear together.
class Outputs {
 public:
  Outputs(const SimulateOptions& options, bool capture)
      : place_(place_of_file(options.output, options.overwrite)),
        truth_(beside(place_, ".truth"), options.overwrite ? StagedFolder::NameTest(is_truth_file)
                                                           : StagedFolder::NameTest()) {
    files_.push_back(std::make_unique<StagedFile>(place_, options.overwrite));
    if (!capture) return;
    for (const char* ending : {".nmea", ".extrinsics.yaml"})
      files_.push_back(std::make_unique<StagedFile>(beside(place_, ending), options.overwrite));
  }

  // Of the recording itself; what lies beside it is named after it.
  [[nodiscard]] std::string part() const { return files_.front()->part().string(); }
  [[nodiscard]] std::string truth_part() const { return truth_.part().string(); }
  [[nodiscard]] bool replaces() const { return truth_.replaces() || files_.front()->replaces(); }
  void commit() {
    truth_.commit();
    for (const auto& file : files_)
      file->commit();
  }

 private:
  std::filesystem::path place_;
  StagedFolder truth_;
  std::vector<std::unique_ptr<StagedFile>> files_;
};

void write_event(const Event& event, const Simulator& /*simulator*/, FieldLogWriter& writer) {
  writer.write(event);
}

// Where the second antenna gives positions, they are recorded and not the headings by them.
void write_event(const Event& event, const Simulator& simulator, McapWriter& writer) {
  const auto* scan = std::get_if<ScanPtr>(&event);
  if (scan != nullptr && simulator.is_of_second_lidar())
    return writer.write_second_scan(**scan, event_time(event));
  const auto* fix = std::get_if<GnssFix>(&event);
  if (fix == nullptr || !simulator.second_fix()) return writer.write(event);
  GnssFix bare = *fix;
  bare.heading_deg = bare.heading_sd_deg = std::numeric_limits<double>::quiet_NaN();
  writer.write(bare);
  writer.write_second_position(*simulator.second_fix(), bare.stamp);
}

// Writes all events to a recording of either kind; false if it was stopped.
template <typename Writer>
bool write_events(Simulator& simulator, Writer& writer, CommandContext& context) {
  const double duration = simulator.duration_s();
  constexpr std::size_t kEventsATime = 1000;  // of a recording without scans
  std::size_t scans = 0;
  std::size_t others = 0;
  bool stopped = false;
  while (std::optional<Event> event = simulator.next()) {
    write_event(*event, simulator, writer);
    const bool scan = std::holds_alternative<ScanPtr>(*event);
    if (!scan && (simulator.site().scans || ++others % kEventsATime != 0)) continue;
    if (scan) ++scans;
    context.progress({"simulating", simulator.progress() * duration, duration, "s of recording",
                      std::to_string(scans) + " scans"});
    stopped = context.stop_requested();
    if (stopped) break;
  }
  writer.finish();
  return !stopped;
}

// The ASPRS class of what gave an echo: 2 ground, 3 low plants, 5 trees, 6 things that are no
// trees; 1 for what has none of these.
std::uint8_t class_of(Surface surface) {
  switch (surface) {
    case Surface::kGround:
      return 2;
    case Surface::kPlant:
    case Surface::kDeadWood:
      return 3;
    case Surface::kStem:
    case Surface::kFoliage:
      return 5;
    case Surface::kBuilding:
    case Surface::kObject:
      return 6;
    default:
      return 1;
  }
}

// points.laz of the truth, filled while the simulator is read.
std::unique_ptr<LasWriter> write_points(const std::string& folder, Simulator& simulator) {
  std::filesystem::create_directories(folder);
  LasOptions options;
  options.trees = true;
  auto writer = std::make_unique<LasWriter>(std::filesystem::path(folder) / "points.laz", options);
  simulator.set_point_sink([&las = *writer](const std::vector<TruePoint>& points) {
    for (const TruePoint& point : points) {
      LasRecord record;
      record.x = point.place.x();
      record.y = point.place.y();
      record.z = point.place.z();
      record.stamp = point.stamp;
      record.intensity = static_cast<std::uint16_t>(point.intensity);
      record.classification = class_of(point.source.surface);
      record.tree_id = static_cast<std::uint32_t>(point.source.tree);
      record.height_above_ground = std::numeric_limits<float>::quiet_NaN();
      las.add(record);
    }
  });
  return writer;
}

// Refuses any output that would replace a file from which the site is read. Every place is looked
// at before anything is made in one of them.
void refuse_places(const SimulateOptions& options, bool capture) {
  std::vector<std::filesystem::path> inputs;
  for (const std::string& file : site_files(options.site, options.settings))
    inputs.emplace_back(file);
  refuse_input_as_output(options.output, inputs);
  for (const char* ending : {".nmea", ".extrinsics.yaml", ".truth"})
    refuse_input_as_output(beside(options.output, ending), inputs);
  if (!capture) return;
  for (const char* ending : {".nmea", ".extrinsics.yaml"})
    (void)place_of_file(beside(options.output, ending), options.overwrite);
}

int simulate(const SimulateOptions& options, CommandContext& context) {
  const std::string ending = std::filesystem::path(options.output).extension().string();
  const bool capture = ending == ".pcap";
  if (ending != ".mcap" && !capture)
    throw ConfigError({"-o " + options.output + ": expected a name that ends in .mcap or .pcap"});
  refuse_places(options, capture);
  Outputs outputs(options, capture);
  Simulator simulator(load_site(options.site, options.settings));
  if (simulator.site().second_lidar.enabled) {
    if (capture) throw ConfigError({"second_lidar: two lidars are written as .mcap only"});
    simulator.give(SimulatedLidars::kBoth);
  }
  std::unique_ptr<LasWriter> points;
  if (simulator.site().truth.points) points = write_points(outputs.truth_part(), simulator);
  bool whole = false;
  if (capture) {
    FieldLogWriter writer(outputs.part(), simulator.site(), simulator.rig());
    whole = write_events(simulator, writer, context);
  } else {
    McapWriterOptions as_driver;
    as_driver.livox = simulator.site().lidar.model == "Mid-360";
    McapWriter writer(outputs.part(), as_driver);
    writer.set_rig(simulator.rig());
    whole = write_events(simulator, writer, context);
  }
  simulator.write_truth(outputs.truth_part());
  if (points) points->commit();
  if (!whole && outputs.replaces()) {
    context.log.warn("simulate.stopped", "stopped early: " + options.output + " is left as it was");
    return kExitUntrusted;
  }
  outputs.commit();
  std::printf("%s\n%s\n", options.output.c_str(), beside(options.output, ".truth").c_str());
  if (!whole) context.log.warn("simulate.stopped", "stopped early: the recording is partial");
  return whole ? kExitDone : kExitUntrusted;
}

int run_simulate(SimulateOptions options, CommandContext& context) {
  if (options.list) return list_sites();
  if (!options.seed.empty()) options.settings.push_back("seed=" + options.seed);
  if (!options.duration_s.empty()) options.settings.push_back("duration_s=" + options.duration_s);
  if (options.keys) return print_keys(options);
  if (options.site.empty() || options.output.empty()) {
    context.log.error(
        "expected SITE and -o REC.mcap: --list names the sites, --print-site their keys");
    return kExitUsage;
  }
  return simulate(options, context);
}

}  // namespace

void add_simulate_command(CLI::App& app, Command& chosen) {
  auto options = std::make_shared<SimulateOptions>();
  CLI::App* command = app.add_subcommand("simulate", "Scan a simulated forest into a recording");
  command->add_option("SITE", options->site, "Name of a shipped site, or a site's YAML file");
  command->add_option("-o,--output", options->output,
                      "Recording to write: REC.mcap, or REC.pcap for a VLP-16");
  command->add_flag("--overwrite", options->overwrite,
                    "Replace the recording and the truth that are there already");
  command->add_option("--seed", options->seed, "Seed of everything random");
  command->add_option("--duration-s", options->duration_s, "Length of the recording in seconds");
  add_settings_option(*command, options->settings);
  command->add_flag("--list", options->list, "Name the shipped sites");
  command->add_flag("--print-site", options->keys, "Print every key of the site with its meaning");
  command->footer(
      "Example: understory simulate handheld -o walk.mcap --seed 7 --duration-s 60\n"
      "writes walk.mcap and the truth to walk.truth/. A name that ends in .pcap gets a VLP-16's\n"
      "capture with the GNSS receiver's NMEA log and the extrinsics beside it.");
  command->callback([options, &chosen] {
    chosen = [options](CommandContext& context) { return run_simulate(*options, context); };
  });
}

}  // namespace understory
