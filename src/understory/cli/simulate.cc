#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "understory/cli/command.h"
#include "understory/recording/mcap_writer.h"
#include "understory/simulation/field_log.h"
#include "understory/simulation/simulator.h"
#include "understory/util/error.h"

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

std::string truth_folder(const std::string& output) {
  std::filesystem::path path(output);
  return path.replace_extension(".truth").string();
}

// Writes all events to a recording of either kind; false if it was stopped.
template <typename Writer>
bool write_events(Simulator& simulator, Writer& writer, CommandContext& context) {
  const double duration = simulator.duration_s();
  std::size_t scans = 0;
  bool stopped = false;
  while (std::optional<Event> event = simulator.next()) {
    writer.write(*event);
    if (!std::holds_alternative<ScanPtr>(*event)) continue;
    ++scans;
    context.progress({"simulating", simulator.progress() * duration, duration, "s of recording",
                      std::to_string(scans) + " scans"});
    stopped = context.stop_requested();
    if (stopped) break;
  }
  writer.finish();
  return !stopped;
}

int simulate(const SimulateOptions& options, CommandContext& context) {
  const std::string ending = std::filesystem::path(options.output).extension().string();
  if (ending != ".mcap" && ending != ".pcap")
    throw ConfigError({"-o " + options.output + ": expected a name that ends in .mcap or .pcap"});
  Simulator simulator(load_site(options.site, options.settings));
  bool whole = false;
  if (ending == ".pcap") {
    FieldLogWriter writer(options.output, simulator.site(), simulator.rig());
    whole = write_events(simulator, writer, context);
  } else {
    McapWriter writer(options.output);
    writer.set_rig(simulator.rig());
    whole = write_events(simulator, writer, context);
  }
  const std::string truth = truth_folder(options.output);
  simulator.write_truth(truth);
  std::printf("%s\n%s\n", options.output.c_str(), truth.c_str());
  if (!whole) context.log.warn("simulate.stopped", "stopped early: the recording is partial");
  return whole ? kExitDone : kExitUntrusted;
}

int run_simulate(SimulateOptions options, CommandContext& context) {
  if (options.list) return list_sites();
  if (!options.seed.empty()) options.settings.push_back("seed=" + options.seed);
  if (!options.duration_s.empty()) options.settings.push_back("duration_s=" + options.duration_s);
  if (options.keys) return print_keys(options);
  if (options.site.empty() || options.output.empty()) {
    context.log.error("expected a site and -o REC.mcap (or --list, --print-site)");
    return kExitUsage;
  }
  return simulate(options, context);
}

}  // namespace

void add_simulate_command(CLI::App& app, Command& chosen) {
  auto options = std::make_shared<SimulateOptions>();
  CLI::App* command = app.add_subcommand("simulate", "Scan a simulated forest into a recording");
  command->add_option("site", options->site, "Name of a shipped site, or a site's YAML file");
  command->add_option("-o,--output", options->output,
                      "Recording to write: REC.mcap, or REC.pcap for a VLP-16");
  command->add_option("--seed", options->seed, "Seed of everything random");
  command->add_option("--duration-s", options->duration_s, "Length of the recording in seconds");
  command->add_option("--set", options->settings, "Change a key of the site: key=value");
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
